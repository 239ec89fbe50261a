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
from innerattn.policies.plain_team import read_plain_team
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import config_of
from innerattn.report.page.any_team import any_team_document
from innerattn.report.page.one_team import one_team_document


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
        RunError: there is no readable run with weights, its weights are not those of a policy that
            a page computes, or its robots do not see, hear or do in ``scenario`` what they did in
            training.
        ConfigError: its configuration is not valid, or ``scenario`` has what a policy for any team
            does not know.
    """
    files = RunFiles(run)
    config = config_of(files)
    if isinstance(config.algorithm, TeamConfig):
        worlds = config.scenario if scenario is None else scenario
        document, weights = any_team_document(files, config, config.algorithm, worlds)
    else:
        document, weights = one_team_document(read_plain_team(run, scenario), run)
    return PageTeam(config, document | {"tensors": weights.places}, weights.numbers())
