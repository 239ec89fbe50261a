"""`Exported`: a team that `innerattn export` wrote acts, for one robot or for whole worlds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.errors import ExportError, ReadingError
from innerattn.policies.exported.backend import (
    Actor,
    Backend,
    OnnxActor,
    chosen_backend,
    onnx_mark,
)
from innerattn.policies.exported.contract import WEIGHTS, Contract, Member
from innerattn.policies.exported.decision import (
    Decision,
    twist_command,
    velocity_command,
    wheel_speeds,
)
from innerattn.policies.exported.folder import ExportFolder, read_export
from innerattn.policies.exported.frame import frame_of
from innerattn.policies.exported.network import NumpyActor, probabilities_of
from innerattn.policies.exported.pair_network import PairActor, PairLayers
from innerattn.policies.exported.readings import RowBuilder
from innerattn.policies.exported.tensors import tensors_in
from innerattn.policies.exported.view import ViewActor, ViewFile

_NOTHING = np.zeros(0, np.float32)


class Seen(Protocol):
    """What a team sees of whole worlds."""

    @property
    def obs(self) -> NDArray[np.float32]:
        """(E, R, D) float32, the robots' observations."""


class Exported:
    """An exported team; a `Policy`, too, so that it can be played and measured in worlds.

    Attributes:
        contract: what ``contract.json`` says.
        backend: what computes it, "onnxruntime" or "numpy".
        greedy: whether it takes the likeliest action instead of drawing one.
        name: method of the training.
    """

    needs_true_state = False

    def __init__(
        self,
        folder: str | Path,
        *,
        backend: Backend | None = None,
        greedy: bool | None = None,
        max_age_s: float | None = None,
        seed: int = 0,
    ) -> None:
        """Read a folder; each file is checked against its SHA-256.

        Args:
            folder: what `innerattn export` wrote.
            backend: "onnxruntime" or "numpy"; None: onnxruntime where it is installed, but numpy
                for a policy for any team, which it computes sooner.
            greedy: take the likeliest actions; None: as the contract says.
            max_age_s: how old readings may be [s]; None: as the contract says.
            seed: of the actions that are drawn.

        Raises:
            ExportError: no such folder, a file is missing, altered, or of another team, or
                onnxruntime is asked for and there is no ONNX file.
            MissingLibraryError: onnxruntime is asked for and not installed.
            ValueError: an unknown backend, or an age that is not above 0.
        """
        chosen = chosen_backend(backend)
        found = read_export(folder)
        self.contract: Contract = found.contract
        if self.contract.network.pairs is not None:
            if backend is None:
                chosen = "numpy"
            elif chosen == "onnxruntime" and WEIGHTS in self.contract.actors.values():
                raise ExportError(
                    f"{found.path}: backend = 'onnxruntime': must be 'numpy' or None; this export "
                    "of a policy for any team has no ONNX file"
                )
        self.backend = chosen
        age = self.contract.max_age_s if max_age_s is None else max_age_s
        if not 0 < age < np.inf:
            raise ValueError(f"max_age_s = {age}: must be above 0 and finite")
        self.greedy = self.contract.greedy_actions if greedy is None else greedy
        self.name = str(self.contract.run.get("method", "exported"))
        self._numbers = {robot.name: index for index, robot in enumerate(self.contract.robots)}
        self._width = len(self.contract.observation)
        try:
            _check_names(self.contract)
            robots = range(len(self._numbers))
            self._builders = [RowBuilder(self.contract, robot, age) for robot in robots]
            self._actors = _actors(found, self.backend)
            _refuse_not_finite(self.contract, self._actors)
        except ValueError as error:
            raise ExportError(f"{found.path}: {error}") from error
        self._forces = [
            np.array(
                [action.force for action in robot.actions or self.contract.actions], np.float32
            )
            for robot in self.contract.robots
        ]
        self._continuous = self.contract.action_kind == "continuous"
        self._draws = np.random.default_rng(seed)

    @property
    def robot_names(self) -> tuple[str, ...]:
        """Names of the robots, in the order of the worlds."""
        return tuple(self._numbers)

    def decide(self, robot: str, readings: Mapping[str, Any] | ArrayLike) -> Decision:
        """Choose the next action of one robot.

        Args:
            robot: its name.
            readings: a row (D,) of numbers, or a mapping in the frame of the world:
                ``own``: ``position`` [m] and ``velocity`` [m/s], two numbers each; optional
                ``available`` (True) and ``faults`` (all healthy); of a robot on wheels ``heading``
                [rad from the x axis, counterclockwise] and ``turn_rate`` [rad/s]; ``ranges`` [m] of
                its rays in their order, None or inf where one meets nothing; ``charge`` and
                ``load``, shares of what it holds;
                ``teammates``: the last message of each by name, of the same form, without
                ``turn_rate`` and ``ranges``; who is left out or None is not heard, and its columns
                are zeros. Where sight is limited, these are the teammates that it sees; a teammate
                that it saw ``since_seen`` seconds ago is ``{"since_seen": 2.5}``;
                ``victims``: a list of ``task`` and ``position``, and of ``served``, ``time_left``
                and ``blocked`` where there are such columns; None for an empty slot. Where sight is
                limited, ``{"since_seen": 2.5}`` stands for a victim that it does not see now, and a
                victim that it is told of has ``since_seen``, too;
                ``heard``: names of the teammates that it hears, where communication is limited;
                optional ``now`` [s]: then ``own.time``, ``victims_time`` and each teammate's
                ``time`` must be there. A message that is too old counts as not heard, or not seen.

        Raises:
            ReadingError: a reading is wrong, missing or not finite, or so large that the policy
                gives no finite numbers; `field` names it.
            StaleReadingError: the robot's own reading or that of the victims is too old.
        """
        number = self._number(robot)
        builder = self._builders[number]
        if isinstance(readings, Mapping):
            row = builder.row(readings)
        else:
            row = builder.checked_row(readings)
        logits = self._logits(number, row[None])
        if self._continuous:
            force = self._drawn(logits)[0]
            length = np.sqrt((force * force).sum())
            if length > 1.0 and not self.contract.robots[number].has_wheels:
                force /= length
            return Decision(None, _NOTHING, force, row)
        action = int(self._chosen(logits)[0])
        return Decision(action, probabilities_of(logits)[0], self._forces[number][action], row)

    def row(self, robot: str, readings: Mapping[str, Any]) -> NDArray[np.float32]:
        """The observation (D,) float32 that `decide` makes of readings; raises what it does."""
        return self._builders[self._number(robot)].row(readings)

    def dark_row(
        self,
        robot: str,
        *,
        available: bool = True,
        faults: Mapping[str, float] | None = None,
        **stores: float,
    ) -> NDArray[np.float32]:
        """The observation (D,) float32 of a robot whose sensors give nothing (`blackout`).

        Args:
            robot: its name.
            available: whether it drives and helps.
            faults: those in effect; None: it is healthy.
            **stores: ``charge`` and ``load`` of a robot that has them, as shares.

        Raises:
            ReadingError: no such robot, or a reading is wrong or missing.
        """
        own = {"available": available, "faults": faults or {}, **stores}
        return self._builders[self._number(robot)].dark_row(own)

    def velocity_command(
        self, robot: str, force: ArrayLike, velocity: ArrayLike
    ) -> NDArray[np.float32]:
        """The velocity (2,) float32 [m/s] that an action sets for one control period.

        Args:
            robot: its name; it has no wheels.
            force: (2,) share of full force or speed, as `Decision.force`.
            velocity: (2,) its present velocity [m/s].

        Raises:
            ReadingError: no such robot, it has wheels, or not two finite numbers.
        """
        member = self._member(robot, "force", "velocity")
        return velocity_command(
            self.contract, member, _two(force, "force"), _two(velocity, "velocity")
        )

    def twist_command(self, robot: str, force: ArrayLike, twist: ArrayLike) -> NDArray[np.float32]:
        """The speed [m/s] and turn rate [rad/s] (2,) float32 that an action sets for one period.

        Args:
            robot: its name; it has wheels.
            force: (2,) shares that it sets, as `Decision.force`.
            twist: (2,) its present speed along its heading [m/s] and turn rate [rad/s].

        Raises:
            ReadingError: no such robot, it has no wheels, or not two finite numbers.
        """
        member = self._member(robot, "unicycle", "differential")
        return twist_command(self.contract, member, _two(force, "force"), _two(twist, "twist"))

    def wheel_speeds(self, robot: str, twist: ArrayLike) -> NDArray[np.float32]:
        """The speeds (2,) float32 [m/s] of the left and the right wheel of a differential drive.

        Args:
            robot: its name.
            twist: (2,) speed along its heading [m/s] and turn rate [rad/s].

        Raises:
            ReadingError: no such robot, it has another drive, or not two finite numbers.
        """
        return wheel_speeds(self._member(robot, "differential"), _two(twist, "twist"))

    def act(self, view: Seen) -> NDArray[Any]:
        """Choose the actions of whole worlds, (E, R) or (E, R, 2); see `Policy.act`.

        Args:
            view: as of `PolicyInput`; its ``obs`` (E, R, D) float32 alone is looked at.

        Raises:
            ReadingError: the observations are not those of this team, or not finite.
        """
        shape = (len(self._numbers), self._width)
        if view.obs.ndim != 3 or view.obs.shape[1:] != shape:
            raise ReadingError(
                "obs", f"has shape {view.obs.shape}: must be (E, {shape[0]}, {shape[1]})"
            )
        if not np.isfinite(view.obs).all():
            raise ReadingError("obs", "holds a number that is not finite")
        rows = np.ascontiguousarray(view.obs.transpose(1, 0, 2), np.float32)
        logits = [self._logits(number, own) for number, own in enumerate(rows)]
        stacked = np.stack(logits, axis=1)
        return self._drawn(stacked) if self._continuous else self._chosen(stacked)

    def logits(self, robot: str, rows: NDArray[np.float32]) -> NDArray[np.float32]:
        """Logits (B, A) float32 of a robot's actions for observations (B, D) float32.

        (B, 4) where actions are continuous: means x and y, then log standard deviations of both,
        before tanh.
        """
        return self._logits(self._number(robot), rows)

    def _logits(self, number: int, rows: NDArray[np.float32]) -> NDArray[np.float32]:
        """What a policy gives; numbers that are not finite choose no action."""
        found = self._actors[number].logits(rows)
        if not np.isfinite(found).all():
            robot = self.contract.robots[number].name
            raise ReadingError("row", f"is beyond what the policy of {robot} can act on")
        return found

    def reset(self, seed: int) -> None:
        """See `Policy.reset`."""
        self._draws = np.random.default_rng(seed)

    def _chosen(self, logits: NDArray[np.float32]) -> NDArray[np.int64]:
        """The likeliest, or drawn actions (...) of logits (..., A)."""
        if self.greedy:
            return np.asarray(logits.argmax(axis=-1))
        return np.asarray((logits + self._draws.gumbel(size=logits.shape)).argmax(axis=-1))

    def _drawn(self, policy: NDArray[np.float32]) -> NDArray[np.float32]:
        """The likeliest or drawn forces (..., 2) of means and log standard deviations (..., 4)."""
        mean, log_std = policy[..., :2], policy[..., 2:]
        if not self.greedy:
            noise: NDArray[np.float32] = np.exp(log_std)
            noise *= self._draws.standard_normal(mean.shape, np.float32)
            mean = mean + noise
        return np.tanh(mean)

    def _member(self, robot: str, *drives: str) -> Member:
        """A robot with one of some drives."""
        member = self.contract.robots[self._number(robot)]
        if member.drive not in drives:
            known = " or ".join(repr(one) for one in drives)
            raise ReadingError("robot", f"{robot} has the drive {member.drive!r}: must be {known}")
        return member

    def _number(self, robot: str) -> int:
        try:
            return self._numbers[robot]
        except (KeyError, TypeError):
            known = ", ".join(self._numbers)
            raise ReadingError("robot", f"is {robot!r}: known are {known}") from None


