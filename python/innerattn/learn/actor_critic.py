"""The base of the learners: actors, a critic and their optimisers.

It acts, imitates, reports attention, saves and loads. Each learner decides when and how to update.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, NoReturn

import numpy as np
import torch
from torch import Tensor, nn

from innerattn.config import NetworkConfig
from innerattn.learn import losses, workers
from innerattn.learn.adam import AdamStepper, Forward, Gradients, Stepper
from innerattn.learn.compiled import CompilerError, failed_to_compile, first_line, traced
from innerattn.learn.divergence import DivergenceError, not_finite, refuse_not_finite_gradients
from innerattn.learn.gradients import average_over_robots
from innerattn.learn.interruptions import Interruptions, NoInterruptions
from innerattn.learn.memories import Memories, parts_of
from innerattn.learn.messages import MessageRows
from innerattn.learn.networks import DrawNetworks, draw_networks
from innerattn.learn.resume import State, take, take_generator, take_whole, whole
from innerattn.learn.types import Team
from innerattn.learn.undo import Undo
from innerattn.nn import (
    Actor,
    CriticOutput,
    ListeningActor,
    RememberingCritic,
    action_noise,
    batch_last_in_memory,
    robots_of_each_kind,
)

MOMENTS = ("actor_adam", "critic_adam")
"""First parts of the names of the optimisers' moments in a state; acting does not need them."""


@dataclass(frozen=True)
class Networks:
    """The networks of an update, in their plain or in their compiled form."""

    actor: Stepper
    critic: Stepper


