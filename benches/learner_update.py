"""Time of one update of the off-policy learner, beside the plain loop over robots and heads.

The plain form is the tests' reference: like MAAC's public code it has modules of its own for every
robot and head. `python benches/learner_update.py` writes its table into `docs/performance.md`.
"""

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import torch
from page import machine, publish, table
from torch import Tensor

from innerattn.config import NetworkConfig, TDConfig
from innerattn.learn import TD, Team, Transitions

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "learn"))
from reference import PlainTD

TEAM = Team(num_robots=4, obs_width=44, num_actions=5)
CASES = [(batch, threads) for batch in (256, 1024) for threads in (1, 2)]
REPEATS = 25
NUM_ENVS = 64


def random_transitions(count: int) -> Transitions:
    shape = (count, TEAM.num_robots)
    return Transitions(
        torch.randn(*shape, TEAM.obs_width),
        torch.randint(TEAM.num_actions, shape),
        torch.randn(shape),
        torch.randn(*shape, TEAM.obs_width),
        torch.zeros(count, dtype=torch.bool),
    )


def draw(log_prob: list[Tensor]) -> Tensor:
    return torch.cat([torch.multinomial(x.detach().exp(), 1) for x in log_prob], dim=1)


def median_ms(*actions: Callable[[], object]) -> list[float]:
    """Medians over calls in turn, so that a busy machine burdens all alike."""
    times: list[list[float]] = [[] for _ in actions]
    for repeat in range(-2, REPEATS):  # the first two warm up
        for action, taken in zip(actions, times, strict=True):
            start = time.perf_counter()
            action()
            if repeat >= 0:
                taken.append(1e3 * (time.perf_counter() - start))
    return [statistics.median(taken) for taken in times]


def main() -> None:
    """Measure and publish the table."""
    torch.manual_seed(0)
    network = NetworkConfig()
    rows = []
    for batch, threads in CASES:
        torch.set_num_threads(threads)
        numbers = TDConfig(batch_size=batch, replay_capacity=20_000)
        learner = TD(TEAM, network, numbers, seed=0, device=torch.device("cpu"))
        learner.replay.add(random_transitions(numbers.replay_capacity))
        plain = PlainTD(learner.state(), network, numbers)
        mean, std = learner.replay.reward_mean.float(), learner.replay.reward_std.float()
        obs = random_transitions(NUM_ENVS).obs
        fast_ms, plain_ms, sample_ms, act_ms = median_ms(
            lambda: learner.update(learner.replay.sample(batch)),  # noqa: B023
            lambda: plain.update(learner.replay.sample(batch), mean, std, draw),  # noqa: B023
            lambda: learner.replay.sample(batch),  # noqa: B023
            lambda: learner.act(obs),  # noqa: B023
        )
        times = [fast_ms, plain_ms, plain_ms / fast_ms, sample_ms, act_ms]
        rows.append([str(batch), str(threads), *(f"{time:.2f}" for time in times)])
    head = ["batch", "threads", "update, ms", "plain, ms", "ratio", "sample, ms", "act, ms"]
    publish("learner_update", f"{machine('numpy', 'torch')}.\n\n{table(head, rows)}")


if __name__ == "__main__":
    main()
