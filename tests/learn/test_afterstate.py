"""The value of afterstates: its fit against a plain loop, and what it changes in advantages."""

import numpy as np
import pytest
import torch
from torch import Tensor

from innerattn.config import NetworkConfig, PPOConfig
from innerattn.learn import PPO, Team, Transitions
from innerattn.learn.afterstate import AfterstateCritic
from innerattn.learn.rollout import Arrivals, Rollout
from innerattn.learn.types import Afterstates

CPU = torch.device("cpu")
ROBOTS, OBS_WIDTH, NUM_ACTIONS, ENVS, STEPS, STATE_WIDTH = 2, 5, 3, 4, 6, 3
NUMBERS = {"rollout_steps": STEPS, "minibatch_size": 5, "epochs": 2, "gamma": 0.9}
ARRIVED = [[0, 2], [], [1], [3], [], [0, 1, 3]]
"""Worlds in which victims appear, step by step."""


def make(bootstrap: str, advantage: str = "value", state_width: int = STATE_WIDTH) -> PPO:
    attention = "none" if advantage == "value" else "inner"
    return PPO(
        Team(ROBOTS, OBS_WIDTH, NUM_ACTIONS, state_width=state_width),
        NetworkConfig(hidden_width=8, attention_heads=2, attention=attention),
        PPOConfig(**NUMBERS, bootstrap=bootstrap, advantage=advantage),
        seed=3,
        device=CPU,
        dtype=torch.float64,
    )


def observed(learner: PPO, arrived: list[list[int]]) -> tuple[Tensor, Tensor, list[Tensor]]:
    """A rollout shown to the learner: rewards (T, E, R), the last observations, afterstates."""
    source = torch.Generator().manual_seed(0)
    obs = torch.randn(ENVS, ROBOTS, OBS_WIDTH, generator=source)
    never = torch.zeros(ENVS, dtype=torch.bool)
    rewards, shown = [], []
    for envs in arrived:
        after = torch.randn(ENVS, ROBOTS, OBS_WIDTH, generator=source)
        reward = torch.randn(ENVS, ROBOTS, generator=source)
        states = torch.randn(ENVS, STATE_WIDTH, generator=source)[envs]
        batch = Transitions(
            obs,
            torch.randint(NUM_ACTIONS, (ENVS, ROBOTS), generator=source),
            reward,
            after,
            never,
            afterstates=Afterstates(torch.tensor(envs, dtype=torch.int64), states),
        )
        learner.observe(batch, never)
        rewards.append(reward)
        shown.append(states)
        obs = after
    return torch.stack(rewards), obs, shown


def by_step(rows: Tensor) -> Tensor:
    """Rows (R, T * E) as (T, E, R)."""
    return rows.view(ROBOTS, STEPS, ENVS).permute(1, 2, 0)


@torch.no_grad()
def test_the_value_of_the_afterstate_takes_the_place_of_the_next_states() -> None:
    learner = make("afterstate")
    rewards, last, shown = observed(learner, ARRIVED)
    rollout: Rollout = learner._rollout()
    found = learner._afterstates
    assert found is not None
    value = by_step(learner.critic(rollout.obs, rollout.actions).q[:, 0])
    seen = last.double().transpose(0, 1)
    end = learner.critic(seen, torch.zeros(ROBOTS, ENVS, dtype=torch.int64)).q[:, 0].t()
    scale = learner.scale.std(0.01)
    for robot in range(ROBOTS):
        for env in range(ENVS):
            later = 0.0
            for step in reversed(range(STEPS)):
                after = (end if step == STEPS - 1 else value[step + 1])[env, robot]
                if env in ARRIVED[step]:
                    state = shown[step][ARRIVED[step].index(env)].double()
                    after = found.network(state[None, None], torch.empty(0)).q[0, robot, 0]
                reward = rewards[step, env, robot].double() / scale[robot]
                delta = float(reward + 0.9 * after - value[step, env, robot])
                later = delta + 0.9 * 0.9 * later
                target = by_step(rollout.target)[step, env, robot]
                assert float(target) == pytest.approx(later + float(value[step, env, robot]))