class ActorCritic:
    """Networks and optimisers of a learner.

    A subclass adds `observe` and `learn` of the `Learner` protocol, and `_update_networks`.

    Attributes:
        actor: The trained policies.
        critic: The trained critics.
        actor_frozen: While set, updates leave the policies as they are; see `Learner`.
        interruptions: Asked between updates whether training is to stop.
        skips_divergence: Leave out updates with numbers that are not finite, and count them,
            instead of raising a `DivergenceError`.
    """

    _update_networks: Callable[..., Tensor]
    """All arithmetic of one update: `Networks`, batches and the learning rate () to metrics (n,).

    It calls networks only through `Networks`, so that `compile` can put other forms in their place.
    """
    _metric_names: ClassVar[Sequence[str]] = ()
    """Names of the metrics of an update, for messages."""

    def __init__(
        self,
        team: Team,
        network: NetworkConfig,
        *,
        learning_rate: float,
        final_learning_rate_share: float,
        critic_weight_decay: float,
        seed: int,
        device: torch.device,
        dtype: torch.dtype = torch.float32,
        draw: DrawNetworks = draw_networks,
    ) -> None:
        """Build networks and optimisers.

        Args:
            team: What is known of the team.
            network: Sizes and kind of the networks.
            learning_rate: Learning rate of both optimisers at the start.
            final_learning_rate_share: Share of the learning rate that is left at the end.
            critic_weight_decay: Weight of the L2 penalty of the critic's optimiser.
            seed: Seed of the initial weights and of every draw.
            device: Where the networks live.
            dtype: Floating-point type of the networks.
            draw: Makes the actor and the critic, with initial parameters.

        Raises:
            ValueError: `network.mask_unavailable` is set without a column of the observation, or as
                ``draw`` does.
        """
        column = team.availability_column
        if network.mask_unavailable and column not in range(team.obs_width):
            raise ValueError(
                f"availability_column = {column}: network.mask_unavailable needs a "
                f"column in 0..{team.obs_width - 1}"
            )
        self._availability_column = column if network.mask_unavailable else None
        self._device, self._dtype = device, dtype
        self._by_entity = network.encoder == "entities"
        self._bfloat16 = network.precision == "bfloat16"
        self._first_rate, self._final_share = learning_rate, final_learning_rate_share
        self._rate = learning_rate
        weights, noise, data = np.random.SeedSequence(seed).spawn(3)
        seeds = weights, workers.own_seed(noise), workers.own_seed(data)
        weights_seed, noise_seed, self._data_seed = (
            int(one.generate_state(1, np.uint64)[0]) for one in seeds
        )
        self._noise = torch.Generator(device).manual_seed(noise_seed)
        # Drawn on the CPU in float32 and then moved: a seed gives the same weights everywhere.
        actor, critic = draw(team, network, torch.Generator().manual_seed(weights_seed))
        self.actor, self.critic = actor.to(device, dtype), critic.to(device, dtype)
        self.actor_frozen = False
        self._actor_adam = AdamStepper(self.actor)
        self._critic_adam = AdamStepper(self.critic, critic_weight_decay)
        self._networks = Networks(self._actor_adam, self._critic_adam)
        self._robots_of_each_kind = None
        if network.shared_gradients == "mean" and team.kinds is not None:
            self._robots_of_each_kind = robots_of_each_kind(team.kinds).to(device, dtype)
        self._acted: tuple[Tensor, Tensor] | None = None
        self._memories: Memories | None = None
        if isinstance(self.critic, RememberingCritic):
            assert not isinstance(self.actor, Actor)  # as they are drawn
            self._memories = Memories(self.actor, self.critic, team.obs_width, self._number(0.0))
        self._messages: MessageRows | None = None
        if isinstance(self.actor, ListeningActor):
            assert team.hearing is not None  # as it was drawn
            sizes = team.num_robots, team.obs_width
            self._messages = MessageRows(*sizes, team.hearing, self._number(0.0))
        self._team, self._actions = team, team.actions
        self._updates = 0
        self.interruptions: Interruptions = NoInterruptions()
        self.skips_divergence = False
        self._skipped = 0
        self._plain_networks: Networks | None = None
        self._compiled_for: set[int] | None = None
        self._rows: list[Tensor] = []
        self._undo: Undo | None = None
        self._not_finite: str | None = None

    @property
    def updates(self) -> int:
        """Number of updates done so far."""
        return self._updates

    def compile(self, backend: str | Callable[..., Any] = "inductor") -> None:
        """Do updates as one compiled graph from now on; see `Learner.compile`."""
        plain = self._networks
        forms: Any = {field.name: traced(getattr(plain, field.name)) for field in fields(plain)}
        self._networks, self._plain_networks = type(plain)(**forms), plain
        self._update_networks = torch.compile(
            self._update_networks, fullgraph=True, dynamic=False, backend=backend
        )
        self._compiled_for = set()

    def seed_draws(self, seed: int) -> None:
        """Let the next actions be drawn from ``seed``; see `Learner.seed_draws`."""
        self._noise.manual_seed(seed)

    @torch.no_grad()
    def act(self, obs: Tensor, greedy: bool = False, elements: Tensor | None = None) -> Tensor:
        """Choose actions (E, R, ...) for observations (E, R, D); see `RememberingLearner.act`."""
        outputs = self._outputs(obs, elements)
        self._acted = (obs, outputs)
        if greedy:
            actions = self._actions.likeliest(outputs)
        else:
            actions = self._actions.draw(outputs, self._noise)
        return actions.transpose(0, 1).contiguous().to(obs.device)

    def _outputs(self, obs: Tensor, elements: Tensor | None) -> Tensor:
        """Outputs of the policies for one more step of the worlds, which robots remember from now.

        Arguments as in `act`.
        """
        rows, turned_by = self._robots_first(obs), self._turned_by(elements)
        if self._messages is not None:
            rows = self._messages.of_step(rows, turned_by)
        if self._memories is not None:
            return self._memories.act(rows, turned_by)
        outputs: Tensor = self.actor(rows)
        return outputs

    @torch.no_grad()
    def imitate(self, obs: Tensor, actions: Tensor, learning_rate: float) -> float:
        """Train the policies to take given discrete actions; see `Learner.imitate`."""
        seen, wanted = self._robots_first(obs), actions.to(self._device).t()

        def loss_of(actor: Forward) -> tuple[Tensor, Tensor]:
            log_prob = actor(seen).log_softmax(dim=1)
            loss = -losses.gather_actions(log_prob, wanted).mean(dim=1)
            return loss.sum(), loss.detach().mean()

        found, loss = self._actor_adam.gradients(loss_of)
        (gradients,), (loss,) = workers.averaged([found], [loss])
        average_over_robots(gradients, self._team.num_robots, self._robots_of_each_kind)
        self._actor_adam.step(gradients, _as_tensor(learning_rate))
        return float(loss)

    def set_progress(self, share: float) -> None:
        """Let the learning rate fall linearly; see `Learner.set_progress`."""
        self._rate = (1.0 - (1.0 - self._final_share) * share) * self._first_rate

    def forget(self) -> None:
        """Begin new episodes in all worlds; see `RememberingLearner`."""
        if self._memories is not None:
            self._memories.forget()
        if self._messages is not None:
            self._messages.forget()

    def remembered(self) -> Tensor | None:
        """What robots remembered before they acted last; see `RememberingLearner`."""
        return None if self._memories is None else self._memories.before.transpose(0, 1)

    def attention(
        self,
        obs: Tensor,
        actions: Tensor,
        remembered: Tensor | None = None,
        elements: Tensor | None = None,
    ) -> Tensor | None:
        """Attention weights (B, H, R, R) of the critic; see `RememberingLearner.attention`."""
        obs = self._robots_first(obs)
        recall: tuple[Tensor | None, ...] = ()
        if self._memories is not None:
            given = None if remembered is None else self._robots_first(remembered)
            _, of_critic = parts_of(self._memories.before if given is None else given)
            recall = of_critic, None, self._turned_by(elements)
        with torch.no_grad():
            output: CriticOutput = self.critic(
                obs, actions.to(self._device).transpose(0, 1), self._available(obs), *recall
            )
        return None if output.attended is None else output.attended.weights

    @torch.no_grad()
    def actor_attention(self, obs: Tensor) -> Tensor | None:
        """Attention weights (B, H, R, R) of the actor; see `ActorAttention`."""
        if not isinstance(self.actor, Actor):
            return None
        weights = self.actor.teammate_weights(self._robots_first(obs))
        if weights is None or weights.shape[2] != len(weights) - 1:
            return None
        robots, heads, _, batch = weights.shape
        found = weights.new_zeros(robots, robots, heads, batch)
        found[~torch.eye(robots, dtype=torch.bool)] = weights.transpose(1, 2).flatten(0, 1)
        return found.permute(3, 2, 0, 1)

    def state(self) -> dict[str, Tensor]:
        """Copies of all weights, optimiser moments and running statistics, and the update count.

        Collected transitions and random generators are not part of it.
        """
        state = {name: tensor.detach().clone() for name, tensor in self._tensors().items()}
        return state | {"updates": torch.tensor(self._updates)}

    def load(self, state: dict[str, Tensor]) -> None:
        """Restore what `state` returned, from any device; see `Learner.load`."""
        own = self._tensors() | {"updates": torch.tensor(self._updates)}
        for name in sorted(own.keys() | state.keys()):
            if name not in state:
                raise ValueError(f"state has no tensor {name!r}")
            if name not in own:
                raise ValueError(f"state has an unknown tensor {name!r}")
            given, wanted = state[name], own[name]
            if given.shape != wanted.shape or given.dtype != wanted.dtype:
                raise ValueError(
                    f"state[{name!r}] is {given.dtype} {tuple(given.shape)}: must be "
                    f"{wanted.dtype} {tuple(wanted.shape)}"
                )
        with torch.no_grad():
            for name, tensor in own.items():
                tensor.copy_(state[name])
        self._updates = int(own["updates"])

    def _modules(self) -> dict[str, nn.Module]:
        """All networks that are part of the state, by name."""
        return {"actor": self.actor, "critic": self.critic}

    def _running(self) -> dict[str, Tensor]:
        """Live tensors of running statistics that are part of the state, by name."""
        return {}

    def _tensors(self) -> dict[str, Tensor]:
        """Live tensors of the state by name."""
        tensors = self._running()
        for name, module in self._modules().items():
            tensors |= {f"{name}.{key}": value for key, value in module.named_parameters()}
        for name, adam in zip(MOMENTS, (self._actor_adam, self._critic_adam), strict=True):
            for key, moments in adam.moments.items():
                tensors |= {f"{name}.{key}.{part}": moments[part] for part in sorted(moments)}
        return tensors

    def _update(self, *tensors: Tensor | None) -> Tensor:
        """Do `_update_networks` with matrix products in `network.precision`, and count it.

        Raises:
            DivergenceError: A metric is not finite; no network and no moment has changed.
        """
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._bfloat16):
            undo = self._kept_for_undoing()
            metrics = self._update_networks(self._networks, *tensors, _as_tensor(self._rate))
            if not bool(metrics.isfinite().all()):
                undo.restore()
                try:
                    self._refuse(metrics, tensors)
                finally:
                    undo.restore()
        self._updates += 1
        return metrics

    def _kept_for_undoing(self) -> Undo:
        """What undoes an update: it remembers all networks and moments as they are now."""
        if self._undo is None:
            plain = self._plain_networks or self._networks
            networks = [getattr(plain, field.name) for field in fields(plain)]
            self._undo = Undo([tensor for network in networks for tensor in network.memory()])
        self._undo.keep()
        return self._undo

    def _refuse(self, metrics: Tensor, tensors: Sequence[Tensor | None]) -> NoReturn:
        """Find out which gradient of an update is not finite, by its plain form done once more.

        Raises:
            DivergenceError: Always.
        """
        plain = self._networks if self._plain_networks is None else self._plain_networks
        self._not_finite = not_finite(metrics, self._metric_names)
        try:
            type(self)._update_networks(self, plain, *tensors, _as_tensor(self._rate))
            raise DivergenceError(self._not_finite)
        finally:
            self._not_finite = None

    def _averaged(
        self, gradients: Mapping[str, Gradients], numbers: Sequence[Tensor]
    ) -> tuple[list[Gradients], list[Tensor]]:
        """Means of gradients, by name of their network, and of numbers over all workers.

        Raises:
            DivergenceError: A gradient is not finite, and `_refuse` wants to know.
        """
        means, numbers = workers.averaged(list(gradients.values()), numbers)
        if self._not_finite is not None:
            robots = self._team.num_robots
            for name, found in zip(gradients, means, strict=True):
                refuse_not_finite_gradients(self._not_finite, name, robots, found)
        return means, numbers

    def _do_update(self, batch_size: int, update: Callable[[], Tensor]) -> bool:
        """Do one update of a call of `learn`, as a whole or, where it is interrupted, not at all.

        The metrics are kept until `_take_metrics`, so that `learn` can go on in a later call.

        Returns:
            Whether something was learnt.

        Raises:
            DivergenceError: A number is not finite, and that is not to be skipped.
            CompilerError: See there.
        """
        self.interruptions.check()
        try:
            self._compile_or_do(batch_size, update)
        except DivergenceError:
            if not self.skips_divergence:
                raise
            self._skipped += 1
            return False
        return True

    def _compile_or_do(self, batch_size: int, update: Callable[[], Tensor]) -> None:
        if self._compiled_for is None or batch_size in self._compiled_for:
            self._rows.append(update())
            return
        # The compiler works now, for up to a minute. Who asks it to stop shall not wait.
        undo, updates = self._kept_for_undoing(), self._updates
        draws = [generator.get_state() for generator in self._generators()]
        try:
            with self.interruptions.at_once(), warnings.catch_warnings():
                # On a GPU it advises what no user can do, or less precise products.
                warnings.filterwarnings("ignore", category=UserWarning, module=r"torch\._inductor")
                self._rows.append(update())
        except BaseException as error:
            undo.restore()
            self._updates = updates
            for generator, draw in zip(self._generators(), draws, strict=True):
                generator.set_state(draw)
            self.interruptions.check()  # the compiler may have made another error of it
            if not failed_to_compile(error):
                raise
            self._uncompile()
            raise CompilerError(first_line(error)) from error
        self._compiled_for.add(batch_size)

    def _uncompile(self) -> None:
        """Do updates operation by operation from now on."""
        assert self._plain_networks is not None  # `compile` was called
        self._networks, self._plain_networks, self._compiled_for = self._plain_networks, None, None
        del self._update_networks  # that of the class is there again

    def _take_metrics(self) -> dict[str, float] | None:
        """Means over the updates of a call of `learn`, which is done now; None if none was due."""
        found: dict[str, float] = {}
        if self._rows:
            means = torch.stack(self._rows).mean(dim=0).tolist()
            found |= dict(zip(self._metric_names, means, strict=True))
        if self._skipped:
            found["skipped_updates"] = float(self._skipped)
        self._rows, self._skipped = [], 0
        return found or None

    def _generators(self) -> list[torch.Generator]:
        """What an update draws from."""
        return [self._noise]

    def _resume_state(self) -> dict[str, Tensor]:
        """What every learner needs to go on, beside `state`; see `Resumable`."""
        state = {"noise": self._noise.get_state(), "skipped": whole(self._skipped)}
        return state | ({"rows": torch.stack(self._rows)} if self._rows else {})

    def _load_resume_state(self, state: State) -> None:
        """Go on from what `_resume_state` gave."""
        take_generator(state, "noise", self._noise)
        self._skipped = take_whole(state, "skipped")
        self._rows = []
        if "rows" in state:
            self._rows = list(take(state, "rows", self._dtype, None, None).to(self._device))

    def _log_probs_of(self, obs: Tensor) -> Tensor | None:
        """(R, A, E) log-probabilities with which `act` drew actions for just these observations.

        None where they are not known, or actions are continuous.
        """
        if self._acted is None or self._acted[0] is not obs or self._team.action_width:
            return None
        return self._acted[1].log_softmax(dim=1)

    def _number(self, value: float) -> Tensor:
        """() of the networks' type. A compiled graph would be compiled anew for a plain number."""
        return torch.tensor(value, dtype=self._dtype, device=self._device)

    def _seen_in(self, rows: Tensor) -> Tensor:
        """The observations (R, B, D) in rows, behind which is what messages need, if anything."""
        return rows[..., : self._team.obs_width]

    def _draw(self, shape: tuple[int, ...]) -> Tensor:
        """Noise for `sample_actions`, of the shape of the logits."""
        return action_noise(shape, self._noise, self._dtype)

    def _robots_first(self, obs: Tensor) -> Tensor:
        """Bring (B, R, D) to (R, B, D), as the networks take it, on their device and dtype."""
        return self._laid_out(obs.to(self._device, self._dtype).transpose(0, 1))

    def _laid_out(self, obs: Tensor) -> Tensor:
        """Observations (R, B, D) in the order in memory that the networks read fastest."""
        return batch_last_in_memory(obs) if self._by_entity else obs

    def _turned_by(self, elements: Tensor | None) -> Tensor | None:
        """Bring elements (B, R), if there are any, to (R, B) on the networks' device."""
        return None if elements is None else elements.to(self._device).t()

    def _available(self, obs: Tensor) -> Tensor | None:
        """(B, R) bool from observations (R, B, D); None where no robot is to be masked."""
        if self._availability_column is None:
            return None
        return (obs[:, :, self._availability_column] > 0.5).t()


def _as_tensor(rate: float) -> Tensor:
    """() float64 on the CPU. A compiled graph would be compiled anew for another plain number."""
    return torch.tensor(rate, dtype=torch.float64)
