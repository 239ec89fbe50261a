"""Our worlds beside other packages': env-steps per second, memory, first step, truth of contacts.

`python benches/compare_envs.py` measures every contestant that is installed, each in processes of
its own, one after another, and writes the tables into `docs/performance.md`. The packages come with
the extra `peers`, as `make bench` installs it; JaxMARL with `pip install jaxmarl`. Protocol: four
agents, 25-step episodes, random discrete actions, one Python call for a step of the batch,
observations and rewards made ready, new episodes at once; all cores.
"""

from __future__ import annotations

import json
import resource
import statistics
import subprocess
import sys
import time
from importlib import import_module

import numpy as np
from contestants import ACTIONS, AGENTS, CONTESTANTS, Contestant, Floats, installed
from page import machine, publish, table

EPISODE = 25
BATCHES = (1, 32, 1024, 4096, 16384)
ROUNDS = 5
ROUND_S = 0.6
SINGLE = ("mpe2",)
"""Contestants without a batch: one world, and 32 in a loop."""
MEMORY_BATCH = 4096
SCENES = 200
SCENE_STEPS = 20


def measure_speed(name: str, num_envs: int) -> dict[str, float]:
    """Env-steps/s (median of rounds), seconds to the first step, peak memory in MB."""
    package, make = CONTESTANTS[name]
    import_module({"innerattn": "innerattn.envs"}.get(package, package))
    begun = time.perf_counter()
    contestant = make(num_envs, EPISODE)
    random = np.random.default_rng(0).integers(0, ACTIONS, (64, num_envs, AGENTS))
    actions = [contestant.prepare(batch) for batch in random]
    contestant.act(actions[0])
    first_s = time.perf_counter() - begun
    rates = []
    count = 0
    for _ in range(ROUNDS + 1):
        start, before = time.perf_counter(), count
        while time.perf_counter() - start < ROUND_S:
            contestant.act(actions[count % 64])
            count += 1
        rates.append((count - before) * num_envs / (time.perf_counter() - start))
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"rate": statistics.median(rates[1:]), "first_s": first_s, "memory_mb": memory_mb}


def directions(contestant: Contestant) -> Floats:
    """(5, 2) where each action moves an agent at rest, found by trying."""
    at = np.array([[[-0.6, -0.6], [0.6, 0.6], [-0.6, 0.6], [0.6, -0.6]]], dtype=np.float32)
    moved = []
    for action in range(ACTIONS):
        contestant.move(at, np.zeros_like(at))
        for _ in range(3):  # in some packages the first step changes velocities only
            contestant.act(contestant.prepare(np.full((1, AGENTS), action)))
        moved.append((contestant.positions() - at)[0].mean(axis=0))
    return np.array(moved, dtype=np.float32)


