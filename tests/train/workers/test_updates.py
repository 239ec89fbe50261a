"""Workers learn what one learner would learn from all their rows, in float64."""

from functools import partial

import pytest
import torch
from torch import Tensor
from worker_threads import Together

from innerattn.config import NetworkConfig, PPOConfig, TDConfig
from innerattn.learn import PPO, TD, Team, Transitions
from innerattn.learn.advantage import ReturnScale
from innerattn.learn.afterstate import AfterstateCritic
from innerattn.learn.divergence import DivergenceError
from innerattn.learn.recall import Recall
from innerattn.learn.rollout import Rollout, standardised

pytestmark = pytest.mark.timeout(120)

CPU = torch.device("cpu")
ROBOTS, WIDTH, ACTIONS, ROWS = 3, 5, 4, 24
TEAM = Team(ROBOTS, WIDTH, ACTIONS, kinds=("food", "food", "medical"))
NETWORK = {"hidden_width": 8, "attention_heads": 2}
CASES = {
    "inner attention": {},
    "uniform weights": {"attention": "uniform"},
    "shared by kind": {"parameter_sharing": "kind", "shared_gradients": "mean"},
}


def ppo(**network: object) -> PPO:
    return PPO(
        TEAM,
        NetworkConfig(**{**NETWORK, **network}),
        PPOConfig(learning_rate=0.01, clip=0.01, actor_grad_clip=0.1, attention_logit_penalty=0.1),
        seed=3,
        device=CPU,
        dtype=torch.float64,
    )


def td(**network: object) -> TD:
    config = TDConfig(learning_rate=0.01, replay_capacity=2 * ROWS, batch_size=ROWS)
    network_config = NetworkConfig(**{**NETWORK, **network})
    return TD(TEAM, network_config, config, seed=3, device=CPU, dtype=torch.float64)


