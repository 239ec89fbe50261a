"""Small networks, and what a critic makes of one state worked out one robot and head at a time."""

import math
from itertools import product

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn.evaluate.bounds.perturbation import random_directions
from innerattn.evaluate.bounds.response import States
from innerattn.nn import Actor, Critic, InnerAttention

B, D, A, W, H, DRAWS = 2, 3, 4, 6, 2, 3
SCALE = (W // H) ** -0.5


def generator(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def make_critic(robots: int, kind: type = InnerAttention, outputs: int | None = None) -> Critic:
    source = generator(0)
    attention = kind(W, H, source)
    critic = Critic(robots, D, A, attention, source, outputs).double().requires_grad_(False)
    attention.query *= 3.0  # so that attention is far from even
    attention.key *= 3.0
    return critic


def make_actor(robots: int) -> Actor:
    return Actor(robots, D, A, W, generator(1)).double().requires_grad_(False)


def make_states(robots: int, masked: bool = False, batch: int = B) -> States:
    source = generator(2)
    obs = 2.0 * torch.randn(robots, batch, D, generator=source, dtype=torch.float64)
    actions = torch.randint(A, (robots, batch), generator=source)
    available = torch.ones(batch, robots, dtype=torch.bool)
    available[0, -1] = False
    return States(obs, actions, available if masked else None)


def some_changes(robots: int, width: int) -> Tensor:
    return 0.7 * random_directions((robots, DRAWS, B, width), generator(3))


class Plain:
    """One state, worked out with numpy, one robot and head at a time."""

    def __init__(
        self,
        critic: Critic,
        states: States,
        b: int,
        obs: dict[int, Tensor] | None = None,
        embedding: dict[int, Tensor] | None = None,
    ) -> None:
        parts = {name: value.numpy() for name, value in critic.named_parameters()}
        robots = len(states.obs)
        self.e_s, self.e = [], []
        for i in range(robots):
            o = states.obs[i, b].numpy() + (obs[i].numpy() if obs and i in obs else 0.0)
            chosen = np.eye(A)[states.actions[i, b]]
            self.e_s.append(self._encode(parts, "state_encoder", i, o))
            e = self._encode(parts, "action_encoder", i, np.concatenate([o, chosen]))
            self.e.append(e + (embedding[i].numpy() if embedding and i in embedding else 0.0))
        self.w_q = parts["attention.query"].reshape(H, W // H, W)
        self.w_k = parts["attention.key"].reshape(H, W // H, W)
        self.S = np.zeros((H, robots, robots))
        self.alpha = np.zeros((H, robots, robots))
        self.Q = []
        for i in range(robots):
            seen = [
                j
                for j in range(robots)
                if j != i and (states.available is None or states.available[b, j])
            ]
            mixed = np.zeros(W)
            for h in range(H):
                for j in range(robots):
                    self.S[h, i, j] = (
                        SCALE * (self.w_q[h] @ self.e_s[i]) @ (self.w_k[h] @ self.e[j])
                    )
                total = sum(math.exp(self.S[h, i, j]) for j in seen)
                for j in seen:
                    self.alpha[h, i, j] = math.exp(self.S[h, i, j]) / total
                    v = parts["attention.value"] @ self.e[j] + parts["attention.value_bias"]
                    block = slice(h * W // H, (h + 1) * W // H)
                    mixed[block] += self.alpha[h, i, j] * leaky(v)[block]
            hidden = self._encode(parts, "hidden", i, np.concatenate([self.e_s[i], mixed]))
            self.Q.append(parts["output.weight"][i] @ hidden + parts["output.bias"][i])

    @staticmethod
    def _encode(parts: dict, layer: str, i: int, x: NDArray) -> NDArray:
        return leaky(parts[f"{layer}.weight"][i] @ x + parts[f"{layer}.bias"][i])


def leaky(x: NDArray) -> NDArray:
    return np.where(x > 0, x, 0.01 * x)


def norm(x: NDArray) -> float:
    return float(np.linalg.norm(x, 2))


def plain_found(
    critic: Critic, states: States, changed: str, change: Tensor
) -> tuple[dict[str, list], dict[str, list]]:
    """What `disturb` must find for random changes, entry by entry."""
    robots, variants, batch, _ = change.shape
    sides: dict[str, list] = {}
    moved: dict[str, list] = {}
    for j, m, b in product(range(robots), range(variants), range(batch)):
        old = Plain(critic, states, b)
        new = Plain(critic, states, b, **{changed: {j: change[j, m, b]}})
        teammates = [i for i in range(robots) if i != j]

        def keep(into: dict[str, list], **values: object) -> None:
            for name, value in values.items():
                into.setdefault(name, []).append(value)

        for i in teammates:
            keep(moved, values=abs(new.Q[i] - old.Q[i]).max())
            keep(moved, flips=new.Q[i].argmax() != old.Q[i].argmax())
        if changed == "obs":
            keep(moved, own_values=abs(new.Q[j] - old.Q[j]).max())
            keep(moved, own_flips=new.Q[j].argmax() != old.Q[j].argmax())
        for h in range(H):
            norms = norm(old.w_q[h]) * norm(old.w_k[h]) * SCALE
            d_logit, d_weight = new.S[h] - old.S[h], new.alpha[h] - old.alpha[h]
            reach, own_reach = norm(new.e[j] - old.e[j]), norm(new.e_s[j] - old.e_s[j])
            for i in teammates:
                by_norms = norms * reach * norm(old.e_s[i])
                g = SCALE * old.w_k[h].T @ old.w_q[h] @ old.e_s[i]
                keep(moved, weights=d_weight[i, j])
                keep(
                    sides,
                    logit=(abs(d_logit[i, j]), by_norms),
                    logit_sharp=(abs(d_logit[i, j]), norm(g) * reach),
                    weight=(abs(d_weight[i, j]), math.tanh(abs(d_logit[i, j]) / 4)),
                    weight_by_norms=(abs(d_weight[i, j]), math.tanh(by_norms / 4)),
                )
            if changed == "embedding":
                continue
            for k in teammates:
                g = SCALE * old.w_q[h].T @ old.w_k[h] @ old.e[k]
                keep(
                    sides,
                    own_logit=(abs(d_logit[j, k]), norms * own_reach * norm(old.e[k])),
                    own_logit_sharp=(abs(d_logit[j, k]), norm(g) * own_reach),
                )
            row = [d_logit[j, k] for k in teammates]
            total = sum(abs(d_weight[j, k]) for k in teammates) / 2
            keep(
                sides,
                own_row=(total, math.tanh(max(abs(x) for x in row) / 2)),
                own_row_sharp=(total, math.tanh((max(row) - min(row)) / 4)),
            )
    return sides, moved
