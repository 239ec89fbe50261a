"""Shifts of attention against plain loops, and made-up attention whose shift is known."""

import numpy as np
import pytest

from innerattn.measures.faults import shift as attention_shift
from innerattn.measures.faults.shift import (
    PairedRollouts,
    areas_by_head,
    by_head,
    pooled_kinds,
    pooled_robots,
    shift_of,
)
from innerattn.measures.faults.shift_results import CURVE_STEPS, ByHead, Shift
from innerattn.stats import Estimate
from innerattn.stats.bootstrap import resampled_counts


def made_up(
    episodes: int, steps: int, onset: int, seed: int, jump: float = 0.0, robot: int = 1
) -> PairedRollouts:
    """Attention of 4 robots in 2 heads that moves by chance, and by a jump onto the failing robot.

    All who look at it give it `jump` more from the onset on, and their other teammates that much
    less, in equal parts.
    """
    rng = np.random.default_rng(seed)
    others = ~np.eye(4, dtype=bool)

    def weights() -> np.ndarray:
        noise = 0.02 * rng.normal(size=(episodes, steps, 2, 4, 4))
        noise = np.where(others, noise, 0.0)
        return np.where(others, (1.0 - noise.sum(-1, keepdims=True)) / 3 + noise, 0.0)

    healthy, faulty = weights(), weights()
    faulty[:, :onset] = healthy[:, :onset]
    looking = np.arange(4) != robot
    gain = np.where(np.arange(4) == robot, jump, -jump / 2) * others * looking[:, None]
    faulty[:, onset:] += gain
    happened = np.ones((episodes, steps), bool)
    return PairedRollouts(
        robot, onset, faulty.astype(np.float32), healthy.astype(np.float32), happened
    )


def ended(twins: PairedRollouts, seed: int) -> PairedRollouts:
    """The same with episodes that end at some time after the onset, and nonsense from then on."""
    episodes, steps = twins.happened.shape
    lengths = np.random.default_rng(seed).integers(twins.onset + 1, steps + 1, episodes)
    happened = np.arange(steps) < lengths[:, None]
    faulty, healthy = twins.faulty.copy(), twins.healthy.copy()
    faulty[~happened], healthy[~happened] = 7.0, np.nan
    return twins._replace(faulty=faulty, healthy=healthy, happened=happened)


def measured(twins: PairedRollouts, seed: int = 0) -> Shift:
    return shift_of("r", 0.5, twins, resampled_counts(len(twins.faulty), seed), seed)


def plain_means(
    twins: PairedRollouts, faulty: bool, first: int, last: int, heads: list[int]
) -> list[float]:
    """By episode, the mean weight on the failing robot over steps and the robots that look."""
    weights = twins.faulty if faulty else twins.healthy
    means = []
    for e in range(len(weights)):
        found = []
        for t in range(first, last):
            if twins.happened[e, t]:
                for h in heads:
                    for i in range(4):
                        if i != twins.robot:
                            found.append(float(weights[e, t, h, i, twins.robot]))
        means.append(np.mean(found))
    return means


@pytest.mark.parametrize(("steps", "onset"), [(8, 4), (9, 4), (7, 4)])
def test_against_plain_loops(steps: int, onset: int) -> None:
    twins = ended(made_up(6, steps, onset, seed=0, jump=0.1), seed=1)
    width = min(onset, steps - onset)
    found = measured(twins)
    for heads, pick in (([0, 1], -1), ([0], 0), ([1], 1)):

        def of(figure: ByHead, pick: int = pick) -> Estimate:
            return figure.mean if pick < 0 else figure.heads[pick]

        before = plain_means(twins, True, onset - width, onset, heads)
        after = plain_means(twins, True, onset, onset + width, heads)
        without = plain_means(twins, False, onset, onset + width, heads)
        assert of(found.before).mean == pytest.approx(np.mean(before))
        assert of(found.after).mean == pytest.approx(np.mean(after))
        assert of(found.change).mean == pytest.approx(np.subtract(after, before).mean())
        assert of(found.effect).mean == pytest.approx(np.subtract(after, without).mean())
        draws = resampled_counts(6, 0) / 6
        for figure, values in ((found.after, after), (found.effect, np.subtract(after, without))):
            low, high = np.percentile(draws @ values, (2.5, 97.5))
            assert (of(figure).low, of(figure).high) == pytest.approx((low, high))


def test_changed_rows_against_plain_loops() -> None:
    twins = ended(made_up(3, 6, 3, seed=0, jump=0.1), seed=1)
    rows = twins.changed_rows()
    for e in range(3):
        for i in range(4):
            for k in range(4):
                moved = [
                    float(twins.faulty[e, t, h, i, k]) - float(twins.healthy[e, t, h, i, k])
                    for t in range(3, 6)
                    for h in range(2)
                    if twins.happened[e, t]
                ]
                assert rows[e, i, k] == pytest.approx(np.mean(moved), abs=1e-12)
    assert not twins.happened.all()