def parts_of(rank: int, count: int) -> slice:
    return slice(rank * ROWS // count, (rank + 1) * ROWS // count)


def rows(seed: int = 0) -> Rollout:
    source = torch.Generator().manual_seed(seed)

    def numbers(*shape: int) -> Tensor:
        return torch.randn(ROBOTS, ROWS, *shape, generator=source, dtype=torch.float64)

    actions = torch.randint(ACTIONS, (ROBOTS, ROWS), generator=source)
    return Rollout(numbers(WIDTH), actions, numbers() - 1.5, numbers(), numbers())


def transitions(seed: int = 0) -> Transitions:
    source = torch.Generator().manual_seed(seed)
    return Transitions(
        torch.randn(ROWS, ROBOTS, WIDTH, generator=source),
        torch.randint(ACTIONS, (ROWS, ROBOTS), generator=source),
        torch.randn(ROWS, ROBOTS, generator=source) + 0.3,
        torch.randn(ROWS, ROBOTS, WIDTH, generator=source),
        torch.rand(ROWS, generator=source) < 0.2,
    )


def of(batch: Transitions, part: slice) -> Transitions:
    return batch._replace(
        **{name: value[part] for name, value in batch._asdict().items() if value is not None}
    )


def compare(results: list[tuple[dict, Tensor]], state: dict, metrics: Tensor) -> None:
    """All workers have the same bits, and but for rounding those of one learner with all rows."""
    for found, numbers in results:
        assert torch.equal(numbers, results[0][1])
        torch.testing.assert_close(numbers, metrics, rtol=1e-9, atol=1e-11)
        for name, value in state.items():
            assert torch.equal(found[name], results[0][0][name]), name
            torch.testing.assert_close(found[name], value, rtol=1e-8, atol=1e-10, msg=name)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("network", CASES.values(), ids=CASES)
def test_ppo(together: Together, network: dict, count: int) -> None:
    alone = ppo(**network)
    metrics = [alone.update(rows(seed)) for seed in range(3)]

    def work(rank: int) -> tuple[dict, Tensor]:
        learner, part = ppo(**network), parts_of(rank, count)
        own = torch.arange(ROWS)[part]
        found = [learner.update(rows(seed).take(own)) for seed in range(3)]
        return learner.state(), torch.stack(found)

    compare(together(count, work), alone.state(), torch.stack(metrics))


def sequences(seed: int, width: int) -> Rollout:
    """The same rows as eight sequences of three steps."""
    source = torch.Generator().manual_seed(seed + 100)
    count = ROWS // 3
    remembered = torch.rand(ROBOTS, count, 2 * width, generator=source, dtype=torch.float64)
    begins = torch.rand(3, count, generator=source) < 0.3
    turns = torch.randint(8, (ROBOTS, ROWS), generator=source)
    return rows(seed)._replace(recall=Recall(remembered, begins, turns))


@pytest.mark.parametrize("count", [2, 4])
def test_ppo_with_a_memory(together: Together, count: int) -> None:
    alone = ppo(memory_width=4, parameter_sharing="kind")
    metrics = [alone.update(sequences(seed, 4)) for seed in range(3)]

    def work(rank: int) -> tuple[dict, Tensor]:
        learner = ppo(memory_width=4, parameter_sharing="kind")
        own = torch.arange(ROWS // 3).tensor_split(count)[rank]
        found = [learner.update(sequences(seed, 4).take(own)) for seed in range(3)]
        return learner.state(), torch.stack(found)

    compare(together(count, work), alone.state(), torch.stack(metrics))


@pytest.mark.long
@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("network", CASES.values(), ids=CASES)
def test_td(together: Together, network: dict, count: int) -> None:
    noise = torch.randn(2, ROBOTS, ACTIONS, ROWS, dtype=torch.float64)

    def learnt(part: slice) -> tuple[dict, Tensor]:
        learner, metrics = td(**network), []
        for seed in range(2):
            learner._draw = partial(lambda draws, _: next(draws), iter(noise[..., part]))
            learner.observe(of(transitions(10 + seed), part), torch.zeros(ROWS, dtype=bool)[part])
            metrics.append(learner.update(of(transitions(seed), part)))
        return learner.state(), torch.stack(metrics)

    compare(together(count, lambda rank: learnt(parts_of(rank, count))), *learnt(slice(ROWS)))


def test_imitation(together: Together) -> None:
    batch = transitions()

    def learnt(part: slice) -> tuple[dict, Tensor]:
        learner = ppo()
        losses = [learner.imitate(batch.obs[part], batch.actions[part], 0.01) for _ in range(3)]
        return learner.state(), torch.tensor(losses)

    compare(together(2, lambda rank: learnt(parts_of(rank, 2))), *learnt(slice(ROWS)))


def test_statistics_of_rollouts(together: Together) -> None:
    source = torch.Generator().manual_seed(1)
    reward = torch.randn(7, ROBOTS, ROWS, generator=source)
    ended = torch.rand(7, ROWS, generator=source) < 0.2
    advantage = torch.randn(ROBOTS, ROWS, generator=source, dtype=torch.float64)
    advantage[2] = 0.1  # never differs

    def found(part: slice) -> tuple[Tensor, Tensor, Tensor]:
        scale = ReturnScale(ROBOTS, 0.9, CPU)
        for first in (0, 4):
            some = slice(first, first + 4)
            scale.update(reward[some][..., part], ended[some][:, part])
        return (
            torch.stack([scale.mean, scale.squares]),
            scale.count,
            standardised(advantage[:, part]),
        )

    moments, count, whole = found(slice(ROWS))
    results = together(3, lambda rank: found(parts_of(rank, 3)))
    for rank, (some, seen, part) in enumerate(results):
        assert torch.equal(some, results[0][0])
        torch.testing.assert_close(some, moments, rtol=1e-12, atol=1e-12)
        assert seen == count
        torch.testing.assert_close(part, whole[:, parts_of(rank, 3)], rtol=1e-9, atol=1e-12)
        assert not part[2].any()


@pytest.mark.parametrize("sizes", [(3, 5), (8, 0), (0, 8), (1, 7)])
def test_afterstates_of_workers_that_have_more_or_fewer(
    together: Together, sizes: tuple[int, int]
) -> None:
    source = torch.Generator().manual_seed(1)
    states = torch.randn(8, 6, generator=source, dtype=torch.float64)
    wanted = torch.randn(ROBOTS, 8, generator=source, dtype=torch.float64)

    def gradients(part: slice) -> dict[str, Tensor]:
        critic = AfterstateCritic(
            (6, ROBOTS, 8), PPOConfig(), seed=0, device=CPU, dtype=torch.float64
        )
        return critic._gradients(states[part], wanted[:, part])

    whole = gradients(slice(8))
    shares = slice(0, sizes[0]), slice(sizes[0], 8)
    for found in together(2, lambda rank: gradients(shares[rank])):
        for name, value in whole.items():
            torch.testing.assert_close(found[name], value, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("broken", [0, 1])
def test_all_workers_find_the_number_that_one_of_them_has(together: Together, broken: int) -> None:
    def work(rank: int) -> tuple[str, str | None, int | None, bool]:
        learner = ppo()
        some = rows().take(torch.arange(ROWS)[parts_of(rank, 2)])
        if rank == broken:
            some.target[1, 2] = torch.inf
        before = learner.state()
        with pytest.raises(DivergenceError) as found:
            learner.update(some)
        same = all(torch.equal(value, before[name]) for name, value in learner.state().items())
        return found.value.what, found.value.source, found.value.robot, same

    first, second = together(2, work)
    assert first == second
    what, source, robot, same = first
    assert what == "losses.critic_loss = inf"
    assert source is not None
    assert source.startswith("the gradient of critic.")
    assert robot == 1 or "attention" in source
    assert same


def test_workers_draw_differently_and_begin_alike(together: Together) -> None:
    obs = torch.zeros(50, ROBOTS, WIDTH)

    def work(_: int) -> tuple[Tensor, Tensor]:
        learner = ppo()
        return learner.act(obs), next(learner.actor.parameters()).detach()

    (actions, weights), (others, same), _ = together(3, work)
    assert torch.equal(weights, same)
    assert not torch.equal(actions, others)
    assert torch.equal(actions, ppo().act(obs))  # those of the first are those of one alone
