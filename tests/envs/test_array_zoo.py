"""Every function that takes an array, given arrays of all sorts: the same bits, or a refusal.

What is accepted must do what the plain, contiguous copy of it does. What is refused is refused by a
TypeError or ValueError that names the argument and what it must be, and changes nothing.
"""

import threading
import time
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from worlds import CONTINUOUS, batch, plan
from zoo import zoo

from innerattn.config import Scenario
from innerattn.envs import BatchEnv

ENVS = 3


class Entrance(NamedTuple):
    """A function that takes an array."""

    argument: str
    good: Callable[[BatchEnv], np.ndarray]
    call: Callable[[BatchEnv, Any], object]
    kinds: str
    """Kinds of numbers that may be accepted."""
    most_bytes: int
    env: Callable[[], BatchEnv] = lambda: batch(ENVS)


def mask(_: BatchEnv) -> np.ndarray:
    return np.array([True, False, True])


def actions(_: BatchEnv) -> np.ndarray:
    return plan(1, ENVS)[0]


def forces(_: BatchEnv) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, (ENVS, 4, 2)).astype("f4")


def levels(env: BatchEnv) -> np.ndarray:
    faults = env.fault_state()
    table = np.stack([faults[kind] for kind in faults.dtype.names or ()], -1)
    return table.astype("f4")


def core(env: BatchEnv) -> Any:
    return env._core


def continuous() -> BatchEnv:
    return batch(ENVS, CONTINUOUS)


def places(env: BatchEnv) -> np.ndarray:
    return env.positions()


def present(env: BatchEnv) -> np.ndarray:
    return np.ones((env.num_envs, env.scenario.num_victims), bool)


def tasks(env: BatchEnv) -> np.ndarray:
    return np.maximum(env.victims()["task"], 0)


def spots(env: BatchEnv) -> np.ndarray:
    victims = env.victims()
    return np.stack([victims["x"], victims["y"]], -1)


ENTRANCES = {
    "step": Entrance("actions", actions, BatchEnv.step, "iu", 8),
    "step, continuous": Entrance("actions", forces, BatchEnv.step, "f", 8, continuous),
    "reset": Entrance("mask", mask, lambda env, x: env.reset(mask=x), "b", 1),
    "reset with a seed": Entrance("mask", mask, lambda env, x: env.reset(7, mask=x), "b", 1),
    "set_faults' mask": Entrance(
        "mask", mask, lambda env, x: env.set_faults(env.fault_state(), x), "b", 1
    ),
    "set_motion's positions": Entrance(
        "positions", places, lambda env, x: env.set_motion(x, env.velocities()), "iuf", 8
    ),
    "set_motion's velocities": Entrance(
        "velocities", places, lambda env, x: env.set_motion(env.positions(), x), "iuf", 8
    ),
    "core.step": Entrance("actions", actions, lambda env, x: core(env).step(x), "iu", 8),
    "core.step, continuous": Entrance(
        "actions", forces, lambda env, x: core(env).step(x), "f", 8, continuous
    ),
    "core.reset": Entrance("mask", mask, lambda env, x: core(env).reset(None, x), "b", 1),
    "core.set_faults": Entrance(
        "faults", levels, lambda env, x: core(env).set_faults(x, None), "iuf", 8
    ),
    "core.set_victims' presence": Entrance(
        "victims", present, lambda env, x: core(env).set_victims(x, tasks(env), spots(env)), "b", 1
    ),
    "core.set_victims' tasks": Entrance(
        "victims", tasks, lambda env, x: core(env).set_victims(present(env), x, spots(env)), "iu", 8
    ),
    "core.set_victims' places": Entrance(
        "victims",
        spots,
        lambda env, x: core(env).set_victims(present(env), tasks(env), x),
        "iuf",
        8,
    ),
    "core.set_motion": Entrance(
        "positions", places, lambda env, x: core(env).set_motion(x, env.velocities()), "iuf", 8
    ),
}


def outcome(entrance: Entrance, env: BatchEnv, given: Any) -> bytes | Exception:
    """All that a call gave and left, or its refusal, which must be a good one."""
    before = env.snapshot()
    try:
        result = entrance.call(env, given)
    except (TypeError, ValueError) as error:
        assert env.snapshot() == before, "something changed"
        return error
    arrays = result if isinstance(result, tuple) else () if result is None else (result,)
    return b"|".join([env.snapshot(), *(np.asarray(array).tobytes() for array in arrays)])


