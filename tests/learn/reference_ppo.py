"""A plain form of the on-policy learner: loops over worlds, steps, robots and rows."""

import math

import numpy as np
import torch
from reference import Adam, PlainNetwork, PlainTD, clip_factor, pick, policy, values
from torch import Tensor

from innerattn.learn import Transitions


class PlainPPO:
    """Rollouts and updates, in float64."""

    def __init__(self, state, network, numbers, num_actions: int) -> None:
        heads = network.attention_heads
        self.actor = PlainNetwork.cut(state, "actor", heads)
        self.critic = PlainNetwork.cut(state, "critic", heads)
        self.kind, self.numbers, self.num_actions = network.attention, numbers, num_actions
        self.actor_adam = Adam(numbers.learning_rate, 0.0)
        self.critic_adam = Adam(numbers.learning_rate, numbers.critic_weight_decay)
        self.returns: list[list[float]] = []
        self.open: dict[tuple[int, int], float] = {}

    def fitted(self, obs: Tensor, actions: Tensor) -> tuple[list[Tensor], Tensor]:
        """By robot the value that is fitted, and the logit penalty."""
        out = values(self.critic, obs, actions, self.kind, num_actions=self.num_actions)
        if self.numbers.advantage == "value":
            return [q[:, 0] for q in out.q], out.penalty
        return [pick(q, actions[:, i]) for i, q in enumerate(out.q)], out.penalty

    @torch.no_grad()
    def baseline(self, obs: Tensor, actions: Tensor, robot: int) -> float:
        """Of one world (1, R, ...)."""
        q = values(self.critic, obs, actions, self.kind, num_actions=self.num_actions).q[robot][0]
        if self.numbers.advantage == "value":
            return float(q[0])
        return float((policy(self.actor, obs)[robot][0].exp() * q).sum())

    def rollout(self, steps, drawn: Tensor) -> dict[str, Tensor]:
        """Advantage and target (R, T * E) and so on; `drawn` (R, n) are actions at cuts."""
        numbers, (envs, robots) = self.numbers, steps[0][0].obs.shape[:2]
        steps = [
            (Transitions(*(x.double() if x.is_floating_point() else x for x in b[:5])), c)
            for b, c in steps
        ]
        if not self.returns:
            self.returns = [[] for _ in range(robots)]
        for batch, cut in steps:
            for env in range(envs):
                for robot in range(robots):
                    total = float(batch.reward[env, robot]) + numbers.gamma * self.open.get(
                        (env, robot), 0.0
                    )
                    self.returns[robot].append(total)
                    self.open[env, robot] = 0.0 if batch.terminated[env] or cut[env] else total
        scale = [
            max(
                float(torch.tensor(r, dtype=torch.float64).std(correction=0)),
                numbers.return_deviation_floor,
            )
            for r in self.returns
        ]
        cuts = [
            (t, env)
            for t, (batch, cut) in enumerate(steps)
            for env in range(envs)
            if batch.terminated[env] or cut[env] or t == len(steps) - 1
        ]
        advantage = torch.zeros(robots, len(steps) * envs, dtype=torch.float64)
        target = torch.zeros_like(advantage)
        for robot in range(robots):
            for env in range(envs):
                later = 0.0
                for t in reversed(range(len(steps))):
                    batch, cut = steps[t]
                    row = slice(env, env + 1)
                    value = self.baseline(batch.obs[row], batch.actions[row], robot)
                    if (t, env) in cuts:
                        actions = drawn[:, cuts.index((t, env))][None]
                        after = self.baseline(batch.next_obs[row], actions, robot)
                    else:
                        following = steps[t + 1][0]
                        after = self.baseline(following.obs[row], following.actions[row], robot)
                    alive = 0.0 if batch.terminated[env] else 1.0
                    delta = (
                        float(batch.reward[env, robot]) / scale[robot]
                        + numbers.gamma * alive * after
                        - value
                    )
                    if batch.terminated[env] or cut[env]:
                        later = 0.0
                    later = delta + numbers.gamma * numbers.gae_lambda * later
                    advantage[robot, t * envs + env] = later
                    target[robot, t * envs + env] = later + value
        spread = advantage.std(dim=1, correction=0, keepdim=True)
        advantage = (advantage - advantage.mean(dim=1, keepdim=True)) / (spread + 1e-8)
        return {"advantage": advantage, "target": target}

    def update(self, rows, obs: Tensor, actions: Tensor) -> dict[str, float]:
        """An update by rows, and its figures by name; obs (B, R, D), actions (B, R)."""
        numbers = self.numbers
        value, penalty = self.fitted(obs, actions)
        loss = numbers.attention_logit_penalty * penalty
        for robot, fitted in enumerate(value):
            errors = (fitted - rows.target[robot]) ** 2
            loss = loss + errors.mean()
        gradients = PlainTD._backward(self.critic, loss)
        for key, part in gradients:
            if key.startswith("attention."):
                gradients[key, part] = gradients[key, part] / len(value)
        norm = sum(float((g**2).sum()) for g in gradients.values()) ** 0.5
        figures = {"critic_loss": float(loss.detach()), "critic_grad_norm": norm}
        figures["q_mean"] = float(torch.stack(list(value)).detach().mean())
        factor = clip_factor(norm, numbers.critic_grad_clip)
        self.critic_adam.step(self.critic, {key: factor * g for key, g in gradients.items()})

        total = torch.zeros((), dtype=obs.dtype)
        low, high = 1 - numbers.clip, 1 + numbers.clip
        entropies, divergences, outside = [], [], []
        for robot, log_pi in enumerate(policy(self.actor, obs)):
            ratio = (pick(log_pi, actions[:, robot]) - rows.log_prob[robot]).exp()
            for r, a, entropy in zip(
                ratio, rows.advantage[robot], -(log_pi.exp() * log_pi).sum(1), strict=True
            ):
                entropies.append(entropy.item())
                divergences.append(r.item() - 1 - math.log(r.item()))
                outside.append(not low <= r.item() <= high)
                bounded = low if r.item() < low else high if r.item() > high else r
                worse = (
                    r * a
                    if (r * a).item()
                    <= (bounded if isinstance(bounded, float) else bounded.item()) * a.item()
                    else bounded * a
                )
                total = total - (worse + numbers.entropy_weight * entropy) / len(ratio)
        gradients = PlainTD._backward(self.actor, total)
        norms = []
        for robot in range(len(value)):
            own = [key for key in gradients if key[1] == robot]
            norm = sum(float((gradients[key] ** 2).sum()) for key in own) ** 0.5
            norms.append(norm)
            for key in own:
                gradients[key] = gradients[key] * clip_factor(norm, numbers.actor_grad_clip)
        self.actor_adam.step(self.actor, gradients)
        return figures | {
            "actor_loss": float(total.detach()),
            "policy_entropy": float(np.mean(entropies)),
            "actor_grad_norm": float(np.mean(norms)),
            "kl": float(np.mean(divergences)),
            "clip_share": float(np.mean(outside)),
        }