def measure_contacts(name: str) -> dict[str, float]:
    """How true contacts are, in many scenes of three plays.

    Head-on: two agents far from the others rush at each other at full speed, hardly off the line.
    Crush: all four press into one point for the whole scene. Of both the deepest overlap of two
    agents is returned, as a share of a radius. Passing: two agents fly past each other with 0.1 to
    0.5 of their reach to spare, while the others press upon each other; returned is the share of
    passes in which one was turned aside.
    """
    contestant = CONTESTANTS[name][1](1, 1_000_000)
    ways = directions(contestant)
    rng = np.random.default_rng(0)
    radii, speed = contestant.radii, contestant.speed
    reach = radii[:, None] + radii[None]
    pairs = np.triu_indices(AGENTS, 1)

    def overlap() -> float:
        at = contestant.positions()[0]
        apart = np.linalg.norm(at[:, None] - at[None], axis=-1)
        deepest = (reach - apart) / np.minimum(radii[:, None], radii[None])
        return float(deepest[pairs].max())

    def steer(goals: Floats) -> None:
        wanted = goals - contestant.positions()[0]
        contestant.act(contestant.prepare(np.argmax(wanted @ ways.T, axis=1)[None]))

    worst = {"head_on": 0.0, "crush": 0.0, "passing": 0.0}
    for _ in range(SCENES):
        off, gap = rng.uniform(-0.1, 0.1) * radii[0], rng.uniform(0.5, 0.8)
        at = np.array([[[-gap / 2, off], [gap / 2, -off], [-0.8, 0.8], [0.8, -0.8]]])
        velocities = np.zeros_like(at)
        velocities[0, 0, 0], velocities[0, 1, 0] = speed, -speed
        contestant.move(at.astype(np.float32), velocities.astype(np.float32))
        goals = at[0].copy()
        goals[[0, 1]] = goals[[1, 0]]
        for _ in range(SCENE_STEPS):
            steer(goals.astype(np.float32))
            worst["head_on"] = max(worst["head_on"], overlap())
        corners = np.array([[-0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [0.5, -0.5]])
        at = (corners + rng.uniform(-0.1, 0.1, (AGENTS, 2)))[None].astype(np.float32)
        contestant.move(at, np.zeros_like(at))
        for _ in range(SCENE_STEPS):
            steer(np.zeros((AGENTS, 2), dtype=np.float32))
            worst["crush"] = max(worst["crush"], overlap())
        half = 0.5 * reach[0, 1] * rng.uniform(1.1, 1.5)
        pressing = 0.5 * reach[2, 3]
        at = np.array(
            [[[-0.15, half], [0.15, -half], [-0.6 - pressing, 0.6], [-0.6 + pressing, 0.6]]]
        )
        contestant.move(at.astype(np.float32), velocities.astype(np.float32))
        stay = int(np.argmin(np.linalg.norm(ways, axis=1)))
        right, left = int(np.argmax(ways[:, 0])), int(np.argmin(ways[:, 0]))
        for _ in range(SCENE_STEPS):
            contestant.act(contestant.prepare(np.array([[stay, stay, right, left]])))
        aside = abs(contestant.positions()[0, :2, 1] - at[0, :2, 1]) > 0.01 * radii[:2]
        worst["passing"] += float(aside.any()) / SCENES
    return worst


def apart(kind: str, name: str, num_envs: int = 1) -> dict[str, float] | None:
    """A measurement in a process of its own; None if it failed."""
    command = [sys.executable, __file__, kind, name, str(num_envs)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        why = [f"its process ended with code {done.returncode}", *done.stderr.strip().splitlines()]
        print(f"{name}, {kind}, {num_envs}: {why[-1]}", file=sys.stderr)
        return None
    result: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return result


def main() -> None:
    """Measure everything and publish the tables."""
    here = {name: installed(package) for name, (package, _) in CONTESTANTS.items()}
    names = [name for name, found in here.items() if found]
    peers = [name for name in names if not name.startswith("innerattn")]
    speeds = {
        (name, batch): apart("speed", name, batch)
        for batch in BATCHES
        for name in names
        if not (name in SINGLE and batch > 32)
    }

    def rate(name: str, batch: int) -> float:
        found = speeds.get((name, batch))
        return found["rate"] if found else float("nan")

    rows = []
    for name in names:
        row = [name if "innerattn" in name else f"{name} {here[name]}"]
        for batch in BATCHES:
            best = max((rate(peer, batch) for peer in peers if rate(peer, batch) > 0), default=0.0)
            own = rate(name, batch)
            ratio = f" ({own / best:.1f}x)" if best and "innerattn" in name else ""
            row.append(f"{own:,.0f}{ratio}" if own > 0 else "")
        rows.append(row)
    speed = table(["env-steps/s at a batch of", *[f"{batch:,}" for batch in BATCHES]], rows)

    rows = []
    for name in names:
        found = speeds.get((name, MEMORY_BATCH)) or speeds.get((name, 32))
        contacts = apart("contacts", name)
        rows.append(
            [
                name if "innerattn" in name else f"{name} {here[name]}",
                *(
                    [f"{found['memory_mb']:,.0f} MB", f"{found['first_s']:.2f} s"]
                    if found
                    else ["", ""]
                ),
                *(
                    [f"{100 * contacts[key]:.1f} %" for key in contacts]
                    if contacts
                    else ["", "", ""]
                ),
            ]
        )
    head = [
        "",
        f"memory, {MEMORY_BATCH:,} worlds",
        "first step",
        "overlap, head-on",
        "overlap, crush",
        "passes turned aside",
    ]
    publish(
        "compare_envs",
        f"{machine('numpy', 'torch')}.\n\n{speed}\n\n"
        "In brackets: times the fastest peer at that batch.\n\n" + table(head, rows),
    )


if __name__ == "__main__":
    if len(sys.argv) == 4:
        kind, name, num_envs = sys.argv[1:]
        found = measure_speed(name, int(num_envs)) if kind == "speed" else measure_contacts(name)
        print(json.dumps(found))
    else:
        main()
