"""Draws the moving picture of the README; `make docs`, or `python docs/pictures.py RUN` for a run.

A run with attention is drawn with arrows. Without arguments the script `hungarian` drives the team.
"""

from __future__ import annotations

import sys
from pathlib import Path

from innerattn.cli.main import main

PICTURE = Path(__file__).parent / "images" / "rescue.gif"
SCRIPT = ("hungarian", "--seed", "99")

if __name__ == "__main__":
    sys.exit(main(["replay", *(sys.argv[1:] or SCRIPT), "-o", str(PICTURE)]))
