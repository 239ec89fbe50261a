"""`Exported`: a team that `innerattn export` wrote acts, for one robot or for whole worlds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

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
from innerattn.policies.exported.contract import WEIGHTS, Contract
from innerattn.policies.exported.decision import Decision, velocity_command
from innerattn.policies.exported.folder import ExportFolder, read_export
from innerattn.policies.exported.frame import Frame
from innerattn.policies.exported.network import NumpyActor, probabilities_of
from innerattn.policies.exported.readings import TIMES, RowBuilder
from innerattn.policies.exported.tensors import tensors_in
from innerattn.policies.policy import PolicyInput

_NOTHING = np.zeros(0, np.float32)


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
            backend: "onnxruntime" or "numpy"; None: onnxruntime where it is installed.
            greedy: take the likeliest actions; None: as the contract says.
            max_age_s: how old readings may be [s]; None: as the contract says.
            seed: of the actions that are drawn.

        Raises:
            ExportError: no such folder, or a file is missing, altered, or of another team.
            MissingLibraryError: onnxruntime is asked for and not installed.
            ValueError: an unknown backend, or an age that is not above 0.
        """
        self.backend = chosen_backend(backend)
        found = read_export(folder)
        self.contract: Contract = found.contract
        age = self.contract.max_age_s if max_age_s is None else max_age_s
        if not 0 < age < np.inf:
            raise ValueError(f"max_age_s = {age}: must be above 0 and finite")
        self.greedy = self.contract.greedy_actions if greedy is None else greedy
        self.name = str(self.contract.run.get("method", "exported"))
        self._numbers = {robot.name: index for index, robot in enumerate(self.contract.robots)}
        self._width = len(self.contract.observation)
        try:
            _check_columns(self.contract)
            self._actors = _actors(found, self.backend)
            _refuse_not_finite(self.contract, self._actors)
        except ValueError as error:
            raise ExportError(f"{found.path}: {error}") from error
        self._builders = [RowBuilder(self.contract, i, age) for i in range(len(self._numbers))]
        self._forces = np.array([action.force for action in self.contract.actions], np.float32)
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
                ``available`` (True) and ``faults`` (all healthy);
                ``teammates``: the last message of each by name, of the same form; who is left out
                or None is not heard, and its columns are zeros;
                ``victims``: a list of ``task`` and ``position``; None for an empty slot;
                optional ``now`` [s]: then ``own.time``, ``victims_time`` and each teammate's
                ``time`` must be there. A message that is too old counts as not heard.

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
            return Decision(None, _NOTHING, force / length if length > 1.0 else force, row)
        action = int(self._chosen(logits)[0])
        return Decision(action, probabilities_of(logits)[0], self._forces[action], row)

    def row(self, robot: str, readings: Mapping[str, Any]) -> NDArray[np.float32]:
        """The observation (D,) float32 that `decide` makes of readings; raises what it does."""
        return self._builders[self._number(robot)].row(readings)

    def dark_row(
        self, robot: str, *, available: bool = True, faults: Mapping[str, float] | None = None
    ) -> NDArray[np.float32]:
        """The observation (D,) float32 of a robot whose sensors give nothing (`blackout`).

        Raises:
            ReadingError: no such robot, or a reading is wrong.
        """
        own = {"available": available, "faults": faults or {}}
        return self._builders[self._number(robot)].dark_row(own)

    def velocity_command(
        self, robot: str, force: ArrayLike, velocity: ArrayLike
    ) -> NDArray[np.float32]:
        """The velocity (2,) float32 [m/s] that amounts to a force over one control period.

        Args:
            robot: its name.
            force: (2,) share of full force, as `Decision.force`.
            velocity: (2,) its present velocity [m/s].

        Raises:
            ReadingError: no such robot, or not two finite numbers.
        """
        member = self.contract.robots[self._number(robot)]
        return velocity_command(
            self.contract, member, _two(force, "force"), _two(velocity, "velocity")
        )

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """Choose the actions of whole worlds, (E, R) or (E, R, 2); see `Policy.act`.

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


def _check_columns(contract: Contract) -> None:
    """Refuse a contract whose parts do not make one observation."""
    abilities = contract.abilities
    names = [column.name for column in contract.observation]
    faults = [name for name in names if name.startswith("own.fault.")]
    own = 4 + len(abilities) + 1 + len(faults)  # position and velocity, and availability
    times = sum(f"victim_0.{one}" in names for one in TIMES)
    victim = 3 + len(abilities) + times  # presence and place
    expected = len(contract.robots) * own + contract.victim_slots * victim
    if len(names) != expected or bool(faults) != contract.observe_faults:
        raise ValueError(f"observation: has {len(names)} columns: must have {expected}")
    if len({robot.name for robot in contract.robots}) != len(contract.robots):
        raise ValueError("robots: a name comes twice")


def _actors(found: ExportFolder, backend: Backend) -> list[Actor]:
    """The policy of each robot."""
    contract = found.contract
    width = len(contract.observation)
    made: dict[str, Actor] = {}
    if backend == "onnxruntime":
        for name, file in contract.actors.items():
            mark = onnx_mark(contract.weights_sha256, contract.scenario_sha256, name)
            place = str(found.path / file)
            made[name] = OnnxActor(found.files[file], place, contract, mark)
    else:
        tensors = tensors_in(found.files[WEIGHTS])
        frame = _frame_of(contract)
        for name in contract.actors:
            own = {
                key.removeprefix(f"{name}."): value
                for key, value in tensors.items()
                if key.startswith(f"{name}.")
            }
            made[name] = NumpyActor(contract.network, own, width, contract.outputs, frame)
    return [made[robot.actor] for robot in contract.robots]


def _refuse_not_finite(contract: Contract, actors: list[Actor]) -> None:
    """Refuse policies that give no finite numbers even where all that they see is 0."""
    row = np.zeros((1, len(contract.observation)), np.float32)
    for robot, actor in zip(contract.robots, actors, strict=True):
        if not np.isfinite(actor.logits(row)).all():
            raise ValueError(f"{robot.actor}: gives numbers that are not finite; it is damaged")


def _frame_of(contract: Contract) -> Frame | None:
    """The frame that the policies see in; None where they see the world as it is."""
    if contract.network.frame is None:
        return None
    if contract.action_kind == "continuous":
        return Frame(contract.network.frame, len(contract.observation), None)
    pushes = [(int(x), int(y)) for x, y in (action.force for action in contract.actions)]
    return Frame(contract.network.frame, len(contract.observation), pushes)
