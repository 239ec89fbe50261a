"""Shares and ratios over events that come in episodes, with intervals; it knows no event.

Events within an episode depend on each other, episodes do not, so the variance is that between
episodes. A percentile bootstrap over episodes agrees where there are many; with few, or near a
share of 0 or 1, its intervals miss the truth far more often than their level says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.stats.estimate import Estimate
from innerattn.stats.student import t_cdf, t_quantile


@dataclass(frozen=True)
class ClusteredShare:
    """A share of events that come in episodes.

    Its interval is Wilson's, with the number of events replaced by the effective one, which is the
    number of independent events of the same variance, and the normal quantile replaced by Student's
    (Franco, Little, Louis & Slud 2019, J. Surv. Stat. Methodol. 7, 334-364). With p the share and n
    that number it contains every q with ``|p - q| <= t sqrt(q (1 - q) / n)``.

    Attributes:
        share: p in [0, 1].
        effective_events: n.
        episodes: episodes with events, k; t has k - 1 degrees of freedom.
    """

    share: float
    effective_events: float
    episodes: int

    def estimate(self, level: float = 0.95) -> Estimate:
        """The share and its two-sided interval; [0, 1] from a single episode."""
        if self.episodes < 2:
            return Estimate(self.share, 0.0, 1.0)
        p, n = self.share, self.effective_events
        t = float(t_quantile(0.5 + level / 2.0, self.episodes - 1))
        centre = (p + t * t / (2.0 * n)) / (1.0 + t * t / n)
        half = t / (1.0 + t * t / n) * math.sqrt(p * (1.0 - p) / n + t * t / (4.0 * n * n))
        # It contains p and lies in [0, 1]; rounding alone could say otherwise.
        return Estimate(p, min(max(centre - half, 0.0), p), max(min(centre + half, 1.0), p))

    def p_above(self, bound: float) -> float:
        """The p-value against "the share is at most ``bound``", which is in (0, 1).

        It is below (1 - level) / 2 exactly where the interval lies above ``bound``.
        """
        return self._p(self.share - bound, bound)

    def p_below(self, bound: float) -> float:
        """The p-value against "the share is at least ``bound``", which is in (0, 1)."""
        return self._p(bound - self.share, bound)

    def _p(self, excess: float, bound: float) -> float:
        if self.episodes < 2:
            return 1.0
        standard_error = math.sqrt(bound * (1.0 - bound) / self.effective_events)
        return float(t_cdf(-excess / standard_error, self.episodes - 1))


def share_of(hits: ArrayLike, events: ArrayLike) -> ClusteredShare | None:
    """The share of events that are hits, over episodes.

    With x hits of n events in an episode, X of N in all and k episodes with events, the variance of
    X / N is ``k / (k - 1) sum (x - n X / N)² / N²`` (the linearised one of a ratio), and the
    effective number of events is that of independent events with this variance. Where all episodes
    have the same share the variance is 0, and every episode counts as one event.

    Args:
        hits: (E,) integers, hits by episode.
        events: (E,) integers, events by episode, at least as many.

    Returns:
        The share; None where there are no events.

    Raises:
        ValueError: the numbers are not counts of this shape, or there are more hits than events.
    """
    x, n = (_counts(name, values) for name, values in (("hits", hits), ("events", events)))
    if x.shape != n.shape:
        raise ValueError(f"hits of {len(x)} episodes, events of {len(n)}: must be as many")
    if (x > n).any():
        e = int(np.argmax(x > n))
        raise ValueError(f"hits {x[e]} of {n[e]} events in episode {e}: must be no more")
    total, k = int(n.sum()), int((n > 0).sum())
    if total == 0:
        return None
    share = float(x.sum() / total)
    scatter = (x * total - n * x.sum()).astype(np.float64) / total  # exactly 0 where shares agree
    squares = float(scatter @ scatter)
    if k < 2 or squares == 0.0:
        return ClusteredShare(share, float(k), k)
    variance = k / (k - 1) * squares / total**2
    return ClusteredShare(share, share * (1.0 - share) / variance, k)


def share_interval(hits: ArrayLike, events: ArrayLike) -> Estimate | None:
    """The share of events that are hits and its 95 % interval; see `share_of`."""
    share = share_of(hits, events)
    return None if share is None else share.estimate()


def ratio_intervals(
    sums: NDArray[np.float64], events: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Means over events and their 95 % intervals, by Student's t over episodes.

    ``X / N ± t sqrt(k / (k - 1) sum (x - n X / N)²) / N`` with k - 1 degrees of freedom; x is an
    episode's sum, n its events, and k counts the episodes with events.

    Args:
        sums: (E, ...) sums over the events of each episode.
        events: (E, ...) their numbers; it is broadcast to the shape of ``sums``.

    Returns:
        Means, low and high ends, (...) each; NaN means where there are no events, NaN ends where
        less than two episodes have any.
    """
    counts = np.broadcast_to(events, sums.shape)
    total, k = counts.sum(0), (counts > 0).sum(0)
    mean = np.where(total > 0, sums.sum(0) / np.maximum(total, 1), np.nan)
    squares = ((sums - counts * mean) ** 2).sum(0)
    spread = np.sqrt(k / np.maximum(k - 1, 1) * squares) / np.maximum(total, 1)
    half = np.where(k > 1, t_quantile(0.975, np.maximum(k - 1, 1)) * spread, np.nan)
    return mean, mean - half, mean + half


def ratio_interval(sums: ArrayLike, events: ArrayLike) -> Estimate | None:
    """One mean over events, see `ratio_intervals`; None below two episodes with events."""
    ends = ratio_intervals(np.asarray(sums, np.float64), np.asarray(events, np.float64))
    mean, low, high = map(float, ends)
    return None if math.isnan(low) else Estimate(mean, low, high)


def _counts(name: str, values: ArrayLike) -> NDArray[np.int64]:
    counts = np.asarray(values)
    if counts.ndim != 1 or counts.dtype.kind not in "iu" or (counts < 0).any():
        raise ValueError(
            f"{name} of shape {counts.shape}, dtype {counts.dtype}: must be (E,) whole numbers, "
            "0 or more"
        )
    return counts.astype(np.int64)
