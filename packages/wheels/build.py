"""Builds the wheels of `innerattn` for several systems, each on this machine, with zig as linker.

usage: python packages/wheels/build.py [--out FOLDER] [--rust-src FOLDER] [NAME ...]

Without a NAME it builds all of `WHEELS`. It needs Rust, and maturin and ziglang from PyPI in the
Python that runs it. Where Rust has no standard library for a system (`rustup target add TARGET`
brings it), it compiles the library from its sources: ``--rust-src`` says where they are.
One wheel that fails does not stop the others; the exit code is 1 then.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import shutil
import subprocess
import sys
import time
import zipfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]


class Wheel(NamedTuple):
    """A system that gets a wheel of its own."""

    target: str
    """Rust's name of the system."""
    tag: str
    """How the names of its wheels end, without ``.whl``."""
    format: bytes
    """How its compiled modules begin: the format of the file, and the processor it is for."""
    module: str = "_core.abi3.so"
    """The name of the compiled module."""
    compatibility: str = ""
    """Which of the platforms of Linux the wheel must run on; maturin refuses what needs a later."""


# ELF gives the processor in bytes 18 and 19; the fourteen between hold what all modules share.
_ELF = b"\x7fELF\2\1\1" + bytes(9) + b"\3\0"
WHEELS = {
    "linux-x86_64": Wheel(
        "x86_64-unknown-linux-gnu",
        "manylinux_2_17_x86_64",
        _ELF + b"\x3e\0",
        compatibility="manylinux2014",
    ),
    "linux-aarch64": Wheel(
        "aarch64-unknown-linux-gnu",
        "manylinux_2_17_aarch64",
        _ELF + b"\xb7\0",
        compatibility="manylinux2014",
    ),
    "musl-x86_64": Wheel(
        "x86_64-unknown-linux-musl",
        "musllinux_1_2_x86_64",
        _ELF + b"\x3e\0",
        compatibility="musllinux_1_2",
    ),
    "musl-aarch64": Wheel(
        "aarch64-unknown-linux-musl",
        "musllinux_1_2_aarch64",
        _ELF + b"\xb7\0",
        compatibility="musllinux_1_2",
    ),
    "macos-arm64": Wheel(
        "aarch64-apple-darwin", "macosx_11_0_arm64", b"\xcf\xfa\xed\xfe\x0c\0\0\1"
    ),
    "macos-x86_64": Wheel(
        "x86_64-apple-darwin", "macosx_10_12_x86_64", b"\xcf\xfa\xed\xfe\x07\0\0\1"
    ),
    "windows-x86_64": Wheel("x86_64-pc-windows-gnu", "win_amd64", b"MZ", module="_core.pyd"),
}
"""By the name that the command takes."""


class BuildError(Exception):
    """What keeps a wheel from being built, in one line or in what the compiler says."""


def missing_tools() -> list[str]:
    """What is not here that every wheel needs, each with what brings it."""
    tools = [] if shutil.which("cargo") else ["cargo: install Rust 1.89 or later"]
    modules = ("maturin", "ziglang")
    return tools + [
        f"{name}: {sys.executable} -m pip install {name}"
        for name in modules
        if importlib.util.find_spec(name) is None
    ]


def has_library(target: str) -> bool:
    """Whether Rust here has a compiled standard library for a system."""
    command = ["rustc", "--print", "target-libdir", "--target", target]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return any(Path(done.stdout.strip()).glob("libstd-*"))


def sources_wanted(rust_src: Path) -> str | None:
    """Why the standard library cannot be compiled from a folder; None where it can."""
    if (rust_src / "std" / "Cargo.toml").is_file():
        return None
    return (
        f"{rust_src}: no sources of Rust's standard library; `rustup component add rust-src`"
        " brings them, or RUST_SRC=FOLDER says where they are (they must be of this very rustc)"
    )


