"""Where attention goes when a robot fails, from recorded weights. It plays nothing.

Everything is about the weight that the failing robot gets from its teammates, around the onset of
its fault and in the same worlds without the fault.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from innerattn.measures.faults.label_shuffle import shuffled_labels
from innerattn.measures.faults.shift_results import CURVE_STEPS, ByHead, Shift
from innerattn.stats import Estimate
from innerattn.stats.auc import Comparison, areas, compare
from innerattn.stats.bootstrap import percentile_interval


class PairedRollouts(NamedTuple):
    """Attention in the same worlds with one robot's fault and without.

    Attributes:
        robot: the failing robot j.
        onset: the step at which it begins to be faulty; the window is as many steps before and
            from it on as an episode has on both sides.
        faulty: (E, T, H, R, R) float32 weights in the worlds with the fault.
        healthy: (E, T, H, R, R) float32 weights in the worlds without.
        happened: (E, T) bool, steps before the end of the episode in both; that of the onset in
            every episode.
    """

    robot: int
    onset: int
    faulty: NDArray[np.float32]
    healthy: NDArray[np.float32]
    happened: NDArray[np.bool_]

    @property
    def width(self) -> int:
        """Steps w of the window on each side."""
        return min(self.onset, int(self.happened.shape[1]) - self.onset)

    def received(self) -> Received:
        """The weight that the failing robot gets."""
        steps = slice(self.onset - self.width, self.onset + self.width)
        happened = self.happened[:, steps]
        return Received(
            *(
                _received(weights[:, steps], self.robot, happened)
                for weights in (self.faulty, self.healthy)
            )
        )

    def changed_rows(self) -> NDArray[np.float64]:
        """(E, R, R) float64 effect on each weight, a mean over heads and steps since the onset."""
        steps = slice(self.onset, self.onset + self.width)
        happened = self.happened[:, steps]
        moved = self.faulty[:, steps].astype(np.float64) - self.healthy[:, steps]
        moved[~happened] = 0.0
        rows: NDArray[np.float64] = moved.mean(2).sum(1) / happened.sum(1)[:, None, None]
        return rows


class Received(NamedTuple):
    """Weight that the failing robot gets, averaged over its teammates, in the window.

    Attributes:
        faulty: (E, 2 w, 1 + H) float64, with the fault: averaged over heads, then head by head;
            NaN after the end of an episode.
        healthy: (E, 2 w, 1 + H) float64, without.
    """

    faulty: NDArray[np.float64]
    healthy: NDArray[np.float64]

    def after(self) -> Received:
        """The steps from the onset on."""
        middle = self.faulty.shape[1] // 2
        return Received(self.faulty[:, middle:], self.healthy[:, middle:])

    def effects(self) -> NDArray[np.float64]:
        """(E, 1 + H) float64 mean over the steps from the onset on, with minus without."""
        after = self.after()
        effects: NDArray[np.float64] = np.nanmean(after.faulty - after.healthy, 1)
        return effects


class Pooled(NamedTuple):
    """The effects of several faults, in the same worlds.

    Attributes:
        effects: (E, 1 + H) float64, averaged over the faults.
        comparison: of 1 + H scores.
    """

    effects: NDArray[np.float64]
    comparison: Comparison


def shift_of(
    robot: str, value: float, rollouts: PairedRollouts, draws: NDArray[np.float64], seed: int
) -> Shift:
    """The effect of one robot's fault.

    Args:
        robot: its name.
        value: of the fault.
        rollouts: weights with the fault and without, of R >= 3 robots.
        draws: (S, E) how often each episode is in each resample.
        seed: of the shuffled labels.

    Raises:
        ValueError: there are fewer than three robots.
    """
    received = rollouts.received()
    middle = rollouts.width
    before = np.nanmean(received.faulty[:, :middle], 1)
    after = np.nanmean(received.faulty[:, middle:], 1)
    steps = min(CURVE_STEPS, middle)
    near = slice(middle - steps, middle + steps)
    moved = received.faulty - received.healthy
    shuffled, p_value = shuffled_labels(rollouts.changed_rows(), rollouts.robot, seed)
    return Shift(
        robot=robot,
        value=value,
        before=by_head(before, draws),
        after=by_head(after, draws),
        change=by_head(after - before, draws),
        effect=by_head(received.effects(), draws),
        curve=_curve(received.faulty[:, near, 0], draws),
        effect_curve=_curve(moved[:, near, 0], draws),
        shuffled=shuffled,
        p_value=p_value,
        auc=areas(compare(*(part[..., :1] for part in received.after())), draws)[0],
    )


def pooled_robots(parts: Sequence[Received]) -> Pooled:
    """One kind of fault, over the robots that had it: all of them with all, with one threshold."""
    effects = np.mean([part.effects() for part in parts], 0)
    after = zip(*(part.after() for part in parts), strict=True)
    return Pooled(effects, compare(*(np.concatenate(side, 1) for side in after)))


def pooled_kinds(parts: Sequence[Pooled]) -> Pooled:
    """Several kinds of fault; pairs are of the same kind."""
    comparison = parts[0].comparison
    for part in parts[1:]:
        comparison = comparison.plus(part.comparison)
    return Pooled(np.mean([part.effects for part in parts], 0), comparison)


def by_head(columns: NDArray[np.float64], draws: NDArray[np.float64]) -> ByHead:
    """Means over episodes of values (E, 1 + H): averaged over heads, then head by head."""
    mean, *heads = (_mean(column, draws) for column in columns.T)
    return ByHead(mean, tuple(heads))


def areas_by_head(comparison: Comparison, draws: NDArray[np.float64]) -> ByHead:
    """Areas under the ROC curves of 1 + H scores: averaged over heads, then head by head."""
    mean, *heads = areas(comparison, draws)
    return ByHead(mean, tuple(heads))


def _received(
    weights: NDArray[np.float32], robot: int, happened: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(E, t, 1 + H) from weights (E, t, H, R, R); see `Received`."""
    of_heads = np.delete(weights[..., robot], robot, axis=3).mean(3, dtype=np.float64)
    columns = np.concatenate([of_heads.mean(2, keepdims=True), of_heads], 2)
    columns[~happened] = np.nan
    return columns


def _curve(values: NDArray[np.float64], draws: NDArray[np.float64]) -> tuple[Estimate | None, ...]:
    """The mean over the episodes that go on, step by step of (E, t); None where none does."""
    return tuple(None if np.isnan(step).all() else _mean(step, draws) for step in values.T)


def _mean(values: NDArray[np.float64], draws: NDArray[np.float64]) -> Estimate:
    """The mean over episodes (E,), NaN left out; so are resamples without any other value."""
    defined = ~np.isnan(values)
    counts = draws[:, defined].sum(1)
    sums = draws[:, defined] @ values[defined]
    drawn = counts > 0
    return percentile_interval(values[defined].mean(), sums[drawn] / counts[drawn])
