"""A plain form of the off-policy learner: loops over robots and heads, straight from the equations.

It shares no code with the package, takes its drawn actions from outside, and is also what the bench
compares with.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

Affine = tuple[Tensor, Tensor]


def leaky(x: Tensor) -> Tensor:
    return torch.where(x > 0, x, 0.01 * x)


def affine(x: Tensor, layer: Affine) -> Tensor:
    weight, bias = layer
    return x @ weight.T + bias


def log_softmax(x: Tensor) -> Tensor:
    return x - x.exp().sum(dim=-1, keepdim=True).log()


def pick(x: Tensor, actions: Tensor) -> Tensor:
    return x[torch.arange(len(x)), actions]


def clip_factor(norm: float, limit: float) -> float:
    return min(1.0, limit / (norm + 1e-6))  # the small number is the MAAC code's


@dataclass
class PlainNetwork:
    """Leaves of one network of a learner's state, cut up by robot, or by head where shared."""

    layers: dict[str, list[Tensor]]

    @classmethod
    def cut(cls, state: dict[str, Tensor], network: str, heads: int) -> "PlainNetwork":
        layers = {}
        for name, tensor in state.items():
            if name.startswith(f"{network}."):
                key = name.removeprefix(f"{network}.")
                parts = tensor.chunk(heads) if key.startswith("attention.") else tensor.unbind()
                layers[key] = [part.clone().requires_grad_() for part in parts]
        return cls(layers)

    def joined(self, network: str) -> dict[str, Tensor]:
        """The tensors under the names and in the shapes of the learner's state."""
        return {
            f"{network}.{key}": (torch.cat if key.startswith("attention.") else torch.stack)(
                [part.detach() for part in parts]
            )
            for key, parts in self.layers.items()
        }

    def robot(self, layer: str, i: int) -> Affine:
        return self.layers[f"{layer}.weight"][i], self.layers[f"{layer}.bias"][i]

    def leaves(self) -> Iterator[tuple[str, int, Tensor]]:
        for key, parts in self.layers.items():
            for i, part in enumerate(parts):
                yield key, i, part


def policy(network: PlainNetwork, obs: Tensor) -> list[Tensor]:
    """Log-probabilities (B, A) of each robot for observations (B, R, D)."""
    result = []
    for i in range(obs.shape[1]):
        hidden = leaky(affine(obs[:, i], network.robot("first", i)))
        hidden = leaky(affine(hidden, network.robot("second", i)))
        result.append(log_softmax(affine(hidden, network.robot("output", i))))
    return result


@dataclass
class PlainValues:
    q: list[Tensor]  # by robot: (B, A)
    weights: Tensor  # (B, H, R, R)
    penalty: Tensor  # mean squared scores over batch and teammates, summed over heads and robots


def values(
    network: PlainNetwork,
    obs: Tensor,
    actions: Tensor,
    kind: str,
    available: Tensor | None = None,
    num_actions: int | None = None,
) -> PlainValues:
    """Q of every own action for obs (B, R, D), actions (B, R), available (B, R) bool."""
    if kind == "none":
        return joint_values(network, obs)
    batch, robots, _ = obs.shape
    num_actions = num_actions or len(network.robot("output", 0)[1])
    query, key = network.layers["attention.query"], network.layers["attention.key"]
    value = network.layers["attention.value"]
    value_bias = network.layers["attention.value_bias"]
    heads, head_width = len(query), len(query[0])
    if available is None:
        available = torch.ones(batch, robots, dtype=torch.bool)
    one_hot = torch.eye(num_actions, dtype=obs.dtype)[actions]
    own = [leaky(affine(obs[:, i], network.robot("state_encoder", i))) for i in range(robots)]
    both = [
        leaky(affine(torch.cat([obs[:, i], one_hot[:, i]], 1), network.robot("action_encoder", i)))
        for i in range(robots)
    ]
    keys = [[both[j] @ key[h].T for j in range(robots)] for h in range(heads)]
    offered = [
        [leaky(affine(both[j], (value[h], value_bias[h]))) for j in range(robots)]
        for h in range(heads)
    ]
    weights = torch.zeros(batch, heads, robots, robots, dtype=obs.dtype)
    penalty = torch.zeros((), dtype=obs.dtype)
    q = []
    for i in range(robots):
        mixed = []
        for h in range(heads):
            teammates = [j for j in range(robots) if j != i]
            exponentials = {j: available[:, j].to(obs.dtype) for j in teammates}
            if kind == "inner":
                asked = own[i] @ query[h].T
                for j in teammates:
                    score = (asked * keys[h][j]).sum(1)
                    exponentials[j] = (score / head_width**0.5).exp() * available[:, j]
                    penalty = penalty + (score**2 * available[:, j]).mean() / len(teammates)
            total = sum(exponentials.values(), torch.zeros(batch, dtype=obs.dtype))
            total = torch.where(total > 0, total, 1.0)
            x = torch.zeros(batch, head_width, dtype=obs.dtype)
            for j in teammates:
                alpha = exponentials[j] / total
                weights[:, h, i, j] = alpha.detach()
                x = x + alpha[:, None] * offered[h][j]
            mixed.append(x)
        hidden = leaky(affine(torch.cat([own[i], *mixed], 1), network.robot("hidden", i)))
        q.append(affine(hidden, network.robot("output", i)))
    return PlainValues(q, weights, penalty)


