"""How long teams train until they reach a score, side by side with other ways to train.

`python benches/time_to_score.py` trains one team after the other, in the worlds of `mixed`, and
writes its table into `docs/performance.md`. The clock stands still while a team is measured.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Protocol

import torch
from page import machine, publish, table
from torch import Tensor

from innerattn.config import RunConfig, Scenario, load_run_config
from innerattn.cores import let_waiting_threads_sleep
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.policies import PolicyInput, scripted_policy
from innerattn.train.build import build_learner, keep_heap_small, thread_count, torch_threads
from innerattn.train.collect import Collector
from innerattn.train.compilation import compiles
from innerattn.train.matmul_backend import chosen_matmul_backend
from innerattn.train.schedule import Schedule

sys.path.append(str(Path(__file__).parents[1] / "examples"))
sys.path.append(str(Path(__file__).parents[1] / "examples" / "libraries"))

from run_all import environment
from single_file_mappo import train as train_plain

SCORES = (0.5, 0.7, 0.8, 0.9)
EPISODES = 500
SITUATION = "mixed"


class Acting(Protocol):
    """What is measured."""

    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """Actions (E, R) for observations (E, R, D)."""


Training = Iterator[tuple[int, Acting]]


class Greedy:
    """A team as a policy that takes its likeliest actions."""

    name, needs_true_state = "team", False

    def __init__(self, team: Acting) -> None:
        """Wrap a team."""
        self.team = team

    def act(self, view: PolicyInput) -> object:
        """The likeliest actions."""
        return self.team.act(torch.tensor(view.obs), greedy=True).numpy()

    def reset(self, seed: int) -> None:
        """Nothing is drawn."""


def train_ours(config: RunConfig) -> Training:
    """Train as `innerattn train` does; after every control step of all worlds."""
    env = BatchEnv(
        config.training_scenario,
        config.train.num_envs,
        seed=config.train.seed,
        num_threads=config.train.threads,
    )
    backend = chosen_matmul_backend(config.train.matmul_backend)
    with torch_threads(thread_count(config)), backend, closing(env):
        learner = build_learner(config, env, training=True)
        schedule = Schedule(config, env, learner)
        device = torch.device("cpu")
        stagger = config.train.stagger_starts
        collector = Collector(env, learner, device, schedule, stagger)
        if compiles(config):
            learner.compile()
        done, total = 0, config.train.env_steps
        while done < total:
            schedule.set_progress(done / total)
            learner.observe(*collector.step())
            learner.set_progress(done / total)
            learner.learn()
            done += config.train.num_envs
            yield done, learner


def rescues(policy: object, scenario: Scenario) -> float:
    """Mean rescues of an episode, in worlds that no team trains in."""
    record = run_episodes(policy, scenario, EPISODES, 98_765)  # type: ignore[arg-type]
    return len(record.rescues) / EPISODES


def measure(
    training: Training, score: Callable[[Acting], float], most_seconds: float, every: float
) -> tuple[dict[float, float], float, float]:
    """Seconds of training to each score that was reached, the last score, and env-steps/s."""
    reached: dict[float, float] = {}
    seconds, next_look, done, newest = 0.0, every, 0, 0.0
    began = time.perf_counter()
    team: Acting | None = None
    for env_steps, team in training:
        done = env_steps
        spent = seconds + time.perf_counter() - began
        if spent < next_look:
            continue
        seconds, next_look = spent, spent + every
        newest = score(team)
        reached |= {goal: seconds for goal in SCORES if newest >= goal and goal not in reached}
        if seconds >= most_seconds:
            break
        began = time.perf_counter()
    else:
        seconds += time.perf_counter() - began
        assert team is not None
        newest = score(team)
        reached |= {goal: seconds for goal in SCORES if newest >= goal and goal not in reached}
    return reached, newest, done / seconds


def benchmarl_pace() -> float:
    """Env-steps/s of BenchMARL's MAPPO in worlds of VMAS.

    Raises:
        subprocess.CalledProcessError: BenchMARL cannot be installed here, or VMAS is missing.
    """
    program = Path(__file__).with_name("benchmarl_pace.py")
    command = [str(environment("benchmarl_teams")), str(program)]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return float(said.split()[-1])  # TorchRL logs to the same stream


def main() -> None:
    """Train, measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--most-seconds", type=float, default=420.0, help="of training each")
    parser.add_argument("--every", type=float, default=10.0, help="seconds between two looks")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    let_waiting_threads_sleep()
    keep_heap_small()
    scenario = Scenario.preset(SITUATION)
    low, high = (
        rescues(scripted_policy(name, scenario), scenario) for name in ("random", "hungarian")
    )

    def score(team: Acting) -> float:
        return (rescues(Greedy(team), scenario) - low) / (high - low)

    def ours(method: str, budget: str) -> Training:
        overrides = {"train.seed": given.seed}
        return train_ours(load_run_config(SITUATION, method, budget, overrides=overrides))

    contestants: dict[str, Callable[[], Training]] = {
        "mappo, `fast`": partial(ours, "mappo", "fast"),
        "ppo-inner, `fast`": partial(ours, "ppo-inner", "fast"),
        "td-inner, `fast`": partial(ours, "td-inner", "fast"),
        "td-inner, `short`": partial(ours, "td-inner", "short"),
        "ppo-inner, `short`": partial(ours, "ppo-inner", "short"),
        "single-file MAPPO": partial(train_plain, scenario, given.seed),
    }
    pace = benchmarl_pace()  # first: where it fails, no training is lost
    print(f"BenchMARL: {pace:,.0f} env-steps/s", flush=True)
    rows = []
    for name, begin in contestants.items():
        reached, newest, speed = measure(begin(), score, given.most_seconds, given.every)
        cells = [f"{reached[goal]:.0f} s" if goal in reached else "–" for goal in SCORES]
        rows.append([name, *cells, f"{newest:.2f}", f"{speed:,.0f}"])
        print(f"{name}: {reached}, ends at {newest:.2f}, {speed:,.0f} env-steps/s", flush=True)
    rows.append(["BenchMARL's MAPPO in VMAS", *["–"] * (len(SCORES) + 1), f"{pace:,.0f}"])
    head = ["trained", *(f"to {goal}" for goal in SCORES), "last score", "env-steps/s"]
    note = (
        f"{machine('torch')}. One seed ({given.seed}), {EPISODES} episodes of 25 steps a look, "
        f"a look every {given.every:.0f} s of training, at most {given.most_seconds:.0f} s."
    )
    publish("time_to_score", f"{table(head, rows)}\n\n{note}")


if __name__ == "__main__":
    main()
