"""Numbers that are not finite: found before anything is learnt from them, and named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from torch import Tensor


class DivergenceError(ArithmeticError):
    """A reward, a loss or a gradient is not finite; nothing was learnt from it.

    Attributes:
        what: The number and its value, such as "losses.critic_loss = inf".
        source: Where it arose first, such as "the gradient of critic.first.weight"; None where
            that is not known.
        robot: Index of the robot whose number it is; None where robots share it.
    """

    def __init__(self, what: str, source: str | None = None, robot: int | None = None) -> None:
        """Say that ``what`` is not finite."""
        super().__init__(what)
        self.what, self.source, self.robot = what, source, robot

    def text(self, robots: Sequence[str]) -> str:
        """All in one line, by the names of the robots."""
        robot = "" if self.robot is None else f" of robot {robots[self.robot]}"
        if self.source is None:
            return f"{self.what}{robot}: must be finite"
        return f"{self.what}: must be finite; first in {self.source}{robot}"


def refuse_not_finite_reward(reward: Tensor) -> None:
    """Refuse rewards (E, R).

    Raises:
        DivergenceError: One is not finite.
    """
    finite = reward.isfinite()
    if not bool(finite.all()):
        env, robot = (~finite).nonzero()[0].tolist()
        raise DivergenceError(f"reward = {float(reward[env, robot])}", robot=robot)


def refuse_not_finite_gradients(
    what: str, network: str, num_robots: int, gradients: Mapping[str, Tensor]
) -> None:
    """Refuse gradients of a network by name.

    Args:
        what: What was found not to be finite, and made somebody look.
        network: Its name.
        num_robots: R; gradients (R, ...) have a part for each robot.
        gradients: By name of the parameter.

    Raises:
        DivergenceError: A value is not finite.
    """
    for name, gradient in gradients.items():
        broken = ~gradient.isfinite()
        if bool(broken.any()):
            source = f"the gradient of {network}.{name}"
            by_robot = gradient.dim() > 1 and len(gradient) == num_robots
            robot = int(broken.flatten(1).any(1).nonzero()[0]) if by_robot else None
            raise DivergenceError(what, source, robot)


def not_finite(metrics: Tensor, names: Sequence[str]) -> str:
    """The first of the metrics (n,) that is not finite, with its value."""
    index = int((~metrics.isfinite()).nonzero()[0])
    name = names[index] if index < len(names) else f"metric {index}"
    return f"losses.{name} = {float(metrics[index])}"