def for_windows(target: str, folder: Path) -> dict[str, str]:
    """What zig needs in the environment to compile and link for Windows.

    The sources of mimalloc have a date, which zig takes for an error; not so on other systems. And
    zig must be told what a module exports. maturin writes that into a file, but names the function
    after the whole path, ``PyInit_innerattn._core``, which no module has. A folder in the place of
    its file keeps it from that.

    Args:
        target: Rust's name of the system.
        folder: where cargo builds; it gets the list with the right name.
    """
    place = folder / "maturin" / "innerattn._core.def"
    if place.is_file():
        place.unlink()
    place.mkdir(parents=True, exist_ok=True)
    exports = place / "exports.def"
    exports.write_text("LIBRARY _core\nEXPORTS\n    PyInit__core\n", "utf-8")
    return {
        f"CFLAGS_{target.replace('-', '_')}": "-Wno-error=date-time",
        "CARGO_ENCODED_RUSTFLAGS": f"-C\x1flink-arg={exports}",
    }


def build(wheel: Wheel, out: Path, rust_src: Path) -> Path:
    """Build one wheel, and return its file.

    Args:
        wheel: which.
        out: the folder that gets it.
        rust_src: the folder ``library`` of Rust's sources; used where Rust has no standard library
            for the system.

    Raises:
        BuildError: it cannot be built, or what was built is not for that system.
    """
    command = [sys.executable, "-m", "maturin", "build", "--release", "--quiet", "--locked"]
    command += ["--zig", "--target", wheel.target, "--out", str(out)]
    if wheel.compatibility:
        command += ["--compatibility", wheel.compatibility]
    env = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    env.setdefault("CARGO_TARGET_DIR", str(ROOT / "target" / "wheels"))
    if "windows" in wheel.target:
        env |= for_windows(wheel.target, ROOT / env["CARGO_TARGET_DIR"])
    if not has_library(wheel.target):
        wanted = sources_wanted(rust_src)
        if wanted is not None:
            raise BuildError(wanted)
        command += ["-Z", "build-std=std"]
        env |= {"RUSTC_BOOTSTRAP": "1", "__CARGO_TESTS_ONLY_SRC_ROOT": str(rust_src)}
    before = {path: path.stat().st_mtime_ns for path in out.glob("*.whl")}
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True)
    if done.returncode:
        raise BuildError(f"maturin failed\n{done.stderr}")
    made = [path for path in out.glob("*.whl") if before.get(path) != path.stat().st_mtime_ns]
    if len(made) != 1:
        raise BuildError(f"maturin left {len(made)} new wheels in {out}")
    check(made[0], wheel)
    return made[0]


def check(file: Path, wheel: Wheel) -> None:
    """Compare the name of a wheel and the beginning of its module with what they must be.

    Raises:
        BuildError: they are of another system.
    """
    if not file.stem.endswith(wheel.tag):
        raise BuildError(f"{file.name}: must end with {wheel.tag}.whl")
    with zipfile.ZipFile(file) as archive:
        path = f"innerattn/{wheel.module}"
        if path not in archive.namelist():
            raise BuildError(f"{file.name}: has no {path}")
        if not archive.read(path).startswith(wheel.format):
            raise BuildError(f"{file.name}: {path} is not for {wheel.target}")


def main() -> int:
    """Build what the command line names; the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(WHEELS))
    parser.add_argument("--out", type=Path, default=ROOT / "dist")
    parser.add_argument("--rust-src", type=Path, default=Path("library"), metavar="FOLDER")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in WHEELS]
    if unknown:
        parser.error(f"{unknown[0]}: no such wheel; there are {', '.join(WHEELS)}")
    if missing := missing_tools():
        print("Missing here:", *missing, sep="\n  ", file=sys.stderr)
        return 1
    options.out.mkdir(parents=True, exist_ok=True)
    failed = 0
    for name in options.names or WHEELS:
        print(f"{name}: building", flush=True)
        start = time.monotonic()
        try:
            made = build(WHEELS[name], options.out.resolve(), options.rust_src.resolve())
        except BuildError as error:
            print(f"{name}: not built: {error}", file=sys.stderr, flush=True)
            failed += 1
            continue
        size = made.stat().st_size / 1e6
        print(f"{name}: {made.name}, {size:.1f} MB, {time.monotonic() - start:.0f} s", flush=True)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
