"""Does what worlds and an exported team are to do alike everywhere, and prints it as JSON.

usage: python packages/wheels/trial.py [EXPORT]

It takes `innerattn` from where the Python that runs it finds it, and needs nothing that only some
systems have. EXPORT is a folder that `innerattn export` wrote, of a team for `mixed`.
"""

from __future__ import annotations

import hashlib
import json
import platform
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "cross"))

import digests

from innerattn import _core
from innerattn.config import Scenario
from innerattn.config.files import preset_names
from innerattn.envs import BatchEnv, Step
from innerattn.policies.exported import Exported

WORLDS, STEPS, SEED = 4, 2_000, 7
"""Of each preset."""
TEAM_STEPS, CALLS = 250, 400


def of_presets() -> dict[str, str]:
    """SHA-256, by the name of the preset, of all that `STEPS` steps with irregular actions give."""
    found = {}
    for name in preset_names("scenarios"):
        with BatchEnv(name, WORLDS, SEED, 2) as env:
            digest = hashlib.sha256(env.reset().tobytes())
            for step in range(STEPS):
                chosen = digests.actions(step, WORLDS, env.num_robots)
                made = env.step(digests.drives(chosen) if env.continuous else chosen)
                for part in made:
                    digest.update(np.ascontiguousarray(part).tobytes())
        found[name] = digest.hexdigest()
    return found


def of_a_team(export: Path) -> dict[str, Any]:
    """What a team does in worlds that it drives, and what one of its calls costs."""
    team = Exported(export, backend="numpy", greedy=True)
    actions, logits = [], []
    with BatchEnv(Scenario.preset("mixed"), WORLDS, SEED, 1) as env:
        obs = env.reset()
        for _ in range(TEAM_STEPS):
            rows = [np.ascontiguousarray(obs[:, index]) for index in range(env.num_robots)]
            found = [team.logits(*pair) for pair in zip(team.robot_names, rows, strict=True)]
            logits.append(np.stack(found, axis=1))
            chosen = team.act(Step(obs, *[None] * 5))  # type: ignore[arg-type]
            actions.append(chosen)
            obs = env.step(chosen).obs
    return {
        "actions": np.stack(actions).ravel().tolist(),
        "observations": hashlib.sha256(obs.tobytes()).hexdigest(),
        "logits": np.stack(logits).astype("<f4").tobytes().hex(),
        "call_us": _microseconds(team, obs[0, 0]),
    }


def _microseconds(team: Exported, row: NDArray[np.float32]) -> float:
    """The median time of a call with a row."""
    times = []
    for _ in range(CALLS):
        start = time.perf_counter()
        team.decide(team.robot_names[0], row)
        times.append(time.perf_counter() - start)
    return median(times) * 1e6


def main() -> None:
    """Print what was found."""
    found = {
        "module": str(_core.__file__),
        "where": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}, "
        f"numpy {np.__version__}",
        "kept": {
            name: digests.digest(digests.shown(one))["sha256"]
            for name, one in digests.scenarios().items()
        },
        "presets": of_presets(),
    }
    if len(sys.argv) > 1:
        found["team"] = of_a_team(Path(sys.argv[1]))
    print(json.dumps(found))


if __name__ == "__main__":
    main()
