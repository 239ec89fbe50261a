"""MAPPO in one file on `BatchEnv`, in the style of CleanRL: no library but torch.

Robots share one actor, which is told who it is. One critic sees all observations, and gives each
robot the value of its own rewards. Source: Yu et al. 2022, "The Surprising Effectiveness of PPO in
Cooperative Multi-Agent Games".
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scoring import Stopwatch, options, report
from torch import Tensor, nn
from torch.distributions import Categorical

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

WORLDS, STEPS, EPOCHS, MINIBATCHES = 256, 25, 3, 6
GAMMA, LAMBDA, CLIP, ENTROPY, RATE, MAX_NORM = 0.98, 0.9, 0.2, 0.01, 2e-3, 0.5


class Rollout(NamedTuple):
    """What T steps of E worlds with R robots gave; all axes T and E are joined to rows."""

    obs: Tensor
    """(T * E, R, D)."""
    actions: Tensor
    """(T * E, R) int64."""
    log_probs: Tensor
    """(T * E, R), of the actions when they were chosen."""
    advantage: Tensor
    """(T * E, R)."""
    returns: Tensor
    """(T * E, R), what the critic learns."""


class Team:
    """The networks: an actor for all robots, and a critic of all.

    Args:
        robots: number of robots R.
        width: columns of an observation D.
        actions: number of actions A.
    """

    def __init__(self, robots: int, width: int, actions: int) -> None:
        self.who = torch.eye(robots)
        self.actor = _layers(width + robots, actions, 0.01)
        self.critic = _layers(width * robots, robots, 1.0)
        self.weights = [*self.actor.parameters(), *self.critic.parameters()]

    def policy(self, obs: Tensor) -> Categorical:
        """Distributions (B, R) of actions for observations (B, R, D)."""
        who = self.who.expand(len(obs), -1, -1)
        return Categorical(logits=self.actor(torch.cat([obs, who], dim=2)), validate_args=False)

    def value(self, obs: Tensor) -> Tensor:
        """Values (B, R) of observations (B, R, D)."""
        values: Tensor = self.critic(obs.flatten(1))
        return values

    @torch.no_grad()
    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """Actions (B, R) int64 for observations (B, R, D)."""
        policy = self.policy(obs)
        chosen: Tensor = policy.logits.argmax(dim=2) if greedy else policy.sample()
        return chosen


def _layers(inputs: int, outputs: int, gain: float) -> nn.Sequential:
    parts: list[nn.Module] = []
    for width_in, width, scale in ((inputs, 64, 2**0.5), (64, 64, 2**0.5), (64, outputs, gain)):
        layer = nn.Linear(width_in, width)
        nn.init.orthogonal_(layer.weight, scale)
        nn.init.zeros_(layer.bias)
        parts += [layer, nn.Tanh()]
    return nn.Sequential(*parts[:-1])


def train(scenario: Scenario, seed: int) -> Iterator[tuple[int, Team]]:
    """Train for ever; after every update, the env-steps so far and the team."""
    torch.manual_seed(seed)
    with closing(BatchEnv(scenario, WORLDS, seed=seed, copy=False)) as env:
        team = Team(env.num_robots, env.obs_width, env.num_actions)
        adam = torch.optim.Adam(team.weights, lr=RATE, eps=1e-5, fused=True)
        obs, done = np.array(env.reset()), 0
        while True:
            rollout, obs = collect(env, team, obs)
            update(team, adam, rollout)
            done += WORLDS * STEPS
            yield done, team


@torch.no_grad()
def collect(
    env: BatchEnv, team: Team, obs: NDArray[np.float32]
) -> tuple[Rollout, NDArray[np.float32]]:
    """Let the team act for `STEPS` steps; returns the rollout and the observations after it."""
    seen = np.empty((STEPS + 1, *obs.shape), np.float32)  # views are copied here, once
    seen[0] = obs
    terminated, ended = torch.zeros(2, STEPS, WORLDS, 1).unbind()
    rewards = torch.zeros(STEPS, WORLDS, env.num_robots)
    last: dict[int, Tensor] = {}  # values at the end of episodes, by step
    actions, log_probs = [], []
    for t in range(STEPS):
        policy = team.policy(torch.from_numpy(seen[t]))
        actions.append(policy.sample())
        log_probs.append(policy.log_prob(actions[t]))
        step = env.step(actions[t].numpy())
        seen[t + 1] = step.obs
        rewards[t] = torch.from_numpy(np.array(step.reward))
        over = step.terminated | step.truncated
        if over.any():  # `step.obs` is of the next episode there
            terminated[t, :, 0] = torch.from_numpy(step.terminated.astype(np.float32))
            ended[t, :, 0] = torch.from_numpy(over.astype(np.float32))
            last[t] = team.value(torch.from_numpy(np.array(step.final_obs)))
    kept = torch.from_numpy(seen)
    values = team.value(kept.flatten(0, 1)).view(STEPS + 1, WORLDS, -1)
    advantage, later = torch.empty_like(rewards), torch.zeros_like(rewards[0])
    for t in reversed(range(STEPS)):
        after = torch.where(ended[t] > 0, last[t], values[t + 1]) if t in last else values[t + 1]
        delta = rewards[t] + GAMMA * (1 - terminated[t]) * after - values[t]
        later = delta + GAMMA * LAMBDA * (1 - ended[t]) * later
        advantage[t] = later
    rows = (kept[:-1], torch.stack(actions), torch.stack(log_probs), advantage)
    returns = advantage + values[:-1]
    return Rollout(*(part.flatten(0, 1) for part in (*rows, returns))), seen[-1]


def update(team: Team, adam: torch.optim.Adam, rollout: Rollout) -> None:
    """Pass over a rollout `EPOCHS` times."""
    size = len(rollout.obs)
    for _ in range(EPOCHS):
        for rows in torch.randperm(size).split(size // MINIBATCHES):
            part = Rollout(*(tensor[rows] for tensor in rollout))
            advantage = (part.advantage - part.advantage.mean()) / (part.advantage.std() + 1e-8)
            policy = team.policy(part.obs)
            ratio = (policy.log_prob(part.actions) - part.log_probs).exp()
            clipped = ratio.clamp(1 - CLIP, 1 + CLIP)
            surrogate = torch.minimum(ratio * advantage, clipped * advantage).mean()
            error = 0.5 * (team.value(part.obs) - part.returns).square().mean()
            loss = error - surrogate - ENTROPY * policy.entropy().mean()
            adam.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(team.weights, MAX_NORM)
            adam.step()


def main() -> None:
    """Train for a number of env-steps and score the team."""
    given = options(__doc__, 500_000)
    watch = Stopwatch()
    training = train(Scenario.preset(given.situation), given.seed)
    done, team = next(training)
    while done < given.env_steps:
        done, team = next(training)
    spent = watch.stop()

    def actor(obs: NDArray[np.float32]) -> NDArray[np.int64]:
        actions: NDArray[np.int64] = team.act(torch.from_numpy(obs), greedy=True).numpy()
        return actions

    report("innerattn", "single-file MAPPO", given, done, spent, actor)


if __name__ == "__main__":
    main()