def test_curves_against_plain_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attention_shift, "CURVE_STEPS", 3)
    twins = ended(made_up(5, 10, 5, seed=3, jump=0.1), seed=5)
    last = int(twins.happened.sum(1).max())
    twins.happened[:, 7] = False  # nothing happens so late
    found = measured(twins)
    assert len(found.curve) == len(found.effect_curve) == 6
    assert last > 7
    for index, t in enumerate(range(2, 8)):
        step, moved = found.curve[index], found.effect_curve[index]
        goes_on = [e for e in range(5) if twins.happened[e, t]]
        if not goes_on:
            assert step is moved is None
            continue
        assert step is not None
        assert moved is not None
        part = PairedRollouts(
            twins.robot, t, twins.faulty[goes_on], twins.healthy[goes_on], twins.happened[goes_on]
        )
        values = plain_means(part, True, t, t + 1, [0, 1])
        without = plain_means(part, False, t, t + 1, [0, 1])
        assert step.mean == pytest.approx(np.mean(values))
        assert step.low <= step.mean <= step.high
        assert moved.mean == pytest.approx(np.subtract(values, without).mean())
        if t < 5:
            assert (moved.mean, moved.low, moved.high) == (0.0, 0.0, 0.0)
    assert found.curve[-1] is None


def test_a_jump_is_recovered() -> None:
    found = measured(made_up(40, 20, 10, seed=1, jump=0.2))
    for figure in (found.change, found.effect):
        for interval in (figure.mean, *figure.heads):
            assert interval.mean == pytest.approx(0.2, abs=0.005)
            assert interval.low < interval.mean < interval.high
    assert found.before.mean.mean == pytest.approx(1 / 3, abs=0.005)
    assert found.after.mean.mean == pytest.approx(1 / 3 + 0.2, abs=0.005)
    assert len(found.curve) == 2 * CURVE_STEPS
    steps = [interval.mean for interval in found.effect_curve if interval is not None]
    assert steps[:CURVE_STEPS] == [0.0] * CURVE_STEPS
    assert steps[CURVE_STEPS:] == pytest.approx([0.2] * CURVE_STEPS, abs=0.01)
    assert found.p_value == 2 / 5000
    assert found.shuffled.low < 0.0 < found.shuffled.high < 0.2
    assert (found.auc.mean, found.auc.low, found.auc.high) == (1.0, 1.0, 1.0)


def test_attention_that_turns_away_has_an_area_of_zero() -> None:
    found = measured(made_up(20, 8, 4, seed=1, jump=-0.2))
    assert found.effect.mean.high < -0.19
    assert (found.auc.mean, found.p_value) == (0.0, 2 / 5000)


def test_no_effect() -> None:
    found = measured(made_up(60, 20, 10, seed=0))
    for interval in (found.effect.mean, found.change.mean):
        assert interval.low < 0.0 < interval.high
        assert abs(interval.mean) < 0.002
    assert found.p_value > 0.1
    assert found.auc.low < 0.5 < found.auc.high
    assert found.auc.mean == pytest.approx(0.5, abs=0.03)


def test_a_change_with_time_is_no_effect() -> None:
    twins = made_up(20, 8, 4, seed=2)
    for weights in (twins.faulty, twins.healthy):
        weights[:, 4:, :, :, 1] += np.float32(0.2)
    found = measured(twins)
    assert found.change.mean.low > 0.15
    assert found.effect.mean.low < 0.0 < found.effect.mean.high


def test_even_weights_do_not_move_at_all() -> None:
    even = np.broadcast_to((1 - np.eye(4)) / 3, (7, 10, 2, 4, 4)).astype(np.float32)
    found = measured(PairedRollouts(0, 5, even, even, np.ones((7, 10), bool)))
    third = float(np.float32(1 / 3))
    for interval in (found.before.mean, found.after.mean, *found.curve):
        assert interval == Estimate(third, third, third)
    for interval in (found.change.mean, found.effect.mean, *found.effect.heads, found.shuffled):
        assert interval == Estimate(0.0, 0.0, 0.0)
    assert found.p_value == 1.0
    assert found.auc == Estimate(0.5, 0.5, 0.5)


def test_robots_and_kinds_together() -> None:
    draws = resampled_counts(12, 0)
    usual = [made_up(12, 8, 4, seed, jump, robot) for seed, jump, robot in ((0, 0.2, 0), (1, 0, 2))]
    parts = [twins.received() for twins in usual]
    pooled = pooled_robots(parts)
    one, other = (part.effects() for part in parts)
    np.testing.assert_allclose(pooled.effects, (one + other) / 2)
    assert by_head(pooled.effects, draws).mean.mean == pytest.approx(0.1, abs=0.01)
    positive = np.concatenate([part.faulty[:, 4:, 0] for part in parts], 1).ravel()
    negative = np.concatenate([part.healthy[:, 4:, 0] for part in parts], 1).ravel()
    plain = np.mean(positive[:, None] > negative)
    assert areas_by_head(pooled.comparison, draws).mean.mean == pytest.approx(plain)
    same = pooled_kinds([pooled, pooled])
    np.testing.assert_allclose(same.effects, pooled.effects)
    assert areas_by_head(same.comparison, draws) == areas_by_head(pooled.comparison, draws)


def test_seeds() -> None:
    twins = made_up(10, 8, 4, seed=0, jump=0.01)
    assert measured(twins, seed=1) == measured(twins, seed=1)
    assert measured(twins, seed=1) != measured(twins, seed=2)


def test_two_robots_are_refused() -> None:
    weights = np.broadcast_to(1 - np.eye(2), (3, 4, 1, 2, 2)).astype(np.float32)
    with pytest.raises(ValueError, match="2 robots"):
        measured(PairedRollouts(0, 2, weights, weights, np.ones((3, 4), bool)))
