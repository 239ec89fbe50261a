"""Do worlds do the same on other processors? Runs the committed digests under an emulator.

`python benches/digests_elsewhere.py` runs them on 64-bit ARM, and on an x86-64 processor of 2008,
which lacks AVX and FMA; QEMU plays both. The result is kept for `docs/reliability.md`. It needs an
x86-64 machine, `qemu-user-static` and `rustup target add aarch64-unknown-linux-musl`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from reliability import publish
from reliability_kept import FILE, PAGE, Result, commit, keep, now
from reliability_rows import ELSEWHERE

ROOT = Path(__file__).parents[1]
HERE, ARM = "x86_64-unknown-linux-gnu", "aarch64-unknown-linux-musl"
MACHINES = {
    "64-bit ARM": (ARM, "qemu-aarch64-static"),
    "x86-64 without AVX and FMA": (HERE, "qemu-x86_64-static -cpu Nehalem"),
}
"""Rust's name of what is built for, and the emulator that plays it."""


def same(target: str, emulator: str) -> bool:
    """Whether the worlds do what the digests say."""
    key = f"CARGO_TARGET_{target.upper().replace('-', '_')}"
    env = {**os.environ, f"{key}_RUNNER": emulator}
    command = ["cargo", "test", "--locked", "-p", "innerattn-env", "--test", "worlds"]
    if target != HERE:
        command += ["--target", target]
        env[f"{key}_LINKER"] = "rust-lld"  # it comes with Rust
    command += ["--", "digests::"]
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True)
    if done.returncode:
        print(done.stdout, done.stderr, sep="\n", file=sys.stderr)
    return done.returncode == 0 and re.search(r"\b1 passed; 0 failed", done.stdout) is not None


def result_of(found: dict[str, bool]) -> Result:
    """What the scoreboard shows."""
    notes = [
        f"On {name}, emulated by QEMU: {'the same' if one else 'not the same'}."
        for name, one in found.items()
    ]
    passed = sum(found.values())
    return Result(passed, len(found) - passed, notes=tuple(notes))


def main() -> int:
    """Run, print and keep."""
    tree = commit()
    result = result_of({name: same(*machine) for name, machine in MACHINES.items()})
    print(*result.notes, sep="\n")
    keep(FILE, ELSEWHERE, now(result, (ELSEWHERE,), tree))
    publish(FILE, PAGE)
    return int(bool(result.failed))


if __name__ == "__main__":
    sys.exit(main())
