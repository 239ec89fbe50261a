"""How long teams train until they reach a score, side by side with other ways to train.

`python benches/time_to_score.py` trains one team after the other, in the worlds of `mixed`, writes
its table into `docs/performance.md` and draws what it saw. The clock stands still while a team is
measured.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

import torch
from page import machine, publish, table
from torch import Tensor

from innerattn.config import RunConfig, Scenario, load_run_config
from innerattn.cores import let_waiting_threads_sleep
from innerattn.envs import BatchEnv
from innerattn.evaluate.play import run_episodes
from innerattn.policies import PolicyInput, scripted_policy
from innerattn.report.plots.drawing import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PAGE_WIDTH_IN,
    PURPLE,
    write_figure,
)
from innerattn.train.build import build_learner, keep_heap_small, thread_count, torch_threads
from innerattn.train.collect import Collector
from innerattn.train.compilation import compiles
from innerattn.train.matmul_backend import chosen_matmul_backend
from innerattn.train.schedule import Schedule

if TYPE_CHECKING:
    from matplotlib.figure import Figure

sys.path.append(str(Path(__file__).parents[1] / "examples"))
sys.path.append(str(Path(__file__).parents[1] / "examples" / "libraries"))

from run_all import environment
from single_file_mappo import train as train_plain

SCORES = (0.5, 0.7, 0.8, 0.9)
EPISODES = 500
SITUATION = "mixed"
FIGURE = Path(__file__).parents[1] / "docs" / "images" / "time_to_score.png"
STYLES = (
    *((BLUE, "-"), (ORANGE, "-"), (GREEN, "-"), (GREEN, "--"), (ORANGE, "--"), (PURPLE, "-.")),
)
"""Of the contestants in their order."""


class Acting(Protocol):
    """What is measured."""

    def act(self, obs: Tensor, greedy: bool = False) -> Tensor:
        """Actions (E, R) for observations (E, R, D)."""


Training = Iterator[tuple[int, Acting]]


class Look(NamedTuple):
    """A team at some time of its training: seconds of training, env-steps and score."""

    seconds: float
    env_steps: int
    score: float


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
) -> list[Look]:
    """Looks at a team in training, at equal times and at the end."""
    looks: list[Look] = []
    seconds, next_look, env_steps = 0.0, every, 0
    began = time.perf_counter()
    team: Acting | None = None
    for env_steps, team in training:
        spent = seconds + time.perf_counter() - began
        if spent < next_look:
            continue
        seconds, next_look = spent, spent + every
        looks.append(Look(seconds, env_steps, score(team)))
        if seconds >= most_seconds:
            break
        began = time.perf_counter()
    else:
        seconds += time.perf_counter() - began
        assert team is not None
        looks.append(Look(seconds, env_steps, score(team)))
    return looks


def row(name: str, looks: Sequence[Look]) -> list[str]:
    """A row of the table: seconds to each score, the last score and env-steps/s."""
    cells = []
    for goal in SCORES:
        reached = [look.seconds for look in looks if look.score >= goal]
        cells.append(f"{reached[0]:.0f} s" if reached else "–")
    last = looks[-1]
    return [name, *cells, f"{last.score:.2f}", f"{last.env_steps / last.seconds:,.0f}"]


def draw(courses: dict[str, list[Look]], greedy: float) -> Figure:
    """Scores against time and against env-steps, beside the scripts."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH_IN, 3.6), layout="constrained")
    by_time, by_steps = figure.subplots(1, 2, sharey=True)
    for (name, looks), (colour, style) in zip(courses.items(), STYLES, strict=False):
        seconds, env_steps, scores = zip(*looks, strict=True)
        line = {"linestyle": style, "color": colour, "linewidth": 1.4, "label": name}
        by_time.plot(seconds, scores, **line)
        by_steps.plot(env_steps, scores, **line)
    by_time.set_xlabel("training [s]", fontsize=8)
    by_steps.set_xlabel("training [env-steps]", fontsize=8)
    by_steps.set_xscale("log")
    by_time.set_ylabel("score, 25 steps", fontsize=8)
    by_time.set_ylim(0.0, 1.06)
    for panel in (by_time, by_steps):
        panel.tick_params(labelsize=7, length=2)
        for script, height in (("hungarian", 1.0), ("greedy", greedy)):
            panel.axhline(height, color=BLACK, linewidth=0.8, linestyle=(0, (1, 1)))
            place = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
            panel.annotate(script, (0.02, height), (0.0, 2.0), fontsize=6, **place)
    handles, names = by_time.get_legend_handles_labels()
    figure.legend(handles, names, fontsize=7, ncols=3, loc="outside lower center", frameon=False)
    return figure


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
    low, middle, high = (
        rescues(scripted_policy(name, scenario), scenario)
        for name in ("random", "greedy", "hungarian")
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
    rows, courses = [], {}
    for name, begin in contestants.items():
        looks = measure(begin(), score, given.most_seconds, given.every)
        rows.append(row(name, looks))
        courses[name.replace("`", "")] = looks
        print(" | ".join(rows[-1]), flush=True)
    rows.append(["BenchMARL's MAPPO in VMAS", *["–"] * (len(SCORES) + 1), f"{pace:,.0f}"])
    head = ["trained", *(f"to {goal}" for goal in SCORES), "last score", "env-steps/s"]
    note = (
        f"{machine('torch')}. One seed ({given.seed}), {EPISODES} episodes of 25 steps a look, "
        f"a look every {given.every:.0f} s of training, at most {given.most_seconds:.0f} s."
    )
    publish("time_to_score", f"{table(head, rows)}\n\n{note}")
    write_figure(FIGURE, draw(courses, (middle - low) / (high - low)))


if __name__ == "__main__":
    main()
