"""An update that fails after the critic has stepped leaves nothing of itself in a run."""

import json
import math
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError, RunError
from innerattn.learn import PPO, TD
from innerattn.learn.actor_critic import ActorCritic
from innerattn.learn.divergence import DivergenceError
from innerattn.learn.framed import unframed
from innerattn.records.run_folder import newest_weights, read_info
from innerattn.train import resume, train
from innerattn.train.build import build_learner
from innerattn.train.parts import Parts
from innerattn.train.resume import read_saved
from innerattn.train.weights import digest_of

Configure = Callable[..., RunConfig]

SMALL = {
    "train.env_steps": 480,
    "train.checkpoint_every_env_steps": 48,
    "train.checkpoint_every_minutes": 0.0,
    "ppo.rollout_steps": 7,
    "ppo.minibatch_size": 32,
    "network.attention_heads": 2,
    "td.replay_capacity": 300,
    "td.update_every_env_steps": 5,
    "td.warmup_env_steps": 100,
}
FAILS_AT = 20
"""The update whose actor gets observations that are not finite; the critic's were."""
CASES = [("td-inner", TD), ("ppo-inner", PPO)]


def break_the_actor(patched: pytest.MonkeyPatch, kind: type[ActorCritic]) -> list[int]:
    """Let one update fail in the actor; the list gets the env-step's updates before it."""
    name = "_actor_gradients" if kind is PPO else "_update_actor"
    original: Any = getattr(kind, name)
    done: list[int] = []
    calls = 0

    def failing(self: ActorCritic, nets: Any, obs: Tensor, *rest: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls in (FAILS_AT, FAILS_AT + 1):  # and once more, to find out what failed
            done.append(self.updates)
            obs = obs * math.nan
        return original(self, nets, obs, *rest)

    patched.setattr(kind, name, failing)
    return done


@pytest.mark.parametrize(
    ("method", "kind"), [pytest.param(*CASES[0], marks=pytest.mark.long), CASES[1]]
)
def test_a_run_that_stops_goes_on_from_before_the_update(
    small_config: Configure,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    method: str,
    kind: type[ActorCritic],
) -> None:
    config, run = small_config(**SMALL, **{"train.method": method}), tmp_path / "run"
    with monkeypatch.context() as patched:
        done = break_the_actor(patched, kind)
        with pytest.raises(RunError, match=r"diverged at env_steps = .*the gradient of actor\."):
            train(config, run)
    assert done[0] == FAILS_AT - 1
    assert read_info(run).state == "interrupted"
    assert int(read_saved(run).weights["updates"]) < FAILS_AT
    resume(run)
    whole = train(config, tmp_path / "whole")
    assert digest_of(newest_weights(run)) == digest_of(newest_weights(whole))


@pytest.mark.parametrize("symmetry", ["none", "canonical"])
def test_a_learner_that_cannot_skip_updates_is_refused(
    small_config: Configure, monkeypatch: pytest.MonkeyPatch, symmetry: str
) -> None:
    def without_skipping(*args: Any, **more: Any) -> Any:
        learner = build_learner(*args, **more)
        del unframed(learner).skips_divergence  # type: ignore[attr-defined]
        return learner

    monkeypatch.setattr("innerattn.train.parts.build_learner", without_skipping)
    given = {**SMALL, "train.method": "mappo", "network.symmetry": symmetry}
    stops, skips = (small_config(**given, **{"train.on_divergence": x}) for x in ("stop", "skip"))
    with closing(BatchEnv(stops.scenario, 2, num_threads=1)) as env:
        Parts(stops, env, "training")
        message = r"on_divergence = 'skip': method 'mappo' cannot skip updates; its learner has no "
        with pytest.raises(ConfigError, match=message):
            Parts(skips, env, "training")


@pytest.mark.parametrize(("method", "kind"), CASES)
def test_a_skipped_update_changes_no_weight(
    small_config: Configure,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    method: str,
    kind: type[ActorCritic],
) -> None:
    found: list[tuple[dict[str, Tensor], dict[str, Tensor]]] = []
    original: Any = ActorCritic._update

    def watched(self: ActorCritic, *tensors: Tensor) -> Tensor:
        before = self.state()
        try:
            return original(self, *tensors)  # type: ignore[no-any-return]
        except DivergenceError:
            found.append((before, self.state()))
            raise

    monkeypatch.setattr(ActorCritic, "_update", watched)
    break_the_actor(monkeypatch, kind)
    skip = {"train.method": method, "train.on_divergence": "skip"}
    run = train(small_config(**SMALL, **skip), tmp_path / "run")
    ((before, after),) = found
    assert before.keys() == after.keys()
    assert [name for name in before if not torch.equal(before[name], after[name])] == []
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    assert sum(line["losses"].get("skipped_updates", 0) for line in lines) == 1
    assert read_info(run).updates >= FAILS_AT
