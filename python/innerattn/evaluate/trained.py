"""A trained run as a policy that can be evaluated; it trains nothing."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from innerattn.config import RunConfig, Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.learn.types import ActorAttention, Learner, RememberingLearner
from innerattn.policies import PolicyInput
from innerattn.train import load_policy
from innerattn.train.teams.policy import TeamPolicy


class TrainedPolicy:
    """Acts as a learner does, by drawing actions or by taking the likeliest."""

    needs_true_state = False

    def __init__(self, learner: Learner, name: str, *, greedy: bool = False) -> None:
        """Wrap ``learner``; ``greedy`` takes the likeliest actions."""
        self.name = name
        self._learner = learner
        self._greedy = greedy

    def act(self, view: PolicyInput) -> NDArray[Any]:
        """See `Policy.act`."""
        actions = self._learner.act(torch.tensor(view.obs), greedy=self._greedy)
        return np.asarray(actions.numpy())

    def reset(self, seed: int) -> None:
        """See `Policy.reset`."""
        self._learner.seed_draws(seed)
        self.forget()

    def forget(self) -> None:
        """See `RememberingPolicy.forget`."""
        if isinstance(self._learner, RememberingLearner):
            self._learner.forget()

    def attention(self, view: PolicyInput, actions: NDArray[Any]) -> NDArray[np.float32] | None:
        """See `Attentive.attention`."""
        weights = self._learner.attention(torch.tensor(view.obs), torch.tensor(actions))
        return None if weights is None else np.asarray(weights.numpy())

    def actor_attention(self, view: PolicyInput) -> NDArray[np.float32] | None:
        """See `AttentiveActor.actor_attention`."""
        if not isinstance(self._learner, ActorAttention):
            return None
        weights = self._learner.actor_attention(torch.tensor(view.obs))
        return None if weights is None else np.asarray(weights.numpy())


def load_trained(
    run: str | Path,
    scenario: Scenario | None = None,
    *,
    greedy: bool | None = None,
    each_sees: bool = False,
) -> tuple[RunConfig, TrainedPolicy]:
    """The configuration of a run and its policy with the newest weights.

    Args:
        run: the run folder.
        scenario: the worlds it is to act in; none: those it was trained in.
        greedy: take the likeliest actions; none: as the configuration says.
        each_sees: let each robot act on its own row, though no fault of ``scenario`` makes senses
            fail; of policies for any team, as others always do.

    Raises:
        RunError: there is no readable run at ``run``, or its robots do not see in ``scenario`` what
            they saw in training, or have messages that would arrive at another time.
        ConfigError: its configuration is not valid.
    """
    config, learner = load_policy(run, scenario=scenario)
    for_one_team = not config.algorithm.for_any_team
    if for_one_team and scenario is not None and _seen(scenario) != _seen(config.scenario):
        raise RunError(
            f"{run}: was trained for other observations than these worlds give "
            f"(another team, other tasks or another number of victims; "
            f"situation {config.scenario.situation!r} there, {scenario.situation!r} here)"
        )
    if config.network.message_width and scenario is not None:
        there, here = (one.message_delay_steps for one in (config.scenario, scenario))
        if there != here:
            raise RunError(
                f"{run}: was trained with communication.delay_steps = {there}: must be {there} "
                f"here, not {here}, because its robots have messages"
            )
    if each_sees and isinstance(learner, TeamPolicy):
        learner.let_each_see()
    greedy = config.evaluate.greedy_actions if greedy is None else greedy
    return config, TrainedPolicy(learner, config.train.method, greedy=greedy)


def _seen(scenario: Scenario) -> tuple[int, int, list[str]]:
    """Number of robots, number of actions and the columns of an observation."""
    with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
        return env.num_robots, env.num_actions, env.observation_names()
