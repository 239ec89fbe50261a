"""A trained team from its run folder, computed by numpy alone: no torch, no export.

What takes more than the actors' linear layers, such as a memory, is refused.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from innerattn.config import RunConfig, Scenario
from innerattn.config.team import TeamConfig
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.policies.exported.contract import FrameColumns, Network, PairRules
from innerattn.policies.exported.frame import Frame
from innerattn.policies.exported.network import NumpyActor
from innerattn.policies.policy import PolicyInput
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import config_of, weights_name

PUSHES = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]
"""Direction of each action: stay, +x, -x, +y, -y."""
LAYERS = ("first", "second", "output")
"""Of an actor, from observation to logits."""
_SLOPE = 0.01  # of the leaky ReLU, as in `innerattn.nn`
_HANDED = (".fault.heading_bias", ".turn_rate", ".left")
_MOST_BYTES = 1 << 26
_POOLINGS: Mapping[str, Literal["attention", "mean", "max", "nearest"]] = {
    "inner": "attention",
    "uniform": "mean",
    "max": "max",
    "nearest": "nearest",
}
"""What the poolings of policies for any team are called in a contract."""


@dataclass(frozen=True)
class PlainTeam:
    """What a run folder holds of a team.

    Attributes:
        config: that of its run.
        columns: names of the D columns of an observation.
        tensors: float32 arrays of actor and critic by name; ``actor.first.weight`` is (G, out, in).
    """

    config: RunConfig
    columns: tuple[str, ...]
    tensors: Mapping[str, NDArray[np.float32]]

    @property
    def groups(self) -> tuple[int, ...]:
        """Which of the G networks each robot has: its own, or that of its kind."""
        robots = self.config.scenario.robots
        shared = self.config.network.parameter_sharing == "kind"
        names = [robot.kind if shared else robot.name for robot in robots]
        return tuple(list(dict.fromkeys(names)).index(name) for name in names)

    @property
    def frame(self) -> Frame | None:
        """The frames that it sees in; None where it sees the world as it is."""
        if self.config.network.symmetry != "canonical":
            return None
        return Frame(frame_columns(self.columns), len(self.columns), PUSHES)


class PlainPolicy:
    """A team of a run folder as a `Policy`; greedy, it acts as `TrainedPolicy` but for rounding.

    Attributes:
        name: method of the training.
        team: what it computes with.
        greedy: whether it takes the likeliest action instead of drawing one.
    """

    needs_true_state = False

    def __init__(self, team: PlainTeam, *, greedy: bool | None = None) -> None:
        """Make the networks.

        Args:
            team: as of `read_plain_team`.
            greedy: take the likeliest actions; None: as the configuration says.

        Raises:
            RunError: an array is missing, or has another shape than the configuration says.
        """
        self.team = team
        self.name = team.config.train.method
        self.greedy = team.config.evaluate.greedy_actions if greedy is None else greedy
        self._draws = np.random.default_rng(0)
        width, frame = len(team.columns), team.frame
        network = Network("flat", team.config.network.hidden_width, _SLOPE, None, None)
        try:
            made = [
                NumpyActor(network, _actor(team, group), width, len(PUSHES), frame)
                for group in range(max(team.groups) + 1)
            ]
        except (ValueError, IndexError) as error:
            raise RunError(f"the weights do not fit the configuration: {error}") from error
        self._actors = [made[group] for group in team.groups]

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """Choose actions (E, R); see `Policy.act`."""
        robots = [actor.logits(view.obs[:, robot]) for robot, actor in enumerate(self._actors)]
        logits = np.stack(robots, axis=1)
        if self.greedy:
            return np.asarray(logits.argmax(axis=-1))
        return np.asarray((logits + self._draws.gumbel(size=logits.shape)).argmax(axis=-1))

    def reset(self, seed: int) -> None:
        """See `Policy.reset`."""
        self._draws = np.random.default_rng(seed)


def read_plain_team(run: str | Path, scenario: Scenario | None = None) -> PlainTeam:
    """The team of a run folder, with its newest weights.

    Args:
        run: the folder, or ``zoo:NAME``.
        scenario: the worlds it is to act in; None: its own.

    Raises:
        RunError: there is no readable run with weights, numpy alone cannot compute what its policy
            is, or its robots do not see in ``scenario`` what they saw in training.
        ConfigError: its configuration is not valid.
    """
    files = RunFiles(run)
    config = config_of(files)
    if key := beyond_numpy(config):
        raise RunError(f"{run}: numpy alone cannot compute it: {key}")
    columns = _columns(config.scenario)
    if scenario is not None and _columns(scenario) != columns:
        raise RunError(
            f"{run}: was trained for other observations than these worlds give (another team, "
            "other tasks or another number of victims)"
        )
    return PlainTeam(config, columns, newest_tensors(files))


def newest_tensors(files: RunFiles) -> Mapping[str, NDArray[np.float32]]:
    """The float32 arrays of a run's newest weights that belong to actor or critic, by plain names.

    Raises:
        RunError: there are no weights, they cannot be read, or they hold a number that is not
            finite.
    """
    return _tensors(files.path, files.read(weights_name(files), _MOST_BYTES))


def pair_network(team: TeamConfig, scenario: Scenario) -> Network:
    """That of a policy for any team in the worlds of ``scenario``."""
    return Network(
        encoder="pairs",
        hidden_width=team.hidden_width,
        leaky_relu_slope=0.0,
        entities=None,
        frame=None,
        pooling=_POOLINGS[team.pooling],
        pairs=PairRules(scenario.rescue_radius_m, scenario.robots_leave, team.key_width),
    )


def beyond_numpy(config: RunConfig) -> str | None:
    """The key and value that make a policy more than numpy alone computes; None: it can."""
    network, scenario = config.network, config.scenario
    turns = network.symmetry == "canonical"
    refused = [
        (config.algorithm.for_any_team, f"train.method = {config.train.method!r}"),
        (network.encoder != "flat", f"network.encoder = {network.encoder!r}"),
        (network.memory_width > 0, f"network.memory_width = {network.memory_width}"),
        (network.message_width > 0, f"network.message_width = {network.message_width}"),
        (network.mask_actions, "network.mask_actions = true"),
        (scenario.actions != "discrete", f"scenario.actions = {scenario.actions!r}"),
        (turns and scenario.has_wheels, "network.symmetry = 'canonical' with robots on wheels"),
        (
            turns and any(robot.range_sensor is not None for robot in scenario.robots),
            "network.symmetry = 'canonical' with range sensors",
        ),
    ]
    return next((key for is_so, key in refused if is_so), None)


def frame_columns(names: Sequence[str]) -> FrameColumns:
    """The columns that turn with the world, and those that choose the frame.

    Args:
        names: of all columns, as the worlds name them.
    """
    place = {name: column for column, name in enumerate(names)}
    stems = [name.removesuffix(".x") for name in names if name.endswith(".x")]
    pairs = {stem: (place[f"{stem}.x"], place[f"{stem}.y"]) for stem in stems}
    anchors = [stem for stem in stems if stem.startswith("victim_")]
    anchors += ["own.position", "own.velocity"]
    if "teammate_0.seen" in place:
        teammates = [stem for stem in stems if stem.startswith("teammate_")]
        anchors += ["own.heading", *(stem for stem in teammates if stem.endswith("_position"))]
    return FrameColumns(
        vectors=tuple(pairs.values()),
        handed=tuple(place[name] for name in names if name.endswith(_HANDED)),
        anchors=tuple(pairs[stem] for stem in anchors if stem in pairs),
    )


def _actor(team: PlainTeam, group: int) -> dict[str, NDArray[np.float32]]:
    """The arrays of one of the G networks, by the names that `NumpyActor` knows."""
    names = [f"{layer}.{part}" for layer in LAYERS for part in ("weight", "bias")]
    found = {name: team.tensors.get(f"actor.{name}") for name in names}
    return {name: values[group] for name, values in found.items() if values is not None}


def _columns(scenario: Scenario) -> tuple[str, ...]:
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        return tuple(env.observation_names())


def _tensors(run: Path, data: bytes) -> Mapping[str, NDArray[np.float32]]:
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
