"""Leads of the next partner by hand and against plain loops."""

from itertools import product

import numpy as np
import pytest
from attention_record import record_of

from innerattn.measures.sharing.handoff import HANDOFF
from innerattn.measures.sharing.partner_lead import AFTER, BEFORE, mean_lead, partner_leads

STEPS, HEADS = 25, 2
FIELD = "actor_attention"
OFFSETS = np.arange(-7, 9)


def random_weights(rng: np.random.Generator, episodes: int) -> np.ndarray:
    weights = rng.random((episodes, STEPS, HEADS, 4, 4)) * (1.0 - np.eye(4))
    return weights / weights.sum(-1, keepdims=True)


def random_handoffs(rng: np.random.Generator, episodes: int, first: int) -> np.ndarray:
    rows = []
    for episode, robot in product(range(first, first + episodes), range(4)):
        others = rng.permutation([other for other in range(4) if other != robot])
        steps = np.sort(rng.choice(STEPS, 3, replace=False))
        rows.append((episode, robot, *others[:2], *steps))
    return np.array(rows, HANDOFF)


def test_by_hand() -> None:
    weights = np.zeros((1, STEPS, HEADS, 4, 4))
    weights[..., 0, 1:] = [0.2, 0.3, 0.5]  # on medical_0, robot 3, most
    weights[0, 11:, :, 0, 1:] = [0.1, 0.7, 0.2]
    weights[0, 12:, 1, 0, 1:] = [0.0, 1.0, 0.0]
    events = np.array([(4, 0, 3, 2, 9, 10, 13)], HANDOFF)
    leads = partner_leads(record_of(weights, 4, FIELD), events, OFFSETS, FIELD)
    inside = np.isfinite(leads[0])
    assert OFFSETS[inside].tolist() == [-1, 0, 1, 2, 3]
    np.testing.assert_allclose(leads[0, inside], [-0.2, -0.2, 0.5, 0.75, 0.75], atol=1e-6)
    assert mean_lead(leads, OFFSETS, BEFORE) == pytest.approx(-0.2, abs=1e-6)
    assert mean_lead(leads, OFFSETS, AFTER) == pytest.approx(2.0 / 3.0, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_against_plain_loops(seed: int) -> None:
    rng = np.random.default_rng(seed)
    weights = random_weights(rng, 6)
    record, events = record_of(weights, 9, FIELD), random_handoffs(rng, 6, 9)
    leads = partner_leads(record, events, OFFSETS, FIELD)
    for steps in (BEFORE, AFTER, (5, 6)):
        means = []
        for row, event in enumerate(events):
            own = []
            for place, offset in enumerate(OFFSETS.tolist()):
                step = event["first"] + offset
                if not event["start"] <= step <= event["second"]:
                    assert np.isnan(leads[row, place])
                    continue
                heads = record.steps["actor_attention"][event["episode"] - 9, step, :]
                of_robot = heads[:, event["robot"]].astype(np.float64)
                lead = np.mean([one[event["after"]] - one[event["before"]] for one in of_robot])
                assert leads[row, place] == pytest.approx(lead)
                own += [lead] if offset in steps else []
            means += [np.mean(own)] if own else []
        assert len(means) < len(events) or steps != (5, 6)
        assert mean_lead(leads, OFFSETS, steps) == pytest.approx(np.mean(means))


def test_without_a_step_there_is_no_lead() -> None:
    rng = np.random.default_rng(0)
    events = np.array([(0, 0, 3, 2, 9, 10, 11)], HANDOFF)
    leads = partner_leads(record_of(random_weights(rng, 1), field=FIELD), events, OFFSETS, FIELD)
    assert mean_lead(leads, OFFSETS, (5, 6)) is None
    assert mean_lead(leads[:0], OFFSETS, BEFORE) is None
