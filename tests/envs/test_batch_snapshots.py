"""Snapshots of a batch continue bit for bit, or are refused."""

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from worlds import CROWDED, batch, image, plan

from innerattn.config import Scenario

CONTINUE = """
import sys
import zlib
from pathlib import Path
import numpy as np
from innerattn.config import Scenario
from innerattn.envs import BatchEnv

folder = Path(sys.argv[1])
scenario = Scenario.model_validate_json((folder / "scenario.json").read_text())
env = BatchEnv(scenario, 12, seed=999, num_threads=2)
env.restore((folder / "image").read_bytes())
for actions in np.load(folder / "plan.npy"):
    step = env.step(actions)
(folder / "end").write_bytes(env.snapshot() + step.obs.tobytes() + step.rescues.tobytes())
"""


def test_restore_goes_on_bit_for_bit() -> None:
    env, other = batch(12), batch(12, seed=1)
    actions = plan(150, 12)
    for action in actions[:33]:
        env.step(action)
    start, obs = env.snapshot(), env.observe().copy()
    wanted = [image(env.step(action), env) for action in actions[33:]]
    end = env.snapshot()
    for goes_on in (env, other):
        goes_on.restore(start)
        assert goes_on.snapshot() == start
        assert goes_on.observe().tobytes() == obs.tobytes()
        assert [image(goes_on.step(action), goes_on) for action in actions[33:]] == wanted
        assert goes_on.snapshot() == end


def test_restore_goes_on_in_another_process(tmp_path: Path) -> None:
    env = batch(12)
    actions = plan(120, 12)
    for action in actions[:20]:
        env.step(action)
    (tmp_path / "scenario.json").write_text(CROWDED.model_dump_json())
    (tmp_path / "image").write_bytes(env.snapshot())
    np.save(tmp_path / "plan.npy", actions[20:])
    for action in actions[20:]:
        step = env.step(action)
    subprocess.run([sys.executable, "-c", CONTINUE, str(tmp_path)], check=True, timeout=120)
    end = env.snapshot() + step.obs.tobytes() + step.rescues.tobytes()
    assert (tmp_path / "end").read_bytes() == end


def test_spoilt_snapshots_are_refused() -> None:
    env, source = batch(4), batch(4, seed=8)
    good, before = source.snapshot(), env.snapshot()
    size = len(good)
    spoilt = [good[:cut] for cut in (0, 1, 7, 8, 12, size // 2, size - 4, size - 1)]
    spoilt += [good + b"\0", good[::-1], good[1:]]
    for at in [0, 7, 8, 9, *range(10, size, size // 50), size - 4, size - 1]:
        spoilt.append(good[:at] + bytes([good[at] ^ 0x10]) + good[at + 1 :])
    for bad in spoilt:
        with pytest.raises(ValueError, match=r"^snapshot: [^\n]+$"):
            env.restore(bad)
        assert env.snapshot() == before
    env.restore(good)
    assert env.snapshot() == good


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (lambda: batch(5), "it holds 5 envs; this batch has 4"),
        (lambda: batch(4, Scenario()), "another scenario"),
    ],
)
def test_foreign_snapshots_are_refused(other, message: str) -> None:
    env = batch(4)
    before = env.snapshot()
    with pytest.raises(ValueError, match=message):
        env.restore(other().snapshot())
    assert env.snapshot() == before


def sealed(body: bytes) -> bytes:
    """Bytes with the checksum that a forger would give them."""
    return body + zlib.crc32(body).to_bytes(4, "little")


@pytest.mark.parametrize("engine", ["discs", "rapier"])
@pytest.mark.parametrize(
    ("kind", "forged"),
    [("speed_limit", -1.0), ("speed_limit", np.nan), ("motor_gain", 1e30), ("heading_bias", 9.0)],
)
def test_a_forged_fault_is_refused(engine: str, kind: str, forged: float) -> None:
    env = batch(2, CROWDED.replace(engine=engine))
    before, faults = env.snapshot(), env.fault_state()
    faults[kind] = 0.4375
    env.set_faults(faults)
    body = env.snapshot()[:-4]
    level = struct.pack("<f", 0.4375)
    assert body.count(level) == 8
    env.restore(before)
    with pytest.raises(ValueError, match=r"^snapshot: env 0 does not fit the scenario: its faults"):
        env.restore(sealed(body.replace(level, struct.pack("<f", forged))))
    assert env.snapshot() == before


def test_robots_outside_the_arena_are_refused() -> None:
    env = batch(2)
    places = env.positions()
    places[1, 2] = 0.4375, -0.3125
    env.set_motion(places, env.velocities())
    body, inside = env.snapshot()[:-4], struct.pack("<ff", 0.4375, -0.3125)
    assert body.count(inside) == 1
    with pytest.raises(ValueError, match=r"^snapshot: env 1 does not fit .*: its positions"):
        env.restore(sealed(body.replace(inside, struct.pack("<ff", 0.4375, -0.75))))


@pytest.mark.parametrize("engine", ["discs", "rapier"])
def test_forged_snapshots_are_refused_or_go_on(engine: str) -> None:
    """What a forger gets accepted is a state that the scenario allows: worlds go on from it."""
    env = batch(2, CROWDED.replace(engine=engine))
    for action in plan(20, 2):
        env.step(action)
    body = env.snapshot()[:-4]
    chance = np.random.default_rng(0)
    start = len(body) - 500
    accepted = refused = 0
    for action in plan(3000, 2):
        forged = bytearray(body)
        for _ in range(chance.integers(1, 4)):
            forged[chance.integers(start, len(body))] = chance.integers(256)
        try:
            env.restore(sealed(bytes(forged)))
        except ValueError:
            refused += 1
            continue
        accepted += 1
        env.step(action)
        assert np.isfinite(env.observe()).all()
        assert (abs(env.positions()) <= CROWDED.arena_half_width_m).all()
    assert accepted > 50
    assert refused > 500
