"""What goes wrong inside a batch: a world that fails, Ctrl-C in a long step, a lack of memory."""

import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from worlds import CROWDED, batch, image, plan

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import WorldError


@pytest.mark.parametrize("num_threads", [1, 2, 3])
@pytest.mark.parametrize("copy", [True, False])
def test_a_world_that_fails_stops_no_other(num_threads: int, copy: bool) -> None:
    count, bad = 100, [0, 42, 99]
    env = batch(count, num_threads=num_threads, copy=copy)
    plain = batch(count)
    actions = plan(60, count)
    fine = np.ones(count, bool)
    for action in actions[:7]:
        env.step(action)
        plain.step(action)
    env._core._panic_in_next_step(bad)
    with pytest.raises(WorldError, match=r"^env 0, 42, 99: it failed in this step") as caught:
        env.step(actions[7])
    assert caught.value.envs == (0, 42, 99)
    plain.step(actions[7])
    fine[bad] = False
    assert env.observe()[fine].tobytes() == plain.observe()[fine].tobytes()
    assert (env.step_counts() == np.where(fine, plain.step_counts(), 0)).all()

    before = env.snapshot()
    with pytest.raises(ValueError, match=r"^env 0: it failed in an earlier step; reset it"):
        env.step(actions[8])
    assert env.snapshot() == before
    env.reset(mask=~fine)
    plain.reset(mask=~fine)
    for action in actions[8:]:
        assert image(env.step(action), env) == image(plain.step(action), plain)


def test_a_failed_world_goes_on_from_a_snapshot() -> None:
    env, plain = batch(5), batch(5)
    kept = env.snapshot()
    env._core._panic_in_next_step([3])
    with pytest.raises(WorldError, match=r"^env 3: it failed in this step \(a test asked for it\)"):
        env.step(plan(1, 5)[0])
    env.restore(kept)
    for action in plan(20, 5):
        assert image(env.step(action), env) == image(plain.step(action), plain)


def test_many_failures_are_named_in_one_short_line() -> None:
    env = batch(300)
    env._core._panic_in_next_step(list(range(300)))
    with pytest.raises(WorldError, match=r"18, 19 and 280 more: it failed") as caught:
        env.step(plan(1, 300)[0])
    assert caught.value.envs == tuple(range(300))
    env.reset()
    env.step(plan(1, 300)[0])


LONG = Scenario(substeps=1000, arena_half_width_m=0.3, spawn_clearance_m=0.05)
"""Worlds of which a few thousand take seconds to step: robots touch all the time."""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of another kind")
@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("num_threads", [1, 2])
def test_ctrl_c_ends_a_long_step_and_nothing_moves(num_threads: int) -> None:
    env = BatchEnv(LONG, 6000, num_threads=num_threads)
    actions = np.random.default_rng(0).integers(0, 5, (6000, 4))
    sent = 0.0

    def interrupt() -> None:
        nonlocal sent
        time.sleep(0.3)
        sent = time.monotonic()
        signal.raise_signal(signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    kept = [env.snapshot()]

    def go_on() -> None:
        thread.start()  # here, for a slow machine takes its time to begin
        for _ in range(50):
            kept.append(env.snapshot())
            env.step(actions)

    with pytest.raises(KeyboardInterrupt):
        go_on()
    assert time.monotonic() - sent < 10.0  # fifty steps would take minutes
    thread.join()
    assert env.snapshot() == kept[-1]
    other = BatchEnv(LONG, 6000, num_threads=num_threads)
    other.restore(kept[-1])
    assert env.observe().tobytes() == other.observe().tobytes()


LIMITED = """
import resource
import sys
import numpy as np
from innerattn.config import Robot, Scenario
from innerattn.envs import BatchEnv

team = [Robot(name=f"r{i}", kind="all", abilities=("food", "medicine", "information"),
              max_speed_mps=1.0, mass_kg=1.0, radius_m=0.02) for i in range(64)]
scenarios = [Scenario(robots=tuple(robots), engine="discs", spawn_clearance_m=0.0)
             for robots in (Scenario().robots, team)]
in_use = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
limit = 2**30 + in_use * int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
done = lacked = 0
for scenario in scenarios:
    size = 256
    while size < 2**20:
        size = min(int(1.4 * size), 2**20)
        try:
            with BatchEnv(scenario, size, num_threads=2) as env:
                env.reset()
                env.step(np.ones((size, scenario.num_robots), np.int8))
                env.positions(), env.victims(), env.fault_state(), env.observe()
                image = env.snapshot()
                env.restore(image)
                env.set_faults(env.fault_state())
            done += 1
        except MemoryError:
            lacked += 1
print(done, lacked)
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="limits of another kind")
@pytest.mark.parametrize(("beside", "least_done"), [("0", 0), ("1", 15)])
def test_a_lack_of_memory_is_an_error_and_never_an_abort(beside: str, least_done: int) -> None:
    """1 GiB for the whole process, and 1 GiB beside what it has when it starts."""
    command = [sys.executable, "-c", LIMITED, beside]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert ran.returncode == 0, ran.stderr[-2000:]
    done, lacked = map(int, ran.stdout.split())
    assert done >= least_done
    assert lacked >= 10


def test_crowded_worlds_fail_alone() -> None:
    """In worlds where episodes end and robots touch, a failure leaves no trace in the others."""
    env, plain = batch(40, CROWDED, num_threads=2), batch(40, CROWDED)
    fine = np.arange(40) != 17
    for number, action in enumerate(plan(90, 40)):
        if number % 30 == 10:
            env._core._panic_in_next_step([17])
            with pytest.raises(WorldError):
                env.step(action)
            plain.step(action)
            env.reset(mask=~fine)
        else:
            env.step(action)
            plain.step(action)
        assert env.observe()[fine].tobytes() == plain.observe()[fine].tobytes()