def _two(value: ArrayLike, place: str) -> NDArray[np.float32]:
    found = np.asarray(value)
    if found.shape != (2,) or found.dtype.kind not in "fiu" or not np.isfinite(found).all():
        raise ReadingError(place, f"is {value!r}: must be two finite numbers")
    return found.astype(np.float32)


def _check_names(contract: Contract) -> None:
    """Refuse a team in which two robots have the same name."""
    if len({robot.name for robot in contract.robots}) != len(contract.robots):
        raise ValueError("robots: a name comes twice")


def _actors(found: ExportFolder, backend: Backend) -> list[Actor]:
    """The policy of each robot."""
    contract = found.contract
    width = len(contract.observation)
    made: dict[str, Actor] = {}
    if contract.network.pairs is not None:
        return _pair_actors(found) if backend == "numpy" else _view_actors(found)
    if backend == "onnxruntime":
        for name, place, mark in _onnx_files(found):
            data = found.files[contract.actors[name]]
            made[name] = OnnxActor(data, place, contract, mark)
    else:
        tensors = tensors_in(found.files[WEIGHTS])
        for name in contract.actors:
            frame, own = frame_of(contract, name), _tensors_of(name, tensors)
            made[name] = NumpyActor(contract.network, own, width, contract.outputs, frame)
    return [made[robot.actor] for robot in contract.robots]


