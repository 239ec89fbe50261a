"""The value of a scripted policy as a potential, fitted to the script's own play before training.

It shapes rewards by F = discount * Phi(s') - Phi(s) and knows no learner. Sources: Ng et al. 1999
(such rewards leave the best policy as it is, if the learner has the same discount); Cheng et al.
2021 (a learner with a smaller discount keeps more of the signal, and is biased towards the script).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.learn.adam import AdamStepper, Forward
from innerattn.learn.advantage import generalised_advantage
from innerattn.learn.resume import State, inside, take, under
from innerattn.nn import CentralCritic, SquareSymmetry
from innerattn.train.frames import square_symmetry
from innerattn.train.script_play import Play, play_script

_HELD_OUT = 8
"""Every so many worlds, one is held out of the fit."""
_HIDDEN_WIDTH = 128
_PASSES = 12
"""Passes over the play; the returns follow the values anew before each."""
_MINIBATCH = 1024
_LEARNING_RATE = 0.003
_LAMBDA = 0.95
_CHUNK = 4096
"""Rows whose values are computed at a time."""
_NO_ACTIONS = torch.empty(0)


class Potential:
    """Phi of joint observations, in units of reward."""

    def __init__(
        self,
        team: tuple[int, int],
        discount: float,
        symmetry: SquareSymmetry | None,
        generator: torch.Generator,
        device: torch.device,
    ) -> None:
        """Draw the parameters; `fit` fits them.

        Args:
            team: R and D, robots and columns of an observation.
            discount: of a control step, below 1.
            symmetry: turns every robot's observation into its own frame; None: they stay as seen.
            generator: source of the initial parameters and of the order of rows, on the CPU.
            device: where Phi is computed.
        """
        self.discount = discount
        self._symmetry, self._generator = symmetry, generator
        width = team[0] * team[1]
        self._network = CentralCritic(1, width, 1, _HIDDEN_WIDTH, generator).to(device)
        self._mean = self._deviation = torch.zeros((), device=device)
        self._last: tuple[Tensor, Tensor] | None = None

    def values(self, obs: Tensor) -> Tensor:
        """Phi (B,) float32 of observations (B, R, D)."""
        return self._values(self._as_rows(obs))

    def shaping(self, obs: Tensor, next_obs: Tensor, terminated: Tensor) -> Tensor:
        """F (B,) float32 of transitions; nothing comes after a termination, a time limit is none.

        Args:
            obs: (B, R, D) float32.
            next_obs: (B, R, D) float32, of the same episode.
            terminated: (B,) bool.
        """
        before, after = self._known_values(obs), self.values(next_obs)
        self._last = (next_obs, after)
        return self.discount * after * ~terminated - before

    def _known_values(self, obs: Tensor) -> Tensor:
        """Phi (B,) of states, computed only where they are not those after the last transitions."""
        if self._last is None or self._last[0].shape != obs.shape:
            return self.values(obs)
        values = self._last[1].clone()
        new = (obs != self._last[0]).flatten(1).any(1)
        if bool(new.any()):
            values[new] = self.values(obs[new])
        return values

    def fit(self, play: Play, check: Callable[[], None]) -> float:
        """Fit Phi to the lambda-returns of a script's play, by fitted value iteration.

        Args:
            play: the play; its observations are turned in place, since they may be large.
            check: called before each pass.

        Returns:
            The correlation of Phi with the discounted returns in worlds that were held out. Where
            an episode or the play goes on unseen, Phi stands for what comes then. It is 0 where
            one of both never changes.
        """
        steps, worlds = play.reward.shape
        rows, after = self._as_rows_in_place(play.obs.flatten(0, 1)), self._as_rows(play.after)
        held_out = torch.arange(worlds, device=rows.device) % _HELD_OUT == _HELD_OUT - 1
        fitted = (~held_out).repeat(steps).nonzero().squeeze(1)
        self._mean = play.reward.mean() / (1.0 - self.discount)
        self._deviation = torch.ones_like(self._mean)
        first = self._returns(play, self._mean.expand(steps * worlds), self._mean, _LAMBDA)
        self._deviation = first.flatten()[fitted].std().clamp_min(1e-6)

        adam = AdamStepper(self._network)
        total = _PASSES * -(-len(fitted) // _MINIBATCH)
        rates = iter(torch.linspace(1.0, 0.01, total, dtype=torch.float64) * _LEARNING_RATE)
        for _ in range(_PASSES):
            check()
            target = self._returns(play, self._all(rows), self._all(after), _LAMBDA).flatten()
            order = torch.randperm(len(fitted), generator=self._generator).to(fitted.device)
            for chosen in torch.split(fitted[order], _MINIBATCH):
                some, wanted = rows[chosen], target[chosen]
                gradients, _ = adam.gradients(partial(self._loss, some, wanted))
                adam.step(gradients, next(rates))
        values = self._all(rows)
        seen = held_out.repeat(steps)
        returns = self._returns(play, values, self._all(after), 1.0).flatten()
        correlation = torch.corrcoef(torch.stack([values[seen], returns[seen]]))[0, 1]
        return float(correlation.nan_to_num())

    def resume_state(self) -> dict[str, Tensor]:
        """The fit, and the values that are known already; see `Resumable`."""
        state = under("network", dict(self._network.named_parameters()))
        state |= {"mean": self._mean, "deviation": self._deviation}
        if self._last is not None:
            state |= {"last_obs": self._last[0], "last_values": self._last[1]}
        return {name: tensor.detach() for name, tensor in state.items()}

    @torch.no_grad()
    def load_resume_state(self, state: State) -> None:
        """Go on from a state; see `Resumable`."""
        found, device = inside("network", state), self._mean.device
        for name, parameter in self._network.named_parameters():
            parameter.copy_(take(found, name, torch.float32, *parameter.shape))
        self._mean = take(state, "mean", torch.float32).to(device)
        self._deviation = take(state, "deviation", torch.float32).to(device)
        self._last = None
        if "last_obs" in state:
            obs = take(state, "last_obs", torch.float32, None, None, None)
            values = take(state, "last_values", torch.float32, len(obs))
            self._last = (obs.to(device), values.to(device))

    def _loss(self, rows: Tensor, wanted: Tensor, network: Forward) -> tuple[Tensor, None]:
        """Mean squared error, in deviations of the returns."""
        standard = network(rows.unsqueeze(0), _NO_ACTIONS).q[0, 0]
        return (standard - (wanted - self._mean) / self._deviation).square().mean(), None

    def _returns(self, play: Play, values: Tensor, after: Tensor, lambda_: float) -> Tensor:
        """The lambda-returns (T, E), by values of all rows (T * E,) and after cut steps (n,)."""
        value = values.view(play.reward.shape)
        next_value = torch.cat([value[1:], torch.zeros_like(value[:1])])
        next_value[play.cut] = after
        advantage = generalised_advantage(
            play.reward.unsqueeze(1),
            value.unsqueeze(1),
            next_value.unsqueeze(1),
            play.terminated,
            play.ended,
            self.discount,
            lambda_,
        )
        return advantage.squeeze(1) + value

    def _all(self, rows: Tensor) -> Tensor:
        """Phi of many rows; little memory is used at a time."""
        return torch.cat([self._values(some) for some in torch.split(rows, _CHUNK)])

    @torch.no_grad()
    def _values(self, rows: Tensor) -> Tensor:
        standard: Tensor = self._network(rows.unsqueeze(0), _NO_ACTIONS).q[0, 0]
        return self._mean + self._deviation * standard

    def _as_rows_in_place(self, obs: Tensor) -> Tensor:
        """As `_as_rows`, in the memory of the observations."""
        for some in torch.split(obs, _CHUNK):
            some.copy_(self._as_rows(some).view(some.shape))
        return obs.flatten(1)

    def _as_rows(self, obs: Tensor) -> Tensor:
        """Observations (B, R, D) as one row for each state, (B, R * D)."""
        if self._symmetry is not None:
            obs = self._symmetry.turn(obs, self._symmetry.frame(obs))
        return obs.flatten(1)


def fitted_potential(
    config: RunConfig, env: BatchEnv, check: Callable[[], None]
) -> tuple[Potential, float]:
    """Phi of the script `train.potential` in the training worlds, and how well it fits.

    Args:
        config: the run.
        env: its training worlds; they are not stepped.
        check: called again and again on the way; what it raises is passed on.

    Returns:
        Phi, and its correlation with returns that were held out, see `Potential.fit`.

    Raises:
        MemoryError: the play does not fit.
    """
    train = config.train
    play_seed, seed = _seeds(config)
    play = play_script(
        train.potential,
        env.scenario,
        train.potential_env_steps,
        seed=play_seed,
        threads=train.threads,
        check=check,
    )
    device = torch.device(train.device)
    potential = unfitted_potential(config, env, seed)
    return potential, potential.fit(Play._make(tensor.to(device) for tensor in play), check)


def unfitted_potential(config: RunConfig, env: BatchEnv, seed: int = 0) -> Potential:
    """Phi before its fit, with parameters drawn by ``seed``."""
    device = torch.device(config.train.device)
    return Potential(
        (env.num_robots, env.obs_width),
        config.potential_discount,
        square_symmetry(env.scenario, env.observation_names(), device),
        torch.Generator().manual_seed(seed),
        device,
    )


def _seeds(config: RunConfig) -> tuple[int, int]:
    """Of the script's play, and of the fit."""
    numbers = np.random.SeedSequence([config.train.seed, 2]).generate_state(2, np.uint64)
    return int(numbers[0]), int(numbers[1])