@pytest.mark.parametrize("advantage", ["value", "counterfactual"])
def test_where_no_victim_appears_nothing_changes(advantage: str) -> None:
    state, afterstate = make("state", advantage), make("afterstate", advantage)
    for arrived in ([[]] * STEPS, [[]] * STEPS):
        for learner in (state, afterstate):
            observed(learner, arrived)
            learner.learn()
    assert all(torch.equal(state.state()[k], v) for k, v in afterstate.state().items())
    for learner in (state, afterstate):
        observed(learner, ARRIVED)
        learner.learn()
    assert not torch.equal(*(x.state()["actor.first.weight"] for x in (state, afterstate)))


@pytest.mark.parametrize(("afterstate_epochs", "passes"), [(None, 2), (3, 3)])
def test_the_fit_agrees_with_a_plain_loop(afterstate_epochs: int | None, passes: int) -> None:
    ppo = PPOConfig(
        epochs=2, afterstate_epochs=afterstate_epochs, minibatch_size=4, critic_grad_clip=0.5
    )
    sizes = (STATE_WIDTH, ROBOTS, 8)
    critic = AfterstateCritic(sizes, ppo, seed=5, device=CPU, dtype=torch.float64)
    source = np.random.default_rng(0)
    step, env = np.nonzero(source.random((STEPS, ENVS)) < 0.5)
    states, next_value = source.normal(size=(len(step), 3)), source.normal(size=(STEPS, 2, ENVS))
    first, second, output = (
        torch.nn.Linear(*sizes, dtype=torch.float64) for sizes in ((3, 8), (8, 8), (8, 2))
    )
    weights = dict(critic.network.named_parameters())
    with torch.no_grad():
        for name, layer in (("first", first), ("second", second), ("output", output)):
            layer.weight.copy_(weights[f"{name}.weight"][0])
            layer.bias.copy_(weights[f"{name}.bias"][0])
    layers = (first, torch.nn.LeakyReLU(), second, torch.nn.LeakyReLU(), output)
    plain = torch.nn.Sequential(*layers)
    adam = torch.optim.Adam(plain.parameters(), lr=0.01)
    draws = torch.Generator()
    draws.set_state(critic.resume_state()["draws"])
    arrivals = Arrivals(*map(torch.from_numpy, (step, env, states)))
    critic.replaced(arrivals, torch.from_numpy(next_value), 0.01)
    for _ in range(passes):
        order = torch.randperm(len(step), generator=draws).tolist()
        for start in range(0, len(order), 4):
            rows = order[start : start + 4]
            loss = torch.zeros((), dtype=torch.float64)
            for row in rows:
                wanted = torch.from_numpy(next_value[step[row], :, env[row]])
                loss = loss + (plain(torch.from_numpy(states[row])) - wanted).square().sum()
            adam.zero_grad()
            (loss / len(rows)).backward()
            torch.nn.utils.clip_grad_norm_(plain.parameters(), 0.5)
            adam.step()
    for name, layer in (("first", first), ("second", second), ("output", output)):
        torch.testing.assert_close(weights[f"{name}.weight"][0], layer.weight)
        torch.testing.assert_close(weights[f"{name}.bias"][0], layer.bias)


def test_it_learns_the_mean_over_draws() -> None:
    ppo = PPOConfig(afterstate_epochs=20, minibatch_size=400, critic_grad_clip=9.0)
    critic = AfterstateCritic((1, 1, 16), ppo, seed=0, device=CPU, dtype=torch.float32)
    source = torch.Generator().manual_seed(0)
    kind = torch.randint(2, (25, 64), generator=source)
    next_value = (3.0 * kind + torch.randn(25, 64, generator=source)).unsqueeze(1)
    step, env = torch.ones(25, 64).nonzero(as_tuple=True)
    arrivals = Arrivals(step, env, kind[step, env].float().unsqueeze(1))
    found = critic.replaced(arrivals, next_value, 0.01)[:, 0]
    for number in range(2):
        expected = next_value[:, 0][kind == number].mean()
        torch.testing.assert_close(found[kind == number].mean(), expected, atol=0.1, rtol=0.0)
        assert found[kind == number].std() < 0.01


def test_states_of_no_width_are_refused() -> None:
    with pytest.raises(ValueError, match=r"state_width = 0: ppo\.bootstrap = 'afterstate'"):
        make("afterstate", state_width=0)