def joint_values(network: PlainNetwork, obs: Tensor) -> PlainValues:
    """Values of the critic without attention: of all observations side by side, of no action."""
    batch, robots, _ = obs.shape
    joint = torch.cat([obs[:, j] for j in range(robots)], 1)
    q = []
    for i in range(robots):
        hidden = leaky(affine(joint, network.robot("first", i)))
        hidden = leaky(affine(hidden, network.robot("second", i)))
        q.append(affine(hidden, network.robot("output", i)))
    return PlainValues(q, obs.new_zeros(batch, 0, robots, robots), obs.new_zeros(()))


class Adam:
    """Adam with L2 weight decay (Kingma & Ba 2015), one leaf at a time."""

    def __init__(self, learning_rate: float, weight_decay: float) -> None:
        self.learning_rate, self.weight_decay = learning_rate, weight_decay
        self.moments: dict[tuple[str, int], tuple[Tensor, Tensor, int]] = {}

    def step(self, network: PlainNetwork, gradients: dict[tuple[str, int], Tensor]) -> None:
        for key, i, leaf in network.leaves():
            if (key, i) not in gradients:
                continue
            gradient = gradients[key, i] + self.weight_decay * leaf.detach()
            zeros = torch.zeros_like(gradient)
            mean, square, count = self.moments.get((key, i), (zeros, zeros, 0))
            mean, square = 0.9 * mean + 0.1 * gradient, 0.999 * square + 0.001 * gradient**2
            count += 1
            self.moments[key, i] = mean, square, count
            corrected, spread = mean / (1 - 0.9**count), (square / (1 - 0.999**count)).sqrt()
            with torch.no_grad():
                leaf -= self.learning_rate * corrected / (spread + 1e-8)


Draw = Callable[[list[Tensor]], Tensor]  # log-probabilities (B, A) by robot -> actions (B, R)


