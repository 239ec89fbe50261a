"""The value of afterstates: worlds after a rescue, before it is drawn where new victims appear.

A new victim is near or far by chance, whatever the robots did, and the value of the next state with
it. The value of the afterstate is the mean over all draws. Put in the place of the next state's
value, it leaves the expectation of advantages as it is, and most of their variance out. Source:
Sutton & Barto 2018, section 6.8 (afterstates).
"""

from __future__ import annotations

from functools import partial

import torch
from torch import Tensor

from innerattn.learn import losses
from innerattn.learn.adam import AdamStepper, Forward
from innerattn.learn.gradients import clip_norm
from innerattn.learn.resume import State, take, take_generator, under
from innerattn.learn.rollout import Arrivals
from innerattn.nn import CentralCritic

_NO_ACTIONS = torch.empty(0)


class AfterstateCritic:
    """One network for the whole team, from the state of a world to a value for each robot.

    Attributes:
        network: Maps states (1, n, S) to values (1, n, R).
    """

    def __init__(
        self,
        sizes: tuple[int, int, int],
        *,
        seed: int,
        device: torch.device,
        dtype: torch.dtype,
    ) -> None:
        """Draw the parameters.

        Args:
            sizes: S, columns of a state; R, robots; and the width of both hidden layers.
            seed: Seed of the parameters and of the order of rows.
            device: Where the network lives.
            dtype: Floating-point type of the network.
        """
        width, self._robots, hidden = sizes
        self._draws = torch.Generator().manual_seed(seed)
        network = CentralCritic(1, width, self._robots, hidden, self._draws)
        self.network = network.to(device, dtype)
        self._adam = AdamStepper(self.network)
        self._dtype, self._device = dtype, device

    def fit(
        self,
        arrivals: Arrivals,
        next_value: Tensor,
        *,
        passes: int,
        minibatch_size: int,
        grad_clip: float,
        rate: Tensor,
    ) -> None:
        """Fit the network to the values of the states that followed.

        Args:
            arrivals: The n afterstates of a rollout, at least one.
            next_value: (T, R, E) value of the state after each step.
            passes: Passes over the afterstates.
            minibatch_size: Afterstates per step of Adam.
            grad_clip: Largest norm of the gradients.
            rate: () float64, the step size.
        """
        wanted = next_value[arrivals.step, :, arrivals.env].t()
        for _ in range(passes):
            order = torch.randperm(len(arrivals.step), generator=self._draws).to(self._device)
            for chosen in torch.split(order, minibatch_size):
                loss_of = partial(self._loss, arrivals.states[chosen], wanted[:, chosen])
                gradients, _ = self._adam.gradients(loss_of)
                norm = clip_norm(gradients, grad_clip)
                self._adam.step(gradients, rate, norm.isfinite())

    @torch.no_grad()
    def put_in_place(self, arrivals: Arrivals, next_value: Tensor) -> Tensor:
        """The values (T, R, E) after each step, those of the afterstates where victims appeared.

        Args:
            arrivals: The n afterstates, at least one.
            next_value: (T, R, E) value of the state after each step; it stays as it is.
        """
        found = next_value.clone()
        found[arrivals.step, :, arrivals.env] = self._values(self.network, arrivals.states).t()
        return found

    def resume_state(self) -> dict[str, Tensor]:
        """The fit, and what it goes on with; see `Resumable`."""
        return {"draws": self._draws.get_state(), **self._tensors()}

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
