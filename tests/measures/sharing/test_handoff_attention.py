"""Attention around handoffs by hand, against plain loops, and how often it finds what is not."""

from itertools import product

import numpy as np
import pytest
from attention_record import record_of
from scipy.stats import t as student

from innerattn.config import Scenario
from innerattn.evaluate.play import run_episodes
from innerattn.measures.sharing import handoff_attention as module
from innerattn.measures.sharing.handoff import HANDOFF, handoffs
from innerattn.measures.sharing.handoff_attention import aligned_weights, handoff_attention
from innerattn.policies import scripted_policy
from innerattn.records.record import Record

STEPS, HEADS = 25, 2


def drifting(rng: np.random.Generator, episodes: int) -> np.ndarray:
    """Weights (E, T, H, R, R) that know nothing of rescues but change slowly."""
    scores = rng.normal(size=(episodes, STEPS, HEADS, 4, 4))
    for t in range(1, STEPS):
        scores[:, t] = 0.8 * scores[:, t - 1] + 0.6 * scores[:, t]
    weights = np.exp(scores) * (1 - np.eye(4))
    return weights / weights.sum(-1, keepdims=True)


def random_handoffs(rng: np.random.Generator, episodes: int) -> np.ndarray:
    """Handoffs to and fro by both food robots; those of a robot share the stage between them."""
    rows = []
    for episode, robot in product(range(episodes), (0, 1)):
        steps = np.sort(rng.choice(STEPS, rng.integers(2, 5), replace=False))
        turn = rng.integers(2)
        for j in range(len(steps) - 1):
            partners = (3, 2) if (j + turn) % 2 else (2, 3)
            start = 0 if j == 0 else steps[j - 1] + 1
            rows.append((episode, robot, *partners, start, steps[j], steps[j + 1]))
    return np.array(rows, HANDOFF)


def test_by_hand() -> None:
    weights = np.full((2, STEPS, HEADS, 4, 4), 0.0)
    weights[..., 0, 1:] = [0.2, 0.2, 0.6]
    weights[0, 3:, :, 0, 1:] = [0.2, 0.6, 0.2]  # passes from medical_0 to navigation_0 after step 2
    weights[1, 6:, 0, 0, 1:] = [0.2, 0.5, 0.3]  # here in one head only
    weights[0, 7:] = weights[1, 9:] = np.nan  # after the second rescue
    events = np.array([(5, 0, 3, 2, 0, 2, 6), (6, 0, 3, 2, 0, 5, 8)], HANDOFF)
    found = handoff_attention(record_of(weights, 5), events, seed=0, reach=4)
    assert found is not None
    assert (found.handoffs, found.episodes) == (2, 2)
    assert found.offsets.tolist() == [-3, -2, -1, 0, 1, 2, 3, 4]
    assert found.counts.tolist() == [1, 2, 2, 2, 2, 2, 2, 1]
    mean = found.to_be.weight[0]
    np.testing.assert_allclose(mean[:4], 0.2, atol=1e-7)
    np.testing.assert_allclose(mean[4], [(0.6 + 0.35) / 2, (0.6 + 0.5) / 2, 0.4], atol=1e-7)
    np.testing.assert_allclose(mean[7], 0.6, atol=1e-7)
    assert np.isnan(found.to_be.weight[1:, [0, 7]]).all()  # one episode has no interval
    np.testing.assert_allclose(
        found.to_be.change[0], [(0.4 + 0.15) / 2, (0.4 + 0.3) / 2, (0.4 + 0.0) / 2], atol=1e-7
    )
    half = student.ppf(0.975, 1) * 0.05  # of 0.4 and 0.3
    np.testing.assert_allclose(found.to_be.change[1:, 1], [0.35 - half, 0.35 + half], atol=1e-6)
    np.testing.assert_allclose(found.before.change[0], [-0.275, -0.35, -0.2], atol=1e-7)


def test_alignment_against_a_plain_loop() -> None:
    rng = np.random.default_rng(0)
    record, events = record_of(drifting(rng, 4)), random_handoffs(rng, 4)
    offsets = np.arange(-5, 7)
    weights, inside = aligned_weights(record, events, offsets)
    assert weights.shape == (len(events), 12, 1 + HEADS, 3)
    attention = record.steps["attention"]
    for i, event in enumerate(events):
        teammates = [j for j in range(4) if j != event["robot"]]
        for w, offset in enumerate(offsets):
            step = event["first"] + offset
            assert inside[i, w] == (event["start"] <= step <= event["second"])
            if not inside[i, w]:
                assert np.isnan(weights[i, w]).all()
                continue
            for m, teammate in enumerate(teammates):
                heads = attention[event["episode"], step, :, event["robot"], teammate]
                np.testing.assert_allclose(weights[i, w, 1:, m], heads)
                assert weights[i, w, 0, m] == pytest.approx(heads.mean())


def changes_of(record: Record, event: np.void, teammate: int, reach: int) -> float:
    """Change of the mean weight over heads on a teammate, in a plain loop."""
    before, after = [], []
    for step in range(event["start"], event["second"] + 1):
        weight = record.steps["attention"][event["episode"], step, :, event["robot"], teammate]
        if event["first"] - reach < step <= event["first"]:
            before.append(weight.mean(dtype=np.float64))
        elif event["first"] < step <= event["first"] + reach:
            after.append(weight.mean(dtype=np.float64))
    return float(np.mean(after) - np.mean(before))


