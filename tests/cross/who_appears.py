"""Checks of the victims that appear in a step, whoever draws them."""

from __future__ import annotations

import numpy as np
from stepper import State, Stepper

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

EXACT = 1e-6


def check_victims(
    plain: Stepper,
    env: BatchEnv,
    before: State,
    after: State,
    gone: np.ndarray,
    given: np.ndarray,
) -> int:
    """Checks who is there after a step in which the victims of `gone` (E, V) were rescued or lost.

    Before it, `given` (E,) victims had appeared in the episode. Returns how many are new.
    """
    scenario = env.scenario
    old, new = before.victims, after.victims
    stays = old["present"] & ~gone
    for name in ("id", "task", "appeared_step", "x", "y", "deadline_step"):
        if name in new.dtype.names:
            assert (new[name][stays] == old[name][stays]).all()
    empty = ~stays.any(1) if scenario.situation == "mixed" else (~stays).any(1)
    assert (new["present"][~empty] == stays[~empty]).all()
    fresh = new["present"] & ~stays
    if scenario.has_arrivals:
        check_arrivals(plain, env, new, stays, env.turned_away())
    elif scenario.situation == "mixed":
        size = new["present"][empty].sum(1)
        assert (size >= 1).all()
        assert (new["present"][empty] == (np.arange(new.shape[1]) < size[:, None])).all()
    else:
        assert new["present"].all()
    if scenario.situation == "double":
        assert (new["task"] == np.arange(len(scenario.tasks))).all()
    assert np.isin(new["task"][new["present"]], np.arange(len(scenario.tasks))).all()
    envs = np.nonzero(fresh)[0]
    assert (new["appeared_step"][fresh] == env.step_counts()[envs]).all()
    # Numbers go on from the last one given, in order of slots, or of a list.
    order = np.cumsum(fresh, axis=1)[fresh] - 1
    ids = new["id"][fresh]
    ids = ids[np.lexsort((ids, envs))] if scenario.arrivals else ids
    assert (ids == given[envs] + order).all()
    if scenario.has_deadlines:
        for victim in new[fresh]:
            waits = int(victim["deadline_step"] - victim["appeared_step"])
            low, high = plain.deadline_range(victim["task"]) or (0, 0)
            assert low <= waits <= high if high else victim["deadline_step"] == -1
    at = after.places[fresh]
    assert (abs(at) <= scenario.arena_half_width_m - scenario.wall_clearance_m + EXACT).all()
    apart = np.linalg.norm(after.positions[envs] - at[:, None], axis=-1)
    apart = np.where(plain.there(before)[envs], apart, np.inf)
    assert (apart >= scenario.spawn_clearance_m - EXACT).all() or scenario.arrivals
    check_areas(scenario, new["task"][fresh], at)
    if scenario.victim_places_m:
        for world in new:
            shown = world[world["present"]]
            assert len({(x, y) for x, y in zip(shown["x"], shown["y"], strict=True)}) == len(shown)
    return int(fresh.sum())


def check_areas(scenario: Scenario, tasks: np.ndarray, at: np.ndarray) -> None:
    """Checks that victims of these tasks (N,) may appear at their places (N, 2)."""
    listed = set(map(tuple, np.array(scenario.victim_places_m, "f4").reshape(-1, 2).tolist()))
    for task, place in zip(tasks, at, strict=True):
        area = scenario.tasks[task].area_m or scenario.victim_area_m
        if area is not None:
            assert (np.array(area[:2]) - EXACT <= place).all()
            assert (place <= np.array(area[2:]) + EXACT).all()
        assert not listed or tuple(place.tolist()) in listed


def check_arrivals(
    plain: Stepper,
    env: BatchEnv,
    victims: np.ndarray,
    stays: np.ndarray,
    turned_away: np.ndarray,
) -> None:
    """Checks the slots (E, V) of those that arrived, and how many (E,) found none."""
    scenario = env.scenario
    there, full = victims["present"], np.zeros(len(victims), dtype=bool)
    without = np.zeros(len(victims), dtype=int)
    for task, of_task in enumerate(scenario.tasks):
        own = slice(task * scenario.max_victims, (task + 1) * scenario.max_victims)
        assert (victims["task"][:, own][there[:, own]] == task).all()
        listed = any(one.task == of_task.name for one in scenario.arrivals)
        full |= there[:, own].all(1) & (of_task.arrival_rate_hz > 0 or listed)
        fresh = there[:, own] & ~stays[:, own]
        assert not fresh.any() or of_task.arrival_rate_hz > 0 or listed
        # They take the first of the empty slots.
        empty = np.cumsum(~stays[:, own], axis=1) * ~stays[:, own]
        assert (fresh == ((empty > 0) & (empty <= fresh.sum(1)[:, None]))).all()
        for world, step in enumerate(env.step_counts() if listed else ()):
            due, new = plain.due(task, step), victims[world, own][fresh[world]]
            assert len(new) == min(len(due), int((empty[world] > 0).sum()))
            places = np.stack([new["x"], new["y"]], -1)
            assert (places == np.reshape(due, (-1, 2))[: len(new)].astype("f4")).all()
            without[world] += len(due) - len(new)
    assert full[turned_away > 0].all()
    assert scenario.situation != "listed" or (turned_away == without).all()
