"""Run folders as training and evaluation leave them, with scripted motion and made attention."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from fresh_run import make_run

from innerattn.config import load_run_config
from innerattn.evaluate.measure import Evaluation
from innerattn.evaluate.play import run_episodes
from innerattn.experiments.plan import Case
from innerattn.experiments.run import FinishedRun, read_run
from innerattn.measures.registry import needed_fields
from innerattn.measures.summary import summarise
from innerattn.policies import SCRIPTED, scripted_policy
from innerattn.records.record import Record
from innerattn.records.run_files import RunFiles, seal

RECORDED, SCORED, LONG, LONG_STEPS, HEADS, ROBOTS = 40, 60, 2, 30, 2, 4
LOGGED = 12
FIELDS = ("actions", "rewards", "positions", "velocities", "victims", "faults")


def made_run(
    folder: Path,
    situation: str,
    method: str,
    seed: int,
    chance: int | None = None,
    keys: Mapping[str, object] | None = None,
) -> FinishedRun:
    """Robots go as the greedy dispatch sends them; attention and entropy are random.

    Worlds and what is random are those of ``chance``; None: of ``seed``. ``keys`` are further
    values of the configuration.
    """
    chance = seed if chance is None else chance
    config = load_run_config(
        situation,
        overrides={
            "train.method": method,
            "train.seed": seed,
            "train.threads": 1,
            "network.hidden_width": 8,
            "evaluate.episodes": RECORDED,
            "evaluate.score_episodes": SCORED,
            "evaluate.long_episodes": LONG,
            "evaluate.long_episode_steps": LONG_STEPS,
            "evaluate.seed": chance,
            **(keys or {}),
        },
    )
    path = make_run(folder / f"{situation}-{method}-s{seed}", config)
    rng = np.random.default_rng(chance)
    _write_metrics(path / "metrics.jsonl", method, rng, chance)
    worlds, long_worlds = config.scenario, config.scenario.replace(episode_steps=LONG_STEPS)

    def run(name: str, count: int, first: int = 0, fields: tuple[str, ...] = ()) -> Record:
        policy = scripted_policy(name, worlds, chance)
        return run_episodes(policy, worlds, count, chance, first_episode=first, record=fields)

    recorded = run("greedy", RECORDED, 0, FIELDS)
    weights = made_attention(rng, method, recorded)
    recorded = replace(recorded, policy=method, steps={**recorded.steps, "attention": weights})
    rest = replace(run("greedy", SCORED - RECORDED, RECORDED), policy=method)
    long = run_episodes(scripted_policy("greedy", long_worlds, chance), long_worlds, LONG, chance)
    scripted = {name: [run(name, SCORED, 0, needed_fields(worlds))] for name in SCRIPTED}
    standard = {method: [recorded, rest], **scripted}
    longer = {name: [replace(long, policy=name, length="long")] for name in standard}
    summary = summarise(path.name, recorded, standard, longer)
    parts = [record for group in (standard, longer) for all_ in group.values() for record in all_]
    Evaluation(summary, tuple(parts)).write(path / "evaluation")
    seal(path, RunFiles(path).info)
    return read_run(Case(situation, method, seed), path)


def made_attention(rng: np.random.Generator, method: str, record: Record) -> np.ndarray:
    """(E, T, H, R, R) float32: even, or random for each step."""
    shape = (record.num_episodes, record.scenario.episode_steps, HEADS, ROBOTS, ROBOTS)
    scores = np.zeros(shape) if method.endswith("uniform") else rng.normal(size=shape)
    weights = np.exp(scores) * (1.0 - np.eye(ROBOTS))
    return (weights / weights.sum(-1, keepdims=True)).astype(np.float32)


def _write_metrics(path: Path, method: str, rng: np.random.Generator, chance: int) -> None:
    """Entropy, time and rescues; no episode has ended at the first time."""
    names = ("food_0", "food_1", "navigation_0", "medical_0")
    even = float(np.log(3.0))
    rescues = np.random.default_rng(chance + 1).random(LOGGED)
    with path.open("w") as file:
        for line in range(LOGGED):
            values = rng.uniform(0.2, 1.0, (ROBOTS, HEADS)) - 0.01 * line
            if method.endswith("uniform"):
                values[:] = even
            entropy = dict(zip(names, values.tolist(), strict=True))
            logged = {"env_steps": 100 * (line + 1), "attention_entropy": entropy}
            logged["seconds"] = 0.5 * (line + 1) + float(rescues[line])
            logged["rescues_per_episode"] = line * float(rescues[line]) if line else None
            file.write(json.dumps(logged) + "\n")