def _pair_actors(found: ExportFolder) -> list[Actor]:
    """Those of a policy for any team: each has the same layers, and a table of its own."""
    contract = found.contract
    tensors = tensors_in(found.files[WEIGHTS])
    layers = {
        name: PairLayers(contract.network, _tensors_of(name, tensors)) for name in contract.actors
    }
    return [
        PairActor(contract, number, layers[robot.actor])
        for number, robot in enumerate(contract.robots)
    ]


def _view_actors(found: ExportFolder) -> list[Actor]:
    """The same in onnxruntime: each robot has the same file, and a table of its own."""
    contract = found.contract
    files = {
        name: ViewFile(found.files[contract.actors[name]], place, mark)
        for name, place, mark in _onnx_files(found)
    }
    return [
        ViewActor(contract, number, files[robot.actor])
        for number, robot in enumerate(contract.robots)
    ]


def _onnx_files(found: ExportFolder) -> list[tuple[str, str, str]]:
    """Name, place and mark of each actor's file."""
    contract = found.contract
    digests = contract.weights_sha256, contract.scenario_sha256
    return [
        (name, str(found.path / file), onnx_mark(*digests, name))
        for name, file in contract.actors.items()
    ]


def _tensors_of(
    actor: str, tensors: Mapping[str, NDArray[np.float32]]
) -> dict[str, NDArray[np.float32]]:
    """The arrays of one actor, by the names of its layers."""
    start = f"{actor}."
    return {key[len(start) :]: value for key, value in tensors.items() if key.startswith(start)}


def _refuse_not_finite(contract: Contract, actors: list[Actor]) -> None:
    """Refuse policies that give no finite numbers even where all that they see is 0."""
    row = np.zeros((1, len(contract.observation)), np.float32)
    for robot, actor in zip(contract.robots, actors):
        if not np.isfinite(actor.logits(row)).all():
            raise ValueError(f"{robot.actor}: gives numbers that are not finite; it is damaged")