def test_permutation_test_against_all_exchanges() -> None:
    rng = np.random.default_rng(2)
    record, events = record_of(drifting(rng, 6)), random_handoffs(rng, 6)
    found = handoff_attention(record, events, seed=0, reach=6)
    assert found is not None
    on_next, on_last = (
        np.array([changes_of(record, event, event[role], 6) for event in events])
        for role in ("after", "before")
    )
    assert found.to_be.change[0, 0] == pytest.approx(on_next.mean(), abs=1e-6)
    assert found.before.change[0, 0] == pytest.approx(on_last.mean(), abs=1e-6)

    def total(exchanged: tuple[bool, ...]) -> float:
        turned = np.array(exchanged)[events["episode"]]
        after = np.where(turned, on_last, on_next)
        before = np.where(turned, on_next, on_last)
        return float((after - before).mean())

    every = [total(exchanged) for exchanged in product((False, True), repeat=6)]
    exact = np.mean(np.abs(every) >= abs(every[0]) - 1e-9)
    assert found.p == pytest.approx(exact, abs=0.02)


def test_attention_that_passes_to_both_partners_alike_knows_nothing_of_them() -> None:
    rng = np.random.default_rng(7)
    weights, events = 0.1 * drifting(rng, 30), random_handoffs(rng, 30)
    for event in events:  # from the other food robot to both partners, whichever is next
        stage = slice(event["first"] + 1, event["second"] + 1)
        weights[event["episode"], stage, :, event["robot"], 2:] += 0.3
    found = handoff_attention(record_of(weights), events, seed=0)
    assert found is not None
    assert np.all(found.to_be.change[1] > 0.1)
    assert found.p > 0.05


def test_attention_that_passes_on_is_found() -> None:
    rng = np.random.default_rng(3)
    weights, events = drifting(rng, 12), random_handoffs(rng, 12)
    for event in events:
        stage = slice(event["first"] + 1, event["second"] + 1)
        rows = weights[event["episode"], stage, :, event["robot"]]
        rows *= 0.5
        rows[..., event["after"]] += 0.5
    found = handoff_attention(record_of(weights), events, seed=0)
    assert found is not None
    assert 0.0 < found.p < 0.001
    assert np.all(found.to_be.change[1] > 0.1)


@pytest.mark.long
@pytest.mark.parametrize("episodes", [8, 15])
def test_chance_is_found_as_rarely_as_it_says(
    episodes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_PERMUTATIONS", 199)
    draws = 500
    rng, rejected, missed = np.random.default_rng(4), 0, 0
    for seed in range(draws):
        record, events = record_of(drifting(rng, episodes)), random_handoffs(rng, episodes)
        found = handoff_attention(record, events, seed)
        assert found is not None
        rejected += found.p <= 0.05
        _, low, high = found.to_be.change[:, 0]
        missed += not low <= 0.0 <= high
    error = 3 * np.sqrt(0.05 * 0.95 / draws)
    assert rejected / draws == pytest.approx(0.05, abs=error)
    assert missed / draws == pytest.approx(0.05, abs=error)


def test_nothing_to_look_at() -> None:
    record = record_of(drifting(np.random.default_rng(0), 1))
    assert handoff_attention(record, np.zeros(0, HANDOFF), 0) is None
    scenario = Scenario.preset("double")
    plain = run_episodes(scripted_policy("hungarian", scenario), scenario, 20, 0)
    events = handoffs(plain, "food_0", "task_1", "task_2")
    assert len(events) > 0
    assert handoff_attention(plain, events, 0) is None
    with pytest.raises(ValueError, match="reach = 0"):
        handoff_attention(record, events, 0, reach=0)
    with pytest.raises(ValueError, match="itself"):
        handoff_attention(record, np.zeros(1, HANDOFF), 0)


def test_a_robot_that_takes_no_part_is_a_control() -> None:
    rng = np.random.default_rng(6)
    weights, events = drifting(rng, 12), random_handoffs(rng, 12)
    events = events[events["robot"] == 0]
    for event in events:
        weights[event["episode"], event["first"] + 1 : event["second"] + 1, :, 0] = np.eye(4)[
            event["after"]
        ]
    control = events.copy()
    control["robot"] = 1
    found, of_other = (handoff_attention(record_of(weights), x, 0) for x in (events, control))
    assert found is not None
    assert of_other is not None
    assert found.p < 0.001
    assert of_other.p > 0.05


def test_a_single_episode_has_no_interval_and_seeds_fix_p() -> None:
    rng = np.random.default_rng(5)
    record, events = record_of(drifting(rng, 3)), random_handoffs(rng, 3)
    alone = handoff_attention(record, events[events["episode"] == 0], 0)
    assert alone is not None
    assert np.isnan(alone.to_be.change[1:]).all()
    one, other = (handoff_attention(record, events, 7) for _ in range(2))
    assert one is not None
    assert other is not None
    assert one.p == other.p
    assert alone.p == 1.0


def test_one_teammate_has_nothing_to_move_between() -> None:
    weights = np.zeros((2, STEPS, HEADS, 2, 2))
    weights[..., 0, 1] = weights[..., 1, 0] = 1.0
    events = np.array([(0, 0, 1, 1, 0, 2, 6), (1, 0, 1, 1, 0, 5, 8)], HANDOFF)
    found = handoff_attention(record_of(weights), events, 0)
    assert found is not None
    assert found.p == 1.0
    np.testing.assert_array_equal(found.to_be.change, 0.0)
