"""The actors of a learner, one by one, as networks that ONNX and numpy can hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from innerattn.config import Robot, RunConfig
from innerattn.errors import ExportError
from innerattn.learn.framed import unframed
from innerattn.learn.types import Learner
from innerattn.nn import Actor, EntityColumns, PerRobotLinear
from innerattn.nn.actions import mean_and_log_std
from innerattn.policies.exported.backend import FORCE, LOGITS, POLICY, PROBABILITIES
from innerattn.policies.exported.frame import Frame


@dataclass(frozen=True)
class TeamActors:
    """The policies of a team.

    Attributes:
        of_robot: name of the actor of each robot.
        actors: for each name, the policy of one robot, R = 1, float32 on the CPU.
    """

    of_robot: tuple[str, ...]
    actors: dict[str, Actor]

    def tensors(self) -> dict[str, Tensor]:
        """Weights (out, in) and biases (out,) by ``ACTOR.LAYER.weight`` and ``.bias``."""
        found = {}
        for name, actor in self.actors.items():
            for layer, linear in _layers(actor).items():
                found[f"{name}.{layer}.weight"] = linear.weight.detach()[0].clone()
                found[f"{name}.{layer}.bias"] = linear.bias.detach()[0].clone()
        return found


def inner_actor(learner: Learner, run: Path) -> Actor:
    """The policies of all robots inside a learner.

    Raises:
        ExportError: the learner has others than those of this package.
    """
    within = unframed(learner)
    actor = getattr(within, "actor", within)
    if type(actor) is not Actor:
        raise ExportError(
            f"{run}: its policy is a {type(actor).__name__}: must be an innerattn.nn.Actor, as of "
            "the methods td-*, ppo-* and mappo"
        )
    return actor


def team_actors(config: RunConfig, actor: Actor, entities: EntityColumns | None) -> TeamActors:
    """Take the policies of all robots apart: one for each robot, or for each kind that shares one.

    Args:
        config: the run.
        actor: the policies of all robots.
        entities: the columns that the actor encodes separately; None: it takes the whole row.
    """
    robots = config.scenario.robots
    of_robot = tuple(robot.name for robot in robots)
    if config.network.parameter_sharing == "kind":
        of_robot = tuple(_shared_name(robot, robots) for robot in robots)
    actors = {}
    for name in dict.fromkeys(of_robot):
        actors[name] = _of_robot(
            actor, of_robot.index(name), entities, pooling=config.network.pooling
        )
    return TeamActors(of_robot, actors)


def _shared_name(robot: Robot, team: Sequence[Robot]) -> str:
    """The actor of a robot's kind; one for each drive, which frames turn in unlike ways."""
    alike = {other.drive for other in team if other.kind == robot.kind} == {robot.drive}
    return robot.kind if alike else f"{robot.kind}-{robot.drive}"


def _of_robot(actor: Actor, robot: int, entities: EntityColumns | None, pooling: str) -> Actor:
    num_actions, hidden_width = actor.output.weight.shape[1:]
    first = actor.first
    obs_width = first.weight.shape[2] if isinstance(first, PerRobotLinear) else 1
    sizes = 1, obs_width, num_actions, hidden_width
    one = Actor(*sizes, torch.Generator(), entities, pooling=pooling)
    theirs = _layers(actor)
    with torch.no_grad():
        for name, layer in _layers(one).items():
            layer.weight.copy_(theirs[name].weight[robot : robot + 1])
            layer.bias.copy_(theirs[name].bias[robot : robot + 1])
    return one


def _layers(actor: Actor) -> dict[str, PerRobotLinear]:
    """The linear layers by name; shared ones are those of all robots, too."""
    found = actor.named_modules()
    return {name: layer for name, layer in found if isinstance(layer, PerRobotLinear)}


class OnnxForm(nn.Module):
    """One robot's policy from the row in the frame of the world to the actions of the world.

    Attributes:
        names: of the outputs.
    """

    names: tuple[str, str] = (LOGITS, PROBABILITIES)

    def __init__(self, actor: Actor, frame: Frame | None) -> None:
        """Put the frame around the actor, if there is one."""
        super().__init__()
        self.actor = actor
        self.framed = frame is not None
        if frame is not None:
            self.signs, self.order = _table(frame.signs), _table(frame.order)
            self.outputs = _table(frame.outputs if frame.forward is None else frame.forward)
            self.mirrors = _table(frame.mirrors)
            self.x, self.y = _table(frame.x), _table(frame.y)
            self.importance = _table(frame.importance)

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Map observations (B, D) to logits (B, A) and probabilities (B, A)."""
        if not self.framed:
            logits = self._logits(observation)
        else:
            element = self._element(observation)
            turned = self._turned(observation, element)
            logits = self._logits(turned).gather(1, self.outputs[element])
        return logits, logits.softmax(dim=1)

    def _turned(self, observation: Tensor, element: Tensor) -> Tensor:
        return (observation * self.signs[element]).gather(1, self.order[element])

    def _logits(self, rows: Tensor) -> Tensor:
        logits: Tensor = self.actor(rows.unsqueeze(0))
        return logits[0].t()

    def _element(self, rows: Tensor) -> Tensor:
        x, y = rows.index_select(1, self.x), rows.index_select(1, self.y)
        mirror_x, mirror_y = self._negative(x), self._negative(y)
        x = torch.where(mirror_x.unsqueeze(1), -x, x)
        y = torch.where(mirror_y.unsqueeze(1), -y, y)
        return mirror_x.long() + 2 * mirror_y.long() + 4 * self._negative(x - y).long()

    def _negative(self, values: Tensor) -> Tensor:
        return values.sign().double() @ self.importance < 0


class OnnxVectorForm(OnnxForm):
    """The same where actions are forces."""

    names = (POLICY, FORCE)

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Map observations (B, D) to `Contract.outputs` (B, 4) and the likeliest force (B, 2)."""
        if not self.framed:
            policy = self._policy(observation)
        else:
            element = self._element(observation)
            inside = self._policy(self._turned(observation, element))
            policy = inside.gather(1, self.outputs[element]) * self.mirrors[element]
        return policy, policy[:, :2].tanh()

    def _policy(self, rows: Tensor) -> Tensor:
        mean, log_std = mean_and_log_std(self.actor(rows.unsqueeze(0)))
        return torch.cat([mean[0], log_std[0]]).t()


def _table(values: NDArray[Any]) -> nn.Buffer:
    return nn.Buffer(torch.from_numpy(values.copy()))
