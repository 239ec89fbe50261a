"""Kills workers of a study again and again, and holds what is left against an undisturbed study."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tiny_study import TINY

from innerattn.studies.folder import StudyFolder, begin_study, open_study

INTERVAL_ENV_STEPS = 16_384
LONG = f"""
question = "Does a killed worker change anything?"
[grid]
methods = ["ppo-inner", "mappo"]
budgets = ["fast"]
seeds = "0..11"
[[variants]]
name = "long"
train.env_steps = 442_368
train.checkpoint_every_env_steps = {INTERVAL_ENV_STEPS}
train.log_every_env_steps = 4_096
train.compile = "off"
evaluate.score_episodes = 100
evaluate.episodes = 20
evaluate.long_episodes = 10
[[contrasts]]
name = "attention"
a = {{ method = "ppo-inner" }}
b = {{ method = "mappo" }}
margin = 0.05
"""
SHORT = TINY.replace('seeds = "0..2"', 'seeds = "0..119"')


@dataclass
class Killed:
    """What was killed.

    Attributes:
        count: workers.
        lost: env-steps that each had logged past its newest checkpoint.
    """

    count: int = 0
    lost: list[int] = field(default_factory=list)


@contextmanager
def cluster(nodes: int) -> Iterator[str]:
    """The address of a Ray cluster on loopback whose nodes have a core each."""
    os.environ |= {"RAY_USAGE_STATS_ENABLED": "0", "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}
    from ray.cluster_utils import Cluster

    found = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False}
    )
    try:
        for _ in range(nodes - 1):
            found.add_node(num_cpus=1)
        yield found.address
    finally:
        found.shutdown()


def command(file: Path, out: Path, *more: str) -> list[str]:
    words = ["study", "run", str(file), "--out", str(out), "--workers", "2", "-q", *more]
    return [sys.executable, "-m", "innerattn", *words]


def kill_one(study: StudyFolder, chance: random.Random, killed: Killed) -> None:
    """Kill the process of a run that has saved a checkpoint, by the number that its claim holds."""
    states = study.ledger().states(run.key for run in study.planned)
    claims, begun = study.path / "claims", []
    for key in (key for key, state in states.items() if state == "claimed"):
        number = max(int(path.name.split(".")[1]) for path in claims.glob(f"{key}.*"))
        run = study.path / "work" / f"{key}.{number}" / key
        if (run / "checkpoints" / "latest").exists():
            begun.append((claims / f"{key}.{number}", run))
    if not begun:
        return
    claim, run = chance.choice(begun)
    try:
        os.kill(int(claim.read_text().split()[2]), signal.SIGKILL)
    except (FileNotFoundError, ProcessLookupError, IndexError):
        return
    killed.count += 1
    try:
        lines = (run / "metrics.jsonl").read_bytes().splitlines()
        latest = int((run / "checkpoints" / "latest").read_text())
    except FileNotFoundError:  # another worker has taken it over
        return
    if lines:
        killed.lost.append(json.loads(lines[-1])["env_steps"] - latest)


def results(study: StudyFolder) -> dict[str, tuple[object, ...]]:
    """What each run of a study left: weights, evaluation and metrics without times."""
    found = {}
    for run in study.planned:
        folder = study.runs / run.key
        lines = [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]
        timeless = [
            {key: value for key, value in line.items() if not key.endswith(("seconds", "_per_s"))}
            for line in lines
        ]
        steps = [line["env_steps"] for line in lines]
        assert steps == sorted(set(steps)), f"{run}: steps were done twice"
        info = json.loads((folder / "run.json").read_text())
        summary = json.loads((folder / "evaluation/summary.json").read_text())
        found[run.key] = (info["weights_sha256"], summary, timeless)
    return found


def compare(study: StudyFolder, other: StudyFolder) -> None:
    """Hold a study against another one of the same file."""
    assert sorted(os.listdir(study.runs)) == sorted(run.key for run in study.planned)
    assert results(study) == results(other)
    one, two = (
        json.loads((folder.path / "report.json").read_text()) | {"rules": None}
        for folder in (study, other)
    )
    assert one == two


def on_ray(folder: Path, text: str, wanted: int, every_s: float) -> Killed:
    """Work through a study on Ray and beside it undisturbed.

    On Ray, up to ``wanted`` workers are killed, ``every_s`` seconds or more apart: however slow
    the machine is, they are looked for until the study ends.
    """
    file = folder / "study.toml"
    file.write_text(text)
    killed, chance = Killed(), random.Random(0)
    with cluster(2) as address:
        process = subprocess.Popen(command(file, folder / "killed", "--ray", address))
        while process.poll() is None and killed.count < wanted:
            time.sleep(0.5)
            before = killed.count
            if (folder / "killed" / "study.toml").exists():
                kill_one(open_study(folder / "killed"), chance, killed)
            if killed.count > before:
                time.sleep(every_s)
        process.wait()
        assert process.returncode == 0, process.returncode
    subprocess.run(command(file, folder / "whole"), check=True)
    compare(open_study(folder / "killed"), open_study(folder / "whole"))
    return killed


def on_this_machine(folder: Path, text: str) -> None:
    """Kill a study with all its workers when half of its runs are done; go on, and compare."""
    file = folder / "study.toml"
    file.write_text(text)
    process = subprocess.Popen(command(file, folder / "killed"), start_new_session=True)
    runs = folder / "killed" / "runs"
    half = len(begin_study(file, folder / "whole").planned) // 2
    while process.poll() is None and (not runs.exists() or len(os.listdir(runs)) < half):
        time.sleep(0.1)
    assert process.poll() is None, "it ended before it was killed"
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    subprocess.run(command(file, folder / "killed"), check=True)
    subprocess.run(command(file, folder / "whole"), check=True)
    compare(open_study(folder / "killed"), open_study(folder / "whole"))
