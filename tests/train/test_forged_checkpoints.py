"""States that somebody made up are refused, or are ones that a training can go on from."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.train import Progress, resume, train
from innerattn.train.parts import Parts
from innerattn.train.resume import read_saved
from innerattn.train.row_files import read_rows

Configure = Callable[..., RunConfig]


def stop(_: Progress) -> None:
    raise KeyboardInterrupt


@pytest.fixture(scope="module", params=["td-inner", "ppo-inner"])
def stopped(
    request: pytest.FixtureRequest,
    small_config: Configure,
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """A run that was stopped in its imitation, with something of everything."""
    run = tmp_path_factory.mktemp("stopped") / "run"
    seen = 0

    def later(progress: Progress) -> None:
        nonlocal seen
        seen += 1
        if seen == 12:
            stop(progress)

    config = small_config(
        **{
            "train.method": request.param,
            "train.warm_start": "greedy",
            "imitation.env_steps": 300,
            "imitation.critic_env_steps": 300,
            "network.symmetry": "augmented",
            "td.replay_capacity": 100,
        }
    )
    with pytest.raises(KeyboardInterrupt):
        train(config, run, progress=later)
    return run


def forgeries(name: str, value: Tensor) -> list[tuple[str, Tensor | None]]:
    """Other values for a tensor, and what each is."""
    found: list[tuple[str, Tensor | None]] = [("missing", None)]
    found.append(("another shape", value.unsqueeze(0)))
    found.append(("another dtype", value.to(torch.float16)))
    if not value.numel():
        return found
    if value.is_floating_point():
        found.append(("not finite", torch.full_like(value, float("nan"))))
    elif name != "worlds" and value.dtype == torch.int64:
        found.append(("too large", torch.full_like(value, 2**62 + 1)))
        found.append(("negative", torch.full_like(value, -1)))
    elif name == "worlds":
        found.append(("another world", value.flip(0)))
        found.append(("half a world", value[: len(value) // 2]))
    return found


def test_forged_states_are_refused_or_go_on(stopped: Path) -> None:
    saved = read_saved(stopped)
    config, stage = saved.config, saved.info.counters.stage
    env: Any
    with BatchEnv(config.training_scenario, config.train.num_envs, num_threads=1) as env:
        parts = Parts(config, env, stage)
        for name, ring in parts.rings(stage).items():
            read_rows(stopped / "checkpoints" / "rows", name, ring, saved.info.rows[name])
        parts.load(saved.weights, saved.state, stage)
        accepted, lines = [], {0}
        for name, value in saved.state.items():
            for what, other in forgeries(name, value):
                state = {**saved.state, name: other}
                if other is None:
                    del state[name]
                try:
                    parts.load(saved.weights, state, stage)
                except ValueError as error:
                    lines.add(str(error).count("\n"))
                else:
                    accepted.append((name.rpartition(".")[2], what))
        assert lines == {0}
        # What may be absent: nothing was there yet, or an older version did not write it.
        absent = {name for name, what in accepted if what == "missing"}
        assert absent <= {
            *("obs", "rows", "open", "log_probs", "epoch", "order", "agreement"),
            *("imitation_loss", "critic_loss", "q_mean", "critic_grad_norm", "actor_loss"),
            *("policy_entropy", "actor_grad_norm", "kl", "clip_share"),
            "cpu_seconds",
        }
        assert [pair for pair in accepted if pair[1] != "missing"] == []
        parts.load(saved.weights, saved.state, stage)
    with pytest.raises(KeyboardInterrupt):
        resume(stopped, progress=stop)
