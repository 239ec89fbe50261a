"""MAPPO as a single-file loop over `BatchEnv`, in the style of CleanRL: a stand-in for users' own.

It is ours, not CleanRL's code, which has no MAPPO for these worlds. Robots share one actor, which
is told who it is; one critic values all observations. Numbers are CleanRL's defaults for PPO.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Categorical

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

ENVS, STEPS, EPOCHS, MINIBATCHES = 64, 128, 4, 4
GAMMA, LAMBDA, CLIP, ENTROPY, RATE, MAX_NORM = 0.99, 0.95, 0.2, 0.01, 2.5e-4, 0.5


def _layers(inputs: int, outputs: int, gain: float) -> nn.Sequential:
    parts: list[nn.Module] = []
    for width_in, width, scale in ((inputs, 64, 2**0.5), (64, 64, 2**0.5), (64, outputs, gain)):
        layer = nn.Linear(width_in, width)
        nn.init.orthogonal_(layer.weight, scale)
        nn.init.zeros_(layer.bias)
        parts += [layer, nn.Tanh()]
    return nn.Sequential(*parts[:-1])


class PlainMAPPO:
    """The networks; it acts like a learner of ours."""

    def __init__(self, robots: int, width: int, actions: int) -> None:
        """Draw the weights from torch's global generator."""
        self.who = torch.eye(robots)
        self.actor = _layers(width + robots, actions, 0.01)
        self.critic = _layers(width * robots, 1, 1.0)

    def logits(self, obs: Tensor) -> Tensor:
        """(B, R, A) for observations (B, R, D)."""
        who = self.who.expand(len(obs), -1, -1)
        logits: Tensor = self.actor(torch.cat([obs, who], dim=2))
        return logits

    @torch.no_grad()
    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """Actions (B, R) int64."""
        logits = self.logits(obs)
        return logits.argmax(dim=2) if greedy else Categorical(logits=logits).sample()


def train(scenario: Scenario, seed: int) -> Iterator[tuple[int, PlainMAPPO]]:
    """Train for ever; after every update, the env-steps so far and the team."""
    torch.manual_seed(seed)
    with closing(BatchEnv(scenario, ENVS, seed=seed)) as env:
        team = PlainMAPPO(env.num_robots, env.obs_width, env.num_actions)
        weights = [*team.actor.parameters(), *team.critic.parameters()]
        adam = torch.optim.Adam(weights, lr=RATE, eps=1e-5)
        obs = torch.tensor(env.reset())
        done_steps = 0
        while True:
            kept, obs = _rollout(env, team, obs)
            _update(team, adam, weights, kept)
            done_steps += ENVS * STEPS
            yield done_steps, team


def _rollout(env: BatchEnv, team: PlainMAPPO, obs: Tensor) -> tuple[dict[str, Tensor], Tensor]:
    seen, actions, log_probs, rewards, values, last, ends = [], [], [], [], [], [], []
    for _ in range(STEPS):
        with torch.no_grad():
            chosen = Categorical(logits=team.logits(obs))
            action = chosen.sample()
            values.append(team.critic(obs.flatten(1)))
        step = env.step(action.numpy())
        seen.append(obs)
        actions.append(action)
        log_probs.append(chosen.log_prob(action))
        rewards.append(torch.tensor(step.reward.mean(axis=1, keepdims=True)))
        obs = torch.tensor(step.obs)
        ended = step.terminated | step.truncated
        ends.append(torch.tensor(ended).float().unsqueeze(1))
        with torch.no_grad():
            last.append(team.critic(torch.tensor(step.final_obs).flatten(1)))
    advantages, later = [torch.zeros(ENVS, 1)] * STEPS, torch.zeros(ENVS, 1)
    for t in reversed(range(STEPS)):
        delta = rewards[t] + GAMMA * last[t] - values[t]
        later = delta + GAMMA * LAMBDA * (1.0 - ends[t]) * later
        advantages[t] = later
    advantage = torch.cat(advantages)
    kept = {
        "obs": torch.cat(seen),
        "actions": torch.cat(actions),
        "log_probs": torch.cat(log_probs),
        "advantage": advantage,
        "returns": advantage + torch.cat(values),
    }
    return kept, obs


def _update(
    team: PlainMAPPO,
    adam: torch.optim.Adam,
    weights: list[nn.Parameter],
    kept: dict[str, Tensor],
) -> None:
    size = len(kept["obs"])
    for _ in range(EPOCHS):
        order = torch.from_numpy(np.random.default_rng(size).permutation(size))
        for rows in order.split(size // MINIBATCHES):
            part = {name: tensor[rows] for name, tensor in kept.items()}
            advantage = part["advantage"]
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            policy = Categorical(logits=team.logits(part["obs"]))
            ratio = (policy.log_prob(part["actions"]) - part["log_probs"]).exp()
            clipped = ratio.clamp(1.0 - CLIP, 1.0 + CLIP)
            surrogate = torch.minimum(ratio * advantage, clipped * advantage).mean()
            value = team.critic(part["obs"].flatten(1))
            errors = 0.5 * (value - part["returns"]).square().mean()
            loss = errors - surrogate - ENTROPY * policy.entropy().mean()
            adam.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(weights, MAX_NORM)
            adam.step()
