"""One rescue world behind PettingZoo's interface of agents in turn (AEC).

PettingZoo's own conversion makes it of the parallel view: the world moves after the last robot of
the team has given its action.
"""

from __future__ import annotations

from typing import Any

from pettingzoo import AECEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper
from pettingzoo.utils.wrappers import OrderEnforcingWrapper

from innerattn.config.scenario import Scenario
from innerattn.envs.parallel import Action, Obs, parallel_env


def env(
    scenario: Scenario | str = "mixed",
    max_cycles: int | None = None,
    render_mode: str | None = None,
    seed: int | None = None,
    **overrides: Any,
) -> AECEnv[str, Obs, Action]:
    """A rescue world as a PettingZoo `AECEnv`.

    Arguments and errors are those of `innerattn.envs.parallel_env`. What is asked before the first
    reset is refused by an AssertionError, as PettingZoo does.
    """
    world = parallel_env(scenario, max_cycles, render_mode, seed, **overrides)
    return OrderEnforcingWrapper(RescueAECEnv(world))


class RescueAECEnv(parallel_to_aec_wrapper[str, Obs, Action]):  # type: ignore[misc]
    """One rescue world, a robot at a time; made by `env`."""

    def step(self, action: Action) -> None:
        """Take the action of the robot whose turn it is; none of one whose episode is over.

        Raises:
            ValueError: the action is out of range; it is still this robot's turn.
            TypeError: the action is of the wrong type; likewise.
        """
        agent = self.agent_selection
        if not (self.terminations[agent] or self.truncations[agent]):
            space = self.action_space(agent)
            if not space.contains(self.env.checked_action(agent, action)):
                raise ValueError(f"actions[{agent!r}] = {action!r}: must be in {space}")
        super().step(action)
