"""A checkout of MAAC's public code: how a person gets one, and whether it is the pinned commit."""

from __future__ import annotations

import subprocess
from pathlib import Path

COMMIT = "6174a01251251e6778c4ada26bc8d9cd930e3856"
GET_IT = f"""\
git clone https://github.com/shariqiqbal2810/MAAC
git -C MAAC checkout {COMMIT}"""


def describe_checkout(checkout: Path, any_commit: bool = False) -> str:
    """The commit of a checkout, and whether its files are those of the commit.

    Args:
        checkout: Folder of the checkout.
        any_commit: Accept another commit than `COMMIT`, and changed files.

    Returns:
        "commit HASH", and "other than the pinned one" or "with changed files" where that is so.

    Raises:
        ValueError: There is no such checkout, or it is not the pinned commit without changes.
    """
    if not (checkout / "algorithms" / "attention_sac.py").is_file():
        raise ValueError(f"{checkout}: not a checkout of MAAC; get one by\n{GET_IT}")
    commit, *inside = _git(checkout, "rev-parse", "HEAD", "--show-prefix").split()
    if inside:
        raise ValueError(f"{checkout}: not a checkout by itself, but {inside[0]} in another one")
    changed = _git(checkout, "status", "--porcelain", "--untracked-files=no")
    if commit != COMMIT and not any_commit:
        raise ValueError(
            f"{checkout}: at commit {commit}, must be at {COMMIT}; check that out, or accept "
            "this one by --any-maac-commit"
        )
    if changed and not any_commit:
        raise ValueError(
            f"{checkout}: has changed files; undo that, or accept them by --any-maac-commit\n"
            + changed
        )
    other = ", other than the pinned one" if commit != COMMIT else ""
    return f"commit {commit}{other}{', with changed files' if changed else ''}"


def _git(checkout: Path, *words: str) -> str:
    try:
        done = subprocess.run(["git", "-C", str(checkout), *words], capture_output=True, text=True)
    except OSError as error:
        raise ValueError(f"{checkout}: its commit is unknown; git does not run: {error}") from error
    if done.returncode:
        raise ValueError(f"{checkout}: its commit is unknown: {done.stderr.strip()}")
    return done.stdout
