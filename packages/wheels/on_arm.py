"""Tries the wheel for Linux on 64-bit ARM on an x86-64 machine, under QEMU.

usage: python packages/wheels/on_arm.py WHEEL EXPORT [--work FOLDER]

It installs the wheel and what it needs for an ARM Python, lets worlds and an exported team run
there, and compares them with those of the `innerattn` of this Python. The work folder,
``build/arm``, keeps what was fetched. It needs Debian (or a relative), its package
``qemu-user-static``, and once, as root, ``dpkg --add-architecture arm64 && apt-get update``.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

from compare import compare, report

ROOT = Path(__file__).resolve().parents[2]
QEMU = "qemu-aarch64-static"
PYTHON = "3.11"
"""The version of the ARM Python: Debian 12's."""
PACKAGES = (
    f"python{PYTHON}-minimal",
    f"libpython{PYTHON}-minimal",
    f"libpython{PYTHON}-stdlib",
    *("libc6", "libgcc-s1", "zlib1g", "libffi8", "libexpat1", "libssl3", "libbz2-1.0"),
    *("liblzma5", "libuuid1", "libstdc++6"),
)
"""What of Debian that Python and numpy need."""
PLATFORMS = ("manylinux2014", "manylinux_2_17", "manylinux_2_27", "manylinux_2_28")
"""Names of the platforms whose wheels run there."""


def fetch_python(root: Path) -> None:
    """Unpack an ARM Python of Debian into a folder, unless it is there.

    Raises:
        SystemExit: apt-get does not have it.
    """
    if root.is_dir():
        return
    archives, partial = root.with_name("archives"), root.with_name("partial")
    for folder in (archives, partial):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    names = [f"{name}:arm64" for name in PACKAGES]
    if subprocess.run(["apt-get", "download", "-qq", *names], cwd=archives).returncode:
        sys.exit(
            "apt-get has no ARM Python: as root, dpkg --add-architecture arm64 && apt-get update"
        )
    for archive in archives.glob("*.deb"):
        subprocess.run(["dpkg-deb", "-x", str(archive), str(partial)], check=True)
    partial.rename(root)
    shutil.rmtree(archives)


def install(wheel: Path, site: Path) -> None:
    """Install a wheel and what it needs into a folder, for the ARM Python.

    Raises:
        subprocess.CalledProcessError: pip failed.
    """
    shutil.rmtree(site, ignore_errors=True)
    command = [sys.executable, "-m", "pip", "install", "--target", str(site)]
    command += ["--only-binary", ":all:", "--python-version", PYTHON, "--implementation", "cp"]
    for abi in (f"cp{PYTHON.replace('.', '')}", "abi3", "none"):
        command += ["--abi", abi]
    for platform in PLATFORMS:
        command += ["--platform", f"{platform}_aarch64"]
    subprocess.run([*command, str(wheel)], check=True)


def main() -> int:
    """Try what the command line names; the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("wheel", type=Path)
    parser.add_argument("export", type=Path)
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "arm")
    options = parser.parse_args()
    if shutil.which(QEMU) is None:
        sys.exit(f"{QEMU} is not here: apt-get install qemu-user-static")
    if not options.wheel.is_file():
        sys.exit(f"{options.wheel}: no such wheel; make wheels WHEELS=linux-aarch64")
    root, site = options.work.resolve() / "root", options.work.resolve() / "site"
    fetch_python(root)
    install(options.wheel.resolve(), site)
    python = [QEMU, "-L", str(root), str(root / "usr" / "bin" / f"python{PYTHON}")]
    env = {"PYTHONPATH": str(site), "PATH": os.environ["PATH"]}
    return report(compare(python, options.export.resolve(), env))


if __name__ == "__main__":
    sys.exit(main())
