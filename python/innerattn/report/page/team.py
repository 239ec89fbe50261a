"""A trained team as numbers that a page computes with; neither torch nor onnx is needed.

What a page cannot compute is refused.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from innerattn.config import RunConfig, Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.policies.exported.contract import FrameColumns
from innerattn.policies.exported.frame import Frame
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import config_of, weights_name

_PUSHES = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]
"""Direction of each action: stay, +x, -x, +y, -y."""
_HANDED = (".fault.heading_bias", ".turn_rate", ".left")
_MOST_BYTES = 1 << 26
_ACTOR = ("actor.first", "actor.second", "actor.output")
_ENCODERS = ("critic.state_encoder", "critic.action_encoder")
_LOOKS = ("critic.attention.query", "critic.attention.key")


@dataclass(frozen=True)
class PageTeam:
    """A team.

    Attributes:
        config: that of its run.
        document: what the page's `Team` takes, as JSON.
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
        ConfigError: its configuration is not valid.
    """
    files = RunFiles(run)
    config = config_of(files)
    _refuse(run, config)
    names = _columns(config.scenario)
    if scenario is not None and _columns(scenario) != names:
        raise RunError(
            f"{run}: was trained for other observations than these worlds give (another team, "
            "other tasks or another number of victims)"
        )
    tensors = _tensors(run, files.read(weights_name(files), _MOST_BYTES))
    network = config.network
    attends = (
        network.attention
        if _ENCODERS[0] in {name.rpartition(".")[0] for name in tensors}
        else "none"
    )
    wanted = [f"{layer}.{part}" for layer in _ACTOR for part in ("weight", "bias")]
    if attends in ("inner", "frozen"):
        wanted += [f"{layer}.{part}" for layer in _ENCODERS for part in ("weight", "bias")]
        wanted += _LOOKS
    places, numbers, begin = {}, [], 0
    for name in wanted:
        if name not in tensors:
            raise RunError(f"{run}: a page cannot play it: its weights hold no {name}")
        places[name] = {"begin": begin, "shape": list(tensors[name].shape)}
        numbers.append(tensors[name].ravel())
        begin += tensors[name].size
    groups = [
        robot.kind if network.parameter_sharing == "kind" else robot.name
        for robot in config.scenario.robots
    ]
    document = {
        "width": len(names),
        "actions": len(_PUSHES),
        "rows": [list(dict.fromkeys(groups)).index(group) for group in groups],
        "greedy": config.evaluate.greedy_actions,
        "heads": 0 if attends not in ("inner", "frozen", "uniform") else network.attention_heads,
        "uniform": attends == "uniform",
        "available": names.index("own.available") if network.mask_unavailable else -1,
        "frame": _frame(names) if network.symmetry == "canonical" else None,
        "tensors": places,
    }
    return PageTeam(config, document, np.concatenate(numbers))


def frame_columns(names: Sequence[str]) -> FrameColumns:
    """The columns that turn with the world, and those that choose the frame.

    Args:
        names: of all columns, as the worlds name them.
    """
    place = {name: column for column, name in enumerate(names)}
    stems = [name.removesuffix(".x") for name in names if name.endswith(".x")]
    pairs = {stem: (place[f"{stem}.x"], place[f"{stem}.y"]) for stem in stems}
    own = [stem for stem in ("own.position", "own.velocity") if stem in pairs]
    anchors = [stem for stem in stems if stem.startswith("victim_")] + own
    return FrameColumns(
        vectors=tuple(pairs.values()),
        handed=tuple(place[name] for name in names if name.endswith(_HANDED)),
        anchors=tuple(pairs[stem] for stem in anchors),
    )


def _frame(names: Sequence[str]) -> dict[str, Any]:
    """The tables of the frames that a team sees in."""
    frame = Frame(frame_columns(names), len(names), _PUSHES)
    assert frame.forward is not None  # as actions are discrete
    tables = {"signs": frame.signs.astype(int), "order": frame.order, "forward": frame.forward}
    return {name: table.tolist() for name, table in (tables | {"x": frame.x, "y": frame.y}).items()}


def _refuse(run: str | Path, config: RunConfig) -> None:
    """Refuse policies that a page cannot compute, by the key that says so."""
    network, scenario = config.network, config.scenario
    turns = network.symmetry == "canonical"
    refused = [
        (config.algorithm.for_any_team, f"train.method = {config.train.method!r}"),
        (network.encoder != "flat", f"network.encoder = {network.encoder!r}"),
        (network.memory_width > 0, f"network.memory_width = {network.memory_width}"),
        (network.message_width > 0, f"network.message_width = {network.message_width}"),
        (scenario.actions != "discrete", f"scenario.actions = {scenario.actions!r}"),
        (turns and scenario.has_wheels, "network.symmetry = 'canonical' with robots on wheels"),
        (
            turns and any(robot.range_sensor is not None for robot in scenario.robots),
            "network.symmetry = 'canonical' with range sensors",
        ),
    ]
    for is_so, key in refused:
        if is_so:
            raise RunError(f"{run}: a page cannot play it: {key}; innerattn play can")


def _columns(scenario: Scenario) -> list[str]:
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        return env.observation_names()


def _tensors(run: str | Path, data: bytes) -> Mapping[str, NDArray[np.float32]]:
    """The float32 arrays of a weights file that belong to actor or critic, by their plain names."""
    try:
        length = int.from_bytes(data[:8], "little")
        header = json.loads(data[8 : 8 + length])
        body, found = data[8 + length :], {}
        for name, entry in header.items():
            if name.startswith(("actor.", "critic.")) and entry["dtype"] == "F32":
                begin, end = entry["data_offsets"]
                plain = name.replace(".parametrizations.", ".").removesuffix(".original")
                found[plain] = np.frombuffer(body[begin:end], "<f4").reshape(entry["shape"])
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{run}: its weights cannot be read ({error})") from error
    if not all(np.isfinite(values).all() for values in found.values()):
        raise RunError(f"{run}: its weights hold a number that is not finite; it is damaged")
    return found
