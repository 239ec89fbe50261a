"""A trained team from its run folder, computed by numpy alone: no torch, no export.

What needs more than what a robot sees now, such as a memory, is refused.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from innerattn.config import RunConfig, Scenario
from innerattn.config.team import TeamConfig
from innerattn.config.turning import ray_turns
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError, RunError
from innerattn.policies.columns import able_columns, entity_columns, frame_columns
from innerattn.policies.exported.contract import CONTINUOUS_OUTPUTS, LogStd, Network, PairRules
from innerattn.policies.exported.frame import Frame
from innerattn.policies.exported.network import NumpyActor
from innerattn.policies.policy import PolicyInput
from innerattn.records.run_files import RunFiles
from innerattn.records.run_folder import config_of, weights_name

PUSHES = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)]
"""Direction of each action: stay, +x, -x, +y, -y."""
LOG_STD = LogStd(-3.0, 0.5, math.log(2.5))
"""Of continuous actions, as `innerattn.nn.actions` has it."""
_SLOPE = 0.01  # of the leaky ReLU, as in `innerattn.nn`
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
    def continuous(self) -> bool:
        """Whether actions are vectors."""
        return self.config.scenario.actions == "continuous"

    @property
    def outputs(self) -> int:
        """O, numbers that an actor gives, as `Contract.outputs`."""
        return CONTINUOUS_OUTPUTS if self.continuous else len(PUSHES)

    @property
    def able(self) -> tuple[int, ...]:
        """Columns that are all above 0 where a robot can act; none where it acts as it likes."""
        return able_columns(self.columns) if self.config.network.mask_actions else ()

    @property
    def network(self) -> Network:
        """How the actors' layers make a policy."""
        chosen = self.config.network
        return Network(
            encoder=chosen.encoder,
            hidden_width=chosen.hidden_width,
            leaky_relu_slope=_SLOPE,
            entities=entity_columns(self.columns) if chosen.encoder == "entities" else None,
            frame=None,  # one for each drive
            log_std=LOG_STD if self.continuous else None,
            pooling=chosen.pooling,
        )

    def frame_of(self, drive: str) -> Frame | None:
        """The frames that robots with a drive see in; None where they see the world as it is."""
        if self.config.network.symmetry != "canonical":
            return None
        turning = frame_columns(self.columns, ray_turns(self.config.scenario))
        return Frame(turning, len(self.columns), None if self.continuous else PUSHES, drive)


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
        if key := beyond_numpy(team.config):
            raise RunError(f"numpy alone cannot compute it: {key}")
        self._able, network = list(team.able), team.network
        drives = [robot.drive for robot in team.config.scenario.robots]
        kinds = list(zip(team.groups, drives, strict=True))
        try:
            made = {
                kind: NumpyActor(
                    network,
                    _actor(team, kind[0]),
                    len(team.columns),
                    team.outputs,
                    team.frame_of(kind[1]),
                )
                for kind in dict.fromkeys(kinds)
            }
        except (ValueError, IndexError) as error:
            raise RunError(f"the weights do not fit the configuration: {error}") from error
        self._actors = [made[kind] for kind in kinds]

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """Choose actions (E, R) or (E, R, 2); see `Policy.act`."""
        robots = [actor.logits(view.obs[:, robot]) for robot, actor in enumerate(self._actors)]
        outputs = np.stack(robots, axis=1)
        if self.team.continuous:
            return self._vectors(outputs)
        if self._able:
            unable = (view.obs[:, :, self._able] <= 0.0).any(axis=2)
            outputs[unable, 1:] = np.finfo(np.float32).min
        if self.greedy:
            return np.asarray(outputs.argmax(axis=-1))
        return np.asarray((outputs + self._draws.gumbel(size=outputs.shape)).argmax(axis=-1))

    def _vectors(self, outputs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Vectors (E, R, 2) of means and log standard deviations (E, R, 4)."""
        mean, log_std = outputs[..., :2], outputs[..., 2:]
        if not self.greedy:
            noise: NDArray[np.float32] = np.exp(log_std)
            noise *= self._draws.standard_normal(mean.shape, np.float32)
            mean = mean + noise
        return np.tanh(mean)

    def reset(self, seed: int) -> None:
        """See `Policy.reset`."""
        self._draws = np.random.default_rng(seed)


def read_plain_team(run: str | Path, scenario: Scenario | None = None) -> PlainTeam:
    """The team of a run folder, with its newest weights.

    Args:
        run: the folder, or ``zoo:NAME``.
        scenario: the worlds it is to act in; None: its own.

    Raises:
        RunError: there is no readable run with weights, its policy is one for any team, or its
            robots do not see, hear or do in ``scenario`` what they did in training.
        ConfigError: its configuration is not valid.
    """
    files = RunFiles(run)
    config = config_of(files)
    if config.algorithm.for_any_team:
        key = f"train.method = {config.train.method!r}"
        raise RunError(f"{run}: numpy alone cannot compute it: {key}")
    columns = _columns(config.scenario)
    if scenario is not None:
        _refuse_other_worlds(run, config, scenario, columns)
    return PlainTeam(config, columns, newest_tensors(files))


def newest_tensors(files: RunFiles) -> Mapping[str, NDArray[np.float32]]:
    """The float32 arrays of a run's newest weights that belong to actor or critic, by plain names.

    Raises:
        RunError: there are no weights, they cannot be read, or they hold a number that is not
            finite.
    """
    return _tensors(files.path, files.read(weights_name(files), _MOST_BYTES))


def pair_network(team: TeamConfig, scenario: Scenario) -> Network:
    """That of a policy for any team in the worlds of ``scenario``.

    Raises:
        ConfigError: a network makes its last layer of robots' bodies.
    """
    if team.bodies == "hypernetwork":
        raise ConfigError(
            f"team.bodies = {team.bodies!r}: such a policy acts from its run alone; it has no "
            "export, and no page shows it"
        )
    services = tuple(task.service_s for task in scenario.tasks) if scenario.has_services else ()
    return Network(
        encoder="pairs",
        hidden_width=team.hidden_width,
        leaky_relu_slope=0.0,
        entities=None,
        frame=None,
        pooling=_POOLINGS[team.pooling],
        pairs=PairRules(
            scenario.rescue_radius_m,
            scenario.robots_leave,
            team.key_width,
            services,
            scenario.longest_deadline_s,
        ),
    )


def beyond_numpy(config: RunConfig) -> str | None:
    """The key and value that make a policy more than numpy alone computes; None: it can."""
    network = config.network
    refused = [
        (network.memory_width > 0, f"network.memory_width = {network.memory_width}"),
        (network.message_width > 0, f"network.message_width = {network.message_width}"),
    ]
    return next((key for is_so, key in refused if is_so), None)


def _refuse_other_worlds(
    run: str | Path, config: RunConfig, scenario: Scenario, columns: tuple[str, ...]
) -> None:
    """Refuse worlds in which robots do not see, hear or do what they did in training."""
    if _columns(scenario) != columns or scenario.actions != config.scenario.actions:
        raise RunError(
            f"{run}: was trained for other observations than these worlds give (another team, "
            "other tasks or another number of victims)"
        )
    there, here = config.scenario.message_delay_steps, scenario.message_delay_steps
    if config.network.message_width and there != here:
        raise RunError(
            f"{run}: was trained with communication.delay_steps = {there}: must be {there} here, "
            f"not {here}, because its robots have messages"
        )


def _actor(team: PlainTeam, group: int) -> dict[str, NDArray[np.float32]]:
    """The arrays of one of the G networks, by the names that `NumpyActor` knows."""
    prefix = "actor."
    return {
        name.removeprefix(prefix): values[group]
        for name, values in team.tensors.items()
        if name.startswith(prefix)
    }


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
                values = np.frombuffer(body[begin:end], "<f4").reshape(entry["shape"])
                found[_plain_name(name)] = values
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise RunError(f"{run}: its weights cannot be read ({error})") from error
    if not all(np.isfinite(values).all() for values in found.values()):
        raise RunError(f"{run}: its weights hold a number that is not finite; it is damaged")
    return found


def _plain_name(name: str) -> str:
    """The name of an array without the parts that say how networks hold each other."""
    parts = name.removesuffix(".original").split(".")
    return ".".join(part for part in parts if part not in ("network", "parametrizations"))
