"""Learns one policy for any team: imitates a script, improves by PPO, or both.

A rollout is T control steps of a batch of worlds of several teams; each step is a minibatch.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torch import Tensor
from torch.nn import functional

from innerattn.learn import workers
from innerattn.learn.advantage import generalised_advantage
from innerattn.learn.resume import State, inside, take, take_generator, take_whole, under, whole
from innerattn.nn.teams import Relations, TeamActor, TeamCritic
from innerattn.nn.teams.features import Bodies, Features

_ADVANTAGE_FLOOR = 0.02
_RETURN_FLOOR = 1e-2
_SLOWEST_AVERAGE = 0.05
_MOST_GRADIENT = 0.5


@dataclass
class TeamRollout:
    """T control steps of B worlds, N_t robots at step t.

    Attributes:
        seen: the worlds before each step.
        actions: (N_t,) int64 what was done.
        log_probs: (N_t,) of what was done.
        wanted: (N_t,) int64 what the script would have done; empty where nobody asked it.
        rewards: (B,) the team's.
        terminated: (B,) bool.
        ended: (B,) bool, terminated or truncated.
        following: (B,) where a time limit ended an episode, the value of its last state; else 0.
    """

    seen: list[Relations] = field(default_factory=list)
    actions: list[Tensor] = field(default_factory=list)
    log_probs: list[Tensor] = field(default_factory=list)
    wanted: list[Tensor] = field(default_factory=list)
    rewards: list[Tensor] = field(default_factory=list)
    terminated: list[Tensor] = field(default_factory=list)
    ended: list[Tensor] = field(default_factory=list)
    following: list[Tensor] = field(default_factory=list)


@dataclass(frozen=True)
class Weights:
    """What an update weighs.

    Attributes:
        learning_rate: step size of Adam.
        imitation: of the cross-entropy to what the script would have done; 1 and `policy` 0: pure
            imitation.
        policy: of PPO's loss.
        entropy: of the policy's entropy, within PPO's loss.
    """

    learning_rate: float
    imitation: float
    policy: float
    entropy: float


class TeamLearner:
    """An actor, a critic, and one Adam for both."""

    def __init__(
        self,
        *,
        width: int,
        pooling: str,
        key_width: int,
        features: Features = "all",
        bodies: Bodies = "told",
        gamma: float,
        gae_lambda: float,
        clip: float,
        seed: int,
    ) -> None:
        """Draw initial weights; what is drawn follows from ``seed`` alone."""
        with torch.random.fork_rng([]):
            torch.manual_seed(seed)
            self.actor = TeamActor(width, pooling, key_width, features=features, bodies=bodies)
            self.critic = TeamCritic(features=features)
        self._gamma, self._lambda, self._clip = gamma, gae_lambda, clip
        self._generator = torch.Generator().manual_seed(seed)
        self._parameters = [*self.actor.parameters(), *self.critic.parameters()]
        self._adam = torch.optim.Adam(self._parameters, eps=1e-6, fused=True)
        self._mean, self._std = torch.zeros(()), torch.ones(())
        self.updates = self.rollouts = 0

    def seed_draws(self, seed: int) -> None:
        """Let the actions that are drawn from now on follow from ``seed`` alone."""
        self._generator.manual_seed(seed)

    def state(self) -> dict[str, Tensor]:
        """Copies of everything learnt, by name."""
        scale = {"returns.mean": self._mean.clone(), "returns.std": self._std.clone()}
        return {name: one.detach().clone() for name, one in self._named()} | scale

    def load(self, state: State) -> None:
        """Restore what `state` returned.

        Raises:
            ValueError: a name, shape or dtype is wrong; the learner is left unchanged.
        """
        known = [*(name for name, _ in self._named()), "returns.mean", "returns.std"]
        if unknown := sorted(state.keys() - set(known)):
            raise ValueError(f"has {unknown[0]!r}, which these networks have not")
        found = {name: take(state, name, torch.float32, *one.shape) for name, one in self._named()}
        mean, std = (take(state, f"returns.{one}", torch.float32) for one in ("mean", "std"))
        if float(std) <= 0.0:
            raise ValueError(f"'returns.std' = {float(std)}: must be positive")
        with torch.no_grad():
            for name, one in self._named():
                one.copy_(found[name])
        self._mean, self._std = mean.clone(), std.clone()

    def resume_state(self) -> dict[str, Tensor]:
        """All that `state` does not have; see `Resumable`."""
        counts = {"updates": whole(self.updates), "rollouts": whole(self.rollouts)}
        state = counts | {"generator": self._generator.get_state()}
        for name, one in self._named():
            moments = self._adam.state[one]
            state |= under(f"adam.{name}", {key: moments[key] for key in moments})
        return state

    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        self.updates, self.rollouts = take_whole(state, "updates"), take_whole(state, "rollouts")
        take_generator(state, "generator", self._generator)
        moments = inside("adam", state)
        for name, one in self._named():
            if not self.updates:
                continue
            squares = take(moments, f"{name}.exp_avg_sq", torch.float32, *one.shape)
            if bool((squares < 0.0).any()):
                raise ValueError(f"'adam.{name}.exp_avg_sq': must not be negative")
            self._adam.state[one] = {
                "step": take(moments, f"{name}.step", torch.float32).clone(),
                "exp_avg": take(moments, f"{name}.exp_avg", torch.float32, *one.shape).clone(),
                "exp_avg_sq": squares.clone(),
            }

    def _named(self) -> list[tuple[str, torch.nn.Parameter]]:
        """All parameters by name."""
        networks = {"actor": self.actor, "critic": self.critic}
        return [
            (f"{network}.{name}", one)
            for network, module in networks.items()
            for name, one in module.named_parameters()
        ]

    @torch.no_grad()
    def act(self, seen: Relations, *, greedy: bool | Tensor = False) -> tuple[Tensor, Tensor]:
        """Choose actions (N,) int64; and their log-probabilities (N,).

        Args:
            seen: what there is to be seen.
            greedy: whether to take the likeliest actions instead of drawn ones; or (B,) bool, in
                which worlds.
        """
        log_probs = self.actor(seen)
        likely = chosen = log_probs.exp()
        if greedy is not True:
            chosen = likely / torch.empty_like(likely).exponential_(generator=self._generator)
        if isinstance(greedy, Tensor):
            world = seen.robot_cells // seen.rivals.shape[1]
            chosen = torch.where(greedy[world, None], likely, chosen)
        actions = chosen.argmax(1)
        return actions, log_probs.gather(1, actions[:, None]).squeeze(1)

    @torch.no_grad()
    def values(self, seen: Relations) -> Tensor:
        """Values (B,) in units of the rewards."""
        found: Tensor = self.critic(seen) * self._std + self._mean
        return found

    def learn(
        self, rollout: TeamRollout, after: Relations, groups: int, weights: Weights
    ) -> dict[str, float]:
        """One pass over a rollout.

        Args:
            rollout: the steps.
            after: the worlds after the last one.
            groups: number of teams; B is a multiple of it, team by team. Advantages are
                standardised within each.
            weights: of the losses.

        Returns:
            Means by name: `agreement` with the script, `entropy` [nats], `kl` [nats],
            `critic_loss`.
        """
        advantage, target = self._targets(rollout, after, groups)
        for options in self._adam.param_groups:
            options["lr"] = weights.learning_rate
        totals: dict[str, float] = {}
        drawn = torch.randperm(len(rollout.seen), generator=self._generator)
        order = workers.of_first(drawn).tolist()
        for step in order:
            loss, found = self._loss(rollout, step, advantage[step], target[step], weights)
            self._adam.zero_grad()
            torch.autograd.backward(loss)
            found = self._averaged(found, robots=len(rollout.actions[step]))
            torch.nn.utils.clip_grad_norm_(self._parameters, _MOST_GRADIENT)
            self._adam.step()
            self.updates += 1
            for name, value in found.items():
                totals[name] = totals.get(name, 0.0) + float(value) / len(order)
        self.rollouts += 1
        return totals

    def _averaged(self, found: dict[str, Tensor], robots: int) -> dict[str, Tensor]:
        """Let gradients, and numbers that were found, be those of the worlds of all workers.

        Means over robots count by how many robots a worker has. The critic's are means over
        worlds, of which all workers have as many.
        """
        if workers.count() == 1:
            return found
        weight = torch.tensor(float(robots))
        own = {}
        for name, one in self._named():
            assert one.grad is not None  # a loss is of all of them
            own[name] = one.grad * weight if name.startswith("actor.") else one.grad
        numbers = [one if name == "critic_loss" else one * weight for name, one in found.items()]
        (means,), (mean_weight, *numbers) = workers.averaged([own], [weight, *numbers])
        for name, one in self._named():
            one.grad = means[name] / mean_weight if name.startswith("actor.") else means[name]
        return {
            name: one if name == "critic_loss" else one / mean_weight
            for name, one in zip(found, numbers, strict=True)
        }

    def _targets(
        self, rollout: TeamRollout, after: Relations, groups: int
    ) -> tuple[Tensor, Tensor]:
        """Standardised advantages (T, B) and the critic's targets (T, B)."""
        values = torch.stack([self.values(seen) for seen in (*rollout.seen, after)])
        reward, ended = torch.stack(rollout.rewards), torch.stack(rollout.ended)
        terminated = torch.stack(rollout.terminated)
        following = torch.where(ended, torch.stack(rollout.following), values[1:])
        advantage = generalised_advantage(
            reward.unsqueeze(1),
            values[:-1].unsqueeze(1),
            following.unsqueeze(1),
            terminated,
            ended,
            self._gamma,
            self._lambda,
        ).squeeze(1)
        returns = advantage + values[:-1]
        self._rescale(returns)
        by_team = advantage.view(len(advantage), groups, -1)
        mean = by_team.mean((0, 2), keepdim=True)
        std = by_team.std((0, 2), keepdim=True)
        standard = ((by_team - mean) / (std + _ADVANTAGE_FLOOR)).view_as(advantage)
        return standard, (returns - self._mean) / self._std

    @torch.no_grad()
    def _rescale(self, returns: Tensor) -> None:
        """Follow mean and deviation of returns; what the critic says stays the same (PopArt)."""
        returns = workers.gathered(returns)
        share = max(_SLOWEST_AVERAGE, 1.0 / (self.rollouts + 1))
        mean = self._mean + (returns.mean() - self._mean) * share
        std = self._std + (returns.std().clamp(min=_RETURN_FLOOR) - self._std) * share
        out = self.critic.out
        out.bias.copy_((out.bias * self._std + self._mean - mean) / std)
        out.weight.mul_(self._std / std)
        self._mean, self._std = mean, std

    def _loss(
        self,
        rollout: TeamRollout,
        step: int,
        advantage: Tensor,
        target: Tensor,
        weights: Weights,
    ) -> tuple[Tensor, dict[str, Tensor]]:
        seen = rollout.seen[step]
        log_probs = self.actor(seen)
        entropy = -(log_probs.exp() * log_probs).sum(1).mean()
        critic_loss = functional.mse_loss(self.critic(seen), target)
        loss = 0.5 * critic_loss
        found = {"entropy": entropy, "critic_loss": critic_loss}
        if weights.imitation:
            wanted = rollout.wanted[step]
            loss = loss + weights.imitation * functional.nll_loss(log_probs, wanted)
            found["agreement"] = (log_probs.argmax(1) == wanted).float().mean()
        if weights.policy:
            taken = log_probs.gather(1, rollout.actions[step][:, None]).squeeze(1)
            change = taken - rollout.log_probs[step]
            ratio = change.exp()
            size = seen.times.shape[1]
            of_robot = advantage.index_select(0, seen.robot_cells // size)
            clipped = ratio.clamp(1.0 - self._clip, 1.0 + self._clip)
            gain = torch.minimum(ratio * of_robot, clipped * of_robot).mean()
            loss = loss - weights.policy * (gain + weights.entropy * entropy)
            found["kl"] = (ratio - 1.0 - change).mean()
        return loss, {name: value.detach() for name, value in found.items()}
