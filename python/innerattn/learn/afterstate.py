"""The value of afterstates: worlds after a rescue, before it is drawn where new victims appear.

A new victim is near or far by chance, whatever the robots did, and the value of the next state with
it. The value of the afterstate is the mean over all draws. In the place of the next state's value,
it keeps the mean of advantages and takes the noise of the draw out of them. Source: Sutton & Barto
2018, section 6.8 (afterstates).
"""

from __future__ import annotations

from functools import partial

import numpy as np
import torch
from torch import Tensor

from innerattn.config import PPOConfig
from innerattn.learn import losses, workers
from innerattn.learn.adam import AdamStepper, Forward, Gradients
from innerattn.learn.gradients import clip_norm
from innerattn.learn.resume import State, take, take_generator, under
from innerattn.learn.rollout import Arrivals
from innerattn.nn import CentralCritic

_NO_ACTIONS = torch.empty(0)


class AfterstateCritic:
    """One network for the whole team, from the state of a world to a value for each robot.

    Attributes:
        network: Maps states (1, n, S) to values (1, R, n).
    """

    def __init__(
        self,
        sizes: tuple[int, int, int],
        ppo: PPOConfig,
        *,
        seed: int,
        device: torch.device,
        dtype: torch.dtype,
    ) -> None:
        """Draw the parameters.

        Args:
            sizes: S, columns of a state; R, robots; and the width of both hidden layers.
            ppo: Says how the network is fitted.
            seed: Seed of the run, for the parameters and the order of rows.
            device: Where the network lives.
            dtype: Floating-point type of the network.
        """
        width, robots, hidden = sizes
        draws_seed = int(np.random.SeedSequence([seed, 3]).generate_state(1, np.uint64)[0])
        self._draws = torch.Generator().manual_seed(draws_seed)
        self.network = CentralCritic(1, width, robots, hidden, self._draws).to(device, dtype)
        self._adam = AdamStepper(self.network)
        self._config = ppo

    @torch.no_grad()
    def replaced(self, arrivals: Arrivals, next_value: Tensor, rate: float) -> Tensor:
        """The values after each step, those of the afterstates where victims appeared.

        The network is fitted to the values of these states before.

        Args:
            arrivals: The n afterstates of a rollout.
            next_value: (T, R, E) value of the state after each step; it stays as it is.
            rate: The step size.

        Returns:
            (T, R, E).
        """
        if not workers.total(torch.tensor(len(arrivals.step))):
            return next_value
        self._fit(arrivals.states, next_value[arrivals.step, :, arrivals.env].t(), rate)
        if not len(arrivals.step):  # other workers have some
            return next_value
        found = next_value.clone()
        found[arrivals.step, :, arrivals.env] = self._values(self.network, arrivals.states).t()
        return found

    def _fit(self, states: Tensor, wanted: Tensor, rate: float) -> None:
        """Pass over states (n, S), whose values are to become ``wanted`` (R, n)."""
        config, step_size = self._config, torch.tensor(rate, dtype=torch.float64)
        for _ in range(config.afterstate_epochs or config.epochs):
            order = torch.randperm(len(states), generator=self._draws).to(states.device)
            for chosen in _minibatches(order, config.minibatch_size):
                gradients = self._gradients(states[chosen], wanted[:, chosen])
                norm = clip_norm(gradients, config.critic_grad_clip)
                if bool(norm.isfinite()):
                    self._adam.step(gradients, step_size)

    def _gradients(self, states: Tensor, wanted: Tensor) -> Gradients:
        """Gradients over the rows of all workers, each of which counts alike."""
        if workers.count() == 1:
            return self._adam.gradients(partial(self._loss, states, wanted))[0]
        rows = torch.tensor(float(len(states)))
        share = rows / workers.mean(rows)
        if len(states):
            found, _ = self._adam.gradients(partial(self._loss, states, wanted))
            own = {name: gradient * share for name, gradient in found.items()}
        else:
            own = {name: torch.zeros_like(value) for name, value in self._adam.values.items()}
        (gradients,), _ = workers.averaged([own], [])
        return gradients

    def resume_state(self) -> dict[str, Tensor]:
        """The fit, and what it goes on with; see `Resumable`."""
        # Copies: parameters share counts of steps, which a file cannot hold twice.
        held = {name: tensor.clone() for name, tensor in self._tensors().items()}
        return {"draws": self._draws.get_state(), **held}

    @torch.no_grad()
    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        take_generator(state, "draws", self._draws)
        for name, tensor in self._tensors().items():
            tensor.copy_(take(state, name, tensor.dtype, *tensor.shape))

    def _tensors(self) -> dict[str, Tensor]:
        """Live tensors by name."""
        tensors = under("network", self._adam.values)
        for name, moments in self._adam.moments.items():
            tensors |= under(f"adam.{name}", moments)
        return tensors

    def _loss(self, states: Tensor, wanted: Tensor, network: Forward) -> tuple[Tensor, None]:
        return losses.critic_loss(self._values(network, states), wanted), None

    def _values(self, network: Forward, states: Tensor) -> Tensor:
        """(R, n) values of states (n, S)."""
        values: Tensor = network(states.unsqueeze(0), _NO_ACTIONS).q[0]
        return values


def _minibatches(order: Tensor, size: int) -> tuple[Tensor, ...]:
    """Parts of this worker's rows, as many for every worker: an exchange needs all of them.

    With one worker the last part may be short, and a row in it weighs more than the others; orders
    are drawn anew for each pass, so each row is as likely to be there. Published runs are fitted
    in such parts.
    """
    if workers.count() == 1:
        return torch.split(order, size)
    rows = int(workers.total(torch.tensor(len(order))))
    return torch.tensor_split(order, -(-rows // size))
