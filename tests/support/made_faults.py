"""What `innerattn robustness` finds, made up: random rescues, bounds and shifts of attention."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from innerattn.config import Scenario
from innerattn.evaluate.bounds.results import Bounds, Check, Level, ValueChange
from innerattn.evaluate.faults.grid import Grid, RescueCounts, retention_of
from innerattn.evaluate.robustness import SCRIPTS, Robustness
from innerattn.measures.faults.shift_results import ByHead, FaultAttention, KindShift, Shift
from innerattn.stats import Estimate

STEPS = 8


def made_robustness(
    methods: Sequence[str], scenario: Scenario, kinds: tuple[str, ...], seed: int
) -> Robustness:
    """Runs of these methods, named by their place and method, and the scripts."""
    rng = np.random.default_rng(seed)
    worlds = scenario.replace(episode_steps=STEPS, faults=())
    grid = Grid(worlds, kinds=kinds, episodes=12, seed=seed)
    runs = {f"run{place}-{method}": method for place, method in enumerate(methods)}
    return Robustness(
        grid=grid,
        retention={name: retention_of(_counts(grid, rng), grid) for name in (*runs, *SCRIPTS)},
        methods=runs,
        bounds={name: _bounds(rng, method) for name, method in runs.items()},
        attention={
            name: _attention(rng, grid) for name, method in runs.items() if method.endswith("inner")
        },
    )


def made_document(*arguments: Any) -> dict[str, Any]:
    """The document of `made_robustness`."""
    return made_robustness(*arguments).to_json()


def _counts(grid: Grid, rng: np.random.Generator) -> RescueCounts:
    shape = (grid.episodes, grid.scenario.episode_steps)
    clean = rng.poisson(1.0, shape)
    faulty = rng.poisson(rng.uniform(0.2, 1.2), (*grid.shape, *shape))
    return RescueCounts(clean, faulty.astype(np.int16))


def _bounds(rng: np.random.Generator, method: str) -> Bounds:
    inner = method.endswith("inner")
    directions = ("random", "gradient", "gradient_own") if inner else ("random",)
    return Bounds(
        attention="inner" if inner else "uniform",
        seed=0,
        states=4,
        draws=2,
        query_norms=(1.0,),
        key_norms=(1.0,),
        embedding_norms=(1.0,),
        observation_norms=(1.0,),
        value_standard_deviation=1.0,
        levels=tuple(
            _level(rng, direction, radius, inner)
            for direction in directions
            for radius in (0.1, 1.0)
        ),
    )


def _level(rng: np.random.Generator, direction: Any, radius: float, inner: bool) -> Level:
    own = direction == "gradient_own"

    def check() -> Check:
        return Check(int(rng.integers(10, 99)), int(rng.integers(3)), *rng.random(4).tolist())

    checks = {"own_logit": check()} if own else {"logit": check(), "weight": check()}
    values = ValueChange(*rng.random(2).tolist(), flips=None)
    return Level(
        changed="observation",
        direction=direction,
        radius=radius,
        checks=checks if inner else {},
        largest_weight_change=None,
        teammates=None if own else values,
        own=None,
        actor_flips=None if own else float(rng.random()),
    )


def _attention(rng: np.random.Generator, grid: Grid) -> FaultAttention:
    def estimate() -> Estimate:
        mean = float(rng.normal())
        return Estimate(mean, mean - 0.1, mean + 0.2)

    def by_head() -> ByHead:
        return ByHead(estimate(), (estimate(),))

    def shift(robot: str) -> Shift:
        parts = (by_head() for _ in range(4))
        return Shift(robot, 1.0, *parts, (None,), (estimate(),), estimate(), 0.5, estimate())

    robots = [robot.name for robot in grid.scenario.robots]
    return FaultAttention(
        attention="inner",
        seed=0,
        episodes=grid.episodes,
        counted=grid.episodes,
        episode_steps=STEPS,
        onset_step=grid.middle,
        shuffles=9,
        even_share=1.0 / 3.0,
        effect=by_head(),
        auc=by_head(),
        kinds=tuple(
            KindShift(kind, by_head(), by_head(), tuple(map(shift, robots))) for kind in grid.kinds
        ),
    )
