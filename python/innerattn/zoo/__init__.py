"""Trained teams that come with the package: run folders, named ``zoo:NAME`` wherever a run is.

Each folder here holds what a sealed run does, without its checkpoints before the last, its metrics
and its recorded episodes, and a card: how the team was made and what it scores.
`docs/publish_zoo.py` puts runs here.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from innerattn.errors import RunError

PREFIX = "zoo:"
CARD = "card.json"
FOLDER = Path(__file__).parent


def zoo_names(zoo: Path = FOLDER) -> tuple[str, ...]:
    """The names of all teams, without `PREFIX`, in order."""
    return tuple(sorted(card.parent.name for card in zoo.glob(f"[!.]*/{CARD}")))


def run_path(run: str | Path) -> Path:
    """The folder of a run, which may be named by its path or as ``zoo:NAME``.

    Args:
        run: a path, taken as it is unless it begins with `PREFIX`.

    Raises:
        RunError: no team has this name; the message says which there are.
    """
    text = str(run)
    if not text.startswith(PREFIX):
        return Path(run)
    name = text.removeprefix(PREFIX)
    if name not in zoo_names():
        there = ", ".join(f"{PREFIX}{one}" for one in zoo_names())
        raise RunError(f"{text}: no such team; there are {there}")
    return FOLDER / name


def in_zoo(run: str | Path) -> bool:
    """Whether a run, named by its path or as ``zoo:NAME``, is a team of the zoo."""
    return str(run).startswith(PREFIX) or Path(run).resolve().is_relative_to(FOLDER.resolve())


def read_card(name: str, zoo: Path = FOLDER) -> dict[str, Any]:
    """What the card of a team says: how it was made, and what it scored.

    Args:
        name: of the team, without `PREFIX`.
        zoo: where teams are.

    Returns:
        ``name``, ``command``, ``seed``, ``versions``, ``weights_sha256`` and ``training_sha256``
        (of the tensors here, and of all that the training ended with), ``env_steps``, ``script``
        (which has a score of 1), ``worlds_seed`` (of the worlds it was measured in), and
        ``lengths``: for each length of episodes ``episode_steps``, ``episodes``, and
        ``rescues_per_episode`` and ``score`` with ``mean``, ``low`` and ``high`` (95 % interval).
        Where sight is limited, also ``score_as_seen``, the mean score with the script
        `greedy-seen` at 1.

    Raises:
        OSError: there is no such team.
    """
    card: dict[str, Any] = json.loads((zoo / name / CARD).read_text("utf-8"))
    return card