@pytest.mark.parametrize("name", ENTRANCES)
def test_the_same_bits_or_a_clear_refusal(name: str) -> None:
    entrance = ENTRANCES[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # numpy's own, of casts that make the zoo
        cases = list(zoo(entrance.good(entrance.env())))
    assert len(cases) >= 100
    accepted = refused = 0
    for case, given in cases:
        found = outcome(entrance, entrance.env(), given)
        if isinstance(found, Exception):
            refused += 1
            text = str(found)
            assert text.startswith(entrance.argument), f"{case}: {text}"
            assert "must be" in text, f"{case}: {text}"
            assert "\n" not in text, f"{case}: {text}"
            continue
        accepted += 1
        plain = np.ascontiguousarray(np.asarray(given))
        plain = plain.astype(plain.dtype.newbyteorder("="))
        assert plain.dtype.kind in entrance.kinds, case
        assert plain.dtype.itemsize <= entrance.most_bytes, case
        assert not isinstance(given, np.ma.MaskedArray), case
        assert plain.shape == entrance.good(entrance.env()).shape, case
        if plain.dtype == bool:  # a byte that is not 0 is true
            plain = plain.view("u1") != 0
        assert found == outcome(entrance, entrance.env(), plain), case
    assert accepted >= 10
    assert refused >= 50


FIELD_DTYPES = ("?", "i4", "u1", "f2", "f4", "f8", ">f4", "g", "c8", "S4", "U4", "O", "M8[s]")


@pytest.mark.parametrize("dtype", FIELD_DTYPES)
def test_fields_of_faults_are_numbers(dtype: str) -> None:
    env, wanted = batch(ENVS), batch(ENVS)
    good = env.fault_state()
    kinds = good.dtype.names or ()
    table = np.zeros(good.shape, [(kind, dtype) for kind in kinds])
    for kind in kinds:
        table[kind] = good[kind].astype(dtype)
    before = env.snapshot()
    if np.dtype(dtype).kind in "iuf" and dtype != "g":
        env.set_faults(table)
        wanted.set_faults(good)
        assert env.snapshot() == wanted.snapshot()
        return
    with pytest.raises(TypeError, match=r"^faults\['motor_gain'\] has dtype .*: must have shape"):
        env.set_faults(table)
    assert env.snapshot() == before


def test_tables_of_faults_of_every_layout() -> None:
    env, wanted = batch(ENVS), batch(ENVS)
    table = env.fault_state()
    table["motor_gain"][1, 2] = 0.25
    wanted.set_faults(table)
    doubled = np.repeat(table, 2, axis=0)[::2]
    for given in (table, doubled, np.asfortranarray(table), table.view(np.recarray), table[::-1]):
        env.set_faults(given)
        assert (env.fault_state() == given).all()
    before = env.snapshot()
    spoilt = table.copy()
    spoilt["blackout"][2, 0] = np.nan
    for given in (
        *(table[0], table[:2], table[..., None], table[:, :3], table["motor_gain"]),
        *(np.ma.masked_array(table), table.tolist(), None, "faults", spoilt),
        table[list(table.dtype.names or ())[:3]],
    ):
        with pytest.raises((TypeError, ValueError), match=r"^faults.*must"):
            env.set_faults(given)
        assert env.snapshot() == before


def test_actions_are_read_once() -> None:
    """What another thread writes meanwhile is checked or not seen: 99 never passes as "stay"."""
    env = BatchEnv(Scenario(action_cost=1.0), 2048, num_threads=1)
    effort = env.reward_component_names.index("action")
    actions = np.ones((2048, 4), np.int64)
    done = threading.Event()

    def spoil() -> None:
        while not done.is_set():
            actions[...] = 99
            time.sleep(0.001)
            actions[...] = 1
            time.sleep(0.001)

    thread = threading.Thread(target=spoil)
    thread.start()
    try:
        accepted, refusals = 0, {"99: must be an integer in 0..=4"}
        while accepted < 60:
            try:
                env.step(actions)
            except ValueError as error:
                refusals.add(str(error).partition(" = ")[2])
                continue
            accepted += 1
            assert (env.reward_components()[..., effort] == -1.0).all()
        assert refusals == {"99: must be an integer in 0..=4"}
    finally:
        done.set()
        thread.join()