class PlainTD:
    """One update after the other, on leaves cut from a learner's state."""

    def __init__(self, state, network, td, availability_column=None) -> None:
        heads = network.attention_heads
        self.networks = {
            name: PlainNetwork.cut(state, name, heads)
            for name in ("actor", "critic", "target_actor", "target_critic")
        }
        self.kind, self.td, self.column = network.attention, td, availability_column
        self.actor_adam = Adam(td.learning_rate, 0.0)
        self.critic_adam = Adam(td.learning_rate, td.critic_weight_decay)
        self.figures: dict[str, float] = {}
        self.gradients: dict[str, Tensor] = {}

    def joined(self) -> dict[str, Tensor]:
        tensors: dict[str, Tensor] = {}
        for name, network in self.networks.items():
            tensors |= network.joined(name)
        return tensors

    def available(self, obs: Tensor) -> Tensor | None:
        return None if self.column is None else obs[:, :, self.column] > 0.5

    def targets(self, batch, reward_mean: Tensor, reward_std: Tensor, draw: Draw) -> Tensor:
        """(B, R)."""
        td, tau = self.td, 1 / self.td.reward_scale
        log_prob = policy(self.networks["target_actor"], batch.next_obs)
        actions = draw(log_prob)
        q = values(
            self.networks["target_critic"],
            batch.next_obs,
            actions,
            self.kind,
            self.available(batch.next_obs),
        ).q
        columns = []
        for i in range(len(q)):
            reward = (batch.reward[:, i] - reward_mean[i]) / max(
                float(reward_std[i]), td.reward_std_floor
            )
            next_q, next_log_prob = pick(q[i], actions[:, i]), pick(log_prob[i], actions[:, i])
            alive = 1.0 - batch.terminated.to(next_q.dtype)
            if td.entropy_target == "consistent":
                y = reward + td.gamma * alive * (next_q - tau * next_log_prob)
            else:
                y = reward + td.gamma * alive * next_q - tau * next_log_prob
            columns.append(y.detach())
        return torch.stack(columns, 1)

    def update(self, batch, reward_mean: Tensor, reward_std: Tensor, draw: Draw) -> None:
        self._critic(batch, self.targets(batch, reward_mean, reward_std, draw))
        self._actor(batch.obs, draw)
        for name in ("actor", "critic"):
            pairs = zip(
                self.networks[f"target_{name}"].leaves(), self.networks[name].leaves(), strict=True
            )
            for (_, _, slow), (_, _, fast) in pairs:
                with torch.no_grad():
                    slow.copy_((1 - self.td.polyak) * slow + self.td.polyak * fast)

    def _critic(self, batch, target: Tensor) -> None:
        critic = self.networks["critic"]
        out = values(critic, batch.obs, batch.actions, self.kind, self.available(batch.obs))
        loss = self.td.attention_logit_penalty * out.penalty
        taken = [pick(q, batch.actions[:, i]) for i, q in enumerate(out.q)]
        for i, q_taken in enumerate(taken):
            loss = loss + ((q_taken - target[:, i]) ** 2).mean()
        gradients = self._backward(critic, loss)
        for key, i in gradients:
            if key.startswith("attention."):
                gradients[key, i] = gradients[key, i] / len(out.q)
        norm = sum(float((g**2).sum()) for g in gradients.values()) ** 0.5
        factor = clip_factor(norm, self.td.critic_grad_clip)
        gradients = {key: factor * g for key, g in gradients.items()}
        self._record("critic", critic, gradients)
        self.critic_adam.step(critic, gradients)
        mean = float(torch.stack(taken).detach().mean())
        self.figures = {"critic_loss": float(loss.detach()), "q_mean": mean}
        self.figures["critic_grad_norm"] = norm

    def _actor(self, obs: Tensor, draw: Draw) -> None:
        actor, tau = self.networks["actor"], 1 / self.td.reward_scale
        log_prob = policy(actor, obs)
        actions = draw(log_prob)
        q = values(self.networks["critic"], obs, actions, self.kind, self.available(obs)).q
        loss = torch.zeros((), dtype=obs.dtype)
        for i, log_pi in enumerate(log_prob):
            own_q = q[i].detach()
            if self.td.policy_gradient == "expected":
                terms = (log_pi.exp() * (tau * log_pi - own_q)).sum(1)
            else:
                baseline = (log_pi.exp() * own_q).sum(1)
                drawn = pick(log_pi, actions[:, i])
                terms = drawn * (tau * drawn - pick(own_q, actions[:, i]) + baseline).detach()
            loss = loss + terms.mean()
        gradients = self._backward(actor, loss)
        norms = []
        for i in range(len(log_prob)):
            own = [key for key in gradients if key[1] == i]
            norm = sum(float((gradients[key] ** 2).sum()) for key in own) ** 0.5
            norms.append(norm)
            for key in own:
                gradients[key] = gradients[key] * clip_factor(norm, self.td.actor_grad_clip)
        self._record("actor", actor, gradients)
        self.actor_adam.step(actor, gradients)
        entropies = [-(log_pi.exp() * log_pi).sum(1).mean() for log_pi in log_prob]
        self.figures["actor_loss"] = float(loss.detach())
        self.figures["policy_entropy"] = float(torch.stack(entropies).detach().mean())
        self.figures["actor_grad_norm"] = sum(norms) / len(norms)

    @staticmethod
    def _backward(network: PlainNetwork, loss: Tensor) -> dict[tuple[str, int], Tensor]:
        leaves = list(network.leaves())
        found = torch.autograd.grad(loss, [leaf for *_, leaf in leaves], allow_unused=True)
        return {
            (key, i): gradient
            for (key, i, _), gradient in zip(leaves, found, strict=True)
            if gradient is not None
        }

    def _record(self, name: str, network: PlainNetwork, gradients) -> None:
        full = {
            key: [gradients.get((key, i), torch.zeros_like(p)) for i, p in enumerate(parts)]
            for key, parts in network.layers.items()
        }
        self.gradients |= PlainNetwork(full).joined(name)
