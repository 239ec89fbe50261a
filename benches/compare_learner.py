"""The off-policy learner beside the plain loop over robots and heads, and what the machine allows.

The plain form is the tests' reference: like MAAC's public code it has modules of its own for every
robot and head. `python benches/compare_learner.py` writes its tables into `docs/performance.md`.
"""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import torch
from page import machine, publish, table
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from innerattn.config import NetworkConfig, TDConfig
from innerattn.learn import TD, Team, Transitions

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "learn"))
from reference import PlainTD

TEAM = Team(num_robots=4, obs_width=44, num_actions=5)
CASES = [(batch, threads) for batch in (256, 1024) for threads in (1, 2)]
REPEATS = 25
NUM_ENVS = 64
REPLAY = 200_000
PROTOCOL_UPDATES = 25_000
MEASURED_UPDATES = 400
ROUNDS = 3


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


def learner_with_replay(batch: int) -> TD:
    numbers = TDConfig(batch_size=batch, replay_capacity=REPLAY)
    learner = TD(TEAM, NetworkConfig(), numbers, seed=0, device=torch.device("cpu"))
    for _ in range(10):
        learner.replay.add(random_transitions(REPLAY // 10))
    return learner


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


def products(batch: int) -> Callable[[], Tensor]:
    """The product that an update has most of: layers of width 128 of four robots."""
    weights, inputs = torch.randn(4, 128, 128), torch.randn(4, 128, batch)
    return lambda: torch.bmm(weights, inputs)


def update_row(batch: int, threads: int) -> list[str]:
    torch.set_num_threads(threads)
    eager, compiled = learner_with_replay(batch), learner_with_replay(batch)
    compiled.compile()
    plain = PlainTD(eager.state(), NetworkConfig(), TDConfig(batch_size=batch))
    mean, std = eager.replay.reward_mean.float(), eager.replay.reward_std.float()
    obs = random_transitions(NUM_ENVS).obs
    with FlopCounterMode(display=False) as counter:
        eager.update(eager.replay.sample(batch))
    gflop = counter.get_total_flops() / 1e9
    compiled.update(compiled.replay.sample(batch))  # compiles
    plain_ms, eager_ms, compiled_ms, product_ms, sample_ms, act_ms = median_ms(
        lambda: plain.update(eager.replay.sample(batch), mean, std, draw),
        lambda: eager.update(eager.replay.sample(batch)),
        lambda: compiled.update(compiled.replay.sample(batch)),
        products(batch),
        lambda: eager.replay.sample(batch),
        lambda: eager.act(obs),
    )
    rate = 2 * 4 * 128 * 128 * batch / 1e9 / product_ms  # GFLOP a millisecond
    return [
        *(str(batch), str(threads), f"{plain_ms:.1f}"),
        *(f"{ms:.1f} ({plain_ms / ms:.2f}x)" for ms in (eager_ms, compiled_ms)),
        *(f"{gflop / rate:.1f}", f"{sample_ms:.2f}", f"{act_ms:.2f}"),
    ]


def pace_and_start_s(compiled: str, threads: int) -> tuple[float, float]:
    """Seconds an update with its steps, and seconds before the first, of the paper's protocol."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        command = [sys.executable, "-m", "innerattn", "train", "--budget", "paper", "--seed", "0"]
        command += ["--train.env-steps", str(25 * MEASURED_UPDATES), "--compile", compiled]
        command += ["--train.threads", str(threads), "--train.log-every-env-steps", "2500"]
        command += ["--evaluate.score-episodes", "2", "--evaluate.long-episodes", "2"]
        subprocess.run([*command, "--run-dir", str(run)], check=True, capture_output=True)
        lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    first, last = lines[0], lines[-1]
    pace = (last["seconds"] - first["seconds"]) / (last["updates"] - first["updates"])
    return pace, last["seconds"] - pace * last["updates"]


def protocol_rows() -> list[list[str]]:
    """25,000 episodes and updates, eager and compiled, from the pace of runs in turn."""
    cases = ("off", "on")
    found: dict[str, list[tuple[float, float]]] = {case: [] for case in cases}
    for _ in range(ROUNDS):
        for case in cases:
            found[case].append(pace_and_start_s(case, threads=2))
    rows = []
    for case in cases:
        pace, start = (statistics.median(values) for values in zip(*found[case], strict=True))
        minutes = (start + pace * PROTOCOL_UPDATES) / 60.0
        rows.append([case, f"{1e3 * pace:.1f}", f"{start:.0f}", f"{minutes:.1f}"])
    return rows


def main() -> None:
    """Measure and publish the tables."""
    torch.manual_seed(0)
    head = ["batch", "threads", "plain, ms", "eager, ms", "compiled, ms", "products, ms"]
    head += ["draw, ms", "act, ms"]
    updates = table(head, [update_row(*case) for case in CASES])
    head = ["--compile", "update and its steps, ms", "start, s", "25,000 updates, min"]
    protocol = table(head, protocol_rows())
    publish("compare_learner", f"{machine('numpy', 'torch')}.\n\n{updates}\n\n{protocol}")


if __name__ == "__main__":
    main()
