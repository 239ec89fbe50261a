"""A trained team as numbers that a page computes with; neither torch nor onnx is needed.

What a page cannot compute is refused.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import RunConfig, Scenario
from innerattn.config.team import TeamConfig
from innerattn.errors import RunError
from innerattn.policies.exported.frame import Frame
from innerattn.policies.plain_team import (
    LAYERS,
    PUSHES,
    PlainTeam,
    beyond_numpy,
    read_plain_team,
)
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import config_of
from innerattn.report.page.any_team import any_team_document
from innerattn.report.page.weights import Weights

_ACTOR = tuple(f"actor.{layer}" for layer in LAYERS)
_ENCODERS = ("critic.state_encoder", "critic.action_encoder")
_LOOKS = ("critic.attention.query", "critic.attention.key")


@dataclass(frozen=True)
class PageTeam:
    """A team.

    Attributes:
        config: that of its run.
        document: what the page's `Team` or `AnyTeam` takes, as JSON.
        weights: (N,) float32, all numbers of its networks.
    """

    config: RunConfig
    document: dict[str, Any]
    weights: NDArray[np.float32]

    @property
    def base64(self) -> str:
        """The weights as text: little endian."""
        return base64.b64encode(self.weights.astype("<f4").tobytes()).decode()


def read_team(run: str | Path, scenario: Scenario | None = None) -> PageTeam:
    """The team of a run folder, with its newest weights.

    Args:
        run: the folder, or ``zoo:NAME``.
        scenario: the worlds it is to act in; None: its own.

    Raises:
        RunError: there is no readable run with weights, a page cannot compute what its policy is,
            or its robots do not see in ``scenario`` what they saw in training.
        ConfigError: its configuration is not valid, or ``scenario`` has what a policy for any team
            does not know.
    """
    files = RunFiles(run)
    config = config_of(files)
    if isinstance(config.algorithm, TeamConfig):
        worlds = config.scenario if scenario is None else scenario
        document, weights = any_team_document(files, config, config.algorithm, worlds)
    elif key := beyond_numpy(config):
        raise RunError(f"{run}: a page cannot play it: {key}; innerattn play can")
    else:
        document, weights = _one_team_document(read_plain_team(run, scenario), run)
    return PageTeam(config, document | {"tensors": weights.places}, weights.numbers())


def _one_team_document(team: PlainTeam, run: str | Path) -> tuple[dict[str, Any], Weights]:
    """What the page's `Team` takes, as JSON, and its weights."""
    tensors, network = team.tensors, team.config.network
    attends = (
        network.attention
        if _ENCODERS[0] in {name.rpartition(".")[0] for name in tensors}
        else "none"
    )
    wanted = [f"{layer}.{part}" for layer in _ACTOR for part in ("weight", "bias")]
    if attends in ("inner", "frozen"):
        wanted += [f"{layer}.{part}" for layer in _ENCODERS for part in ("weight", "bias")]
        wanted += _LOOKS
    weights = Weights()
    for name in wanted:
        if name not in tensors:
            raise RunError(f"{run}: a page cannot play it: its weights hold no {name}")
        weights.add(name, tensors[name])
    document = {
        "width": len(team.columns),
        "actions": len(PUSHES),
        "rows": list(team.groups),
        "greedy": team.config.evaluate.greedy_actions,
        "heads": 0 if attends not in ("inner", "frozen", "uniform") else network.attention_heads,
        "uniform": attends == "uniform",
        "available": team.columns.index("own.available") if network.mask_unavailable else -1,
        "frame": None if team.frame is None else _tables(team.frame),
    }
    return document, weights


def _tables(frame: Frame) -> dict[str, Any]:
    """The tables of the frames that a team sees in."""
    assert frame.forward is not None  # as actions are discrete
    tables = {"signs": frame.signs.astype(int), "order": frame.order, "forward": frame.forward}
    return {name: table.tolist() for name, table in (tables | {"x": frame.x, "y": frame.y}).items()}
