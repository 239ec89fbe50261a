"""Training on a GPU: it learns what the CPU learns, and what it leaves is used without a GPU.

`make test-gpu` runs these tests, and those of stopped runs, where there is a GPU.
"""

import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
import torch
from torch import Tensor

from innerattn.cli.main import main
from innerattn.config import NetworkConfig, PPOConfig, RunConfig, TDConfig
from innerattn.envs import BatchEnv
from innerattn.learn import PPO, TD, Team, Transitions
from innerattn.learn.rollout import Rollout
from innerattn.learn.types import Learner
from innerattn.nn import EntityColumns
from innerattn.train import load_policy, train

pytestmark = pytest.mark.gpu

Configure = Callable[..., RunConfig]
ROBOTS, ROWS = 4, 64
COLUMNS = EntityColumns(5, ROBOTS - 1, 2, 2, 2, 0)
NETWORKS = {
    "inner": {"attention": "inner"},
    "uniform": {"attention": "uniform"},
    "none": {"attention": "none"},
    "frozen": {"attention": "frozen"},
    "by kind": {"attention": "inner", "parameter_sharing": "kind", "shared_gradients": "mean"},
    "entities": {"attention": "inner", "encoder": "entities"},
    "masked": {"attention": "inner", "mask_unavailable": True},
}


def make(algorithm: str, network: dict, device: str) -> TD | PPO:
    team = Team(
        ROBOTS,
        COLUMNS.width,
        3,
        kinds=("one", "another", "another", "third"),
        availability_column=4,
        entities=COLUMNS,
    )
    given = NetworkConfig(hidden_width=16, attention_heads=2, **network)
    extra = {"seed": 3, "device": torch.device(device), "dtype": torch.float64}
    if algorithm == "td":
        return TD(team, given, TDConfig(batch_size=ROWS, critic_weight_decay=0.01), **extra)
    advantage = "value" if network["attention"] == "none" else "counterfactual"
    return PPO(team, given, PPOConfig(minibatch_size=ROWS, advantage=advantage), **extra)


def drawn(seed: int, *shape: int) -> Tensor:
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def update(learner: TD | PPO, seed: int, device: str) -> Tensor:
    actions = torch.randint(3, (ROBOTS, ROWS), generator=torch.Generator().manual_seed(seed))
    if isinstance(learner, TD):
        # Devices draw from generators of their own.
        learner._draw = lambda shape: drawn(seed + 9, *shape).exp().to(device)
        batch = Transitions(
            drawn(seed + 1, ROWS, ROBOTS, COLUMNS.width).float(),
            actions.t(),
            drawn(seed + 2, ROWS, ROBOTS).float(),
            drawn(seed + 3, ROWS, ROBOTS, COLUMNS.width).float(),
            torch.arange(ROWS) % 5 == 0,
        )
        moved = [None if part is None else part.to(device) for part in batch]
        return learner.update(Transitions(*moved))
    rows = Rollout(
        drawn(seed + 1, ROBOTS, ROWS, COLUMNS.width),
        actions,
        -drawn(seed + 2, ROBOTS, ROWS).abs(),
        drawn(seed + 4, ROBOTS, ROWS),
        drawn(seed + 5, ROBOTS, ROWS),
    )
    return learner.update(Rollout(*(part.to(device) for part in rows[:5])))


# A compilation takes half a minute.
UPDATES = [(name, False) for name in NETWORKS] + [("inner", True), ("by kind", True)]


@pytest.mark.parametrize(("network", "compiled"), UPDATES)
@pytest.mark.parametrize("algorithm", ["td", "ppo"])
def test_an_update_is_that_of_the_cpu(algorithm: str, network: str, compiled: bool) -> None:
    torch.compiler.reset()
    learners = {name: make(algorithm, NETWORKS[network], name) for name in ("cpu", "cuda")}
    if compiled:
        learners["cuda"].compile()
    for seed in range(3):
        expected, found = (update(one, 10 * seed, name) for name, one in learners.items())
        torch.testing.assert_close(found.cpu(), expected, rtol=1e-7, atol=1e-9)
    state = learners["cuda"].state()
    first = make(algorithm, NETWORKS[network], "cpu").state()
    for name, tensor in learners["cpu"].state().items():
        torch.testing.assert_close(state[name].cpu(), tensor, rtol=1e-6, atol=1e-8)
    assert any(not torch.equal(first[name], state[name].cpu()) for name in first)


METHODS = ("td-inner", "td-uniform", "ppo-inner", "ppo-uniform", "mappo", "ppo-oracle")
RUNS = [(name, "off") for name in METHODS] + [("td-inner", "on"), ("ppo-inner", "on")]


@pytest.mark.parametrize(("method", "compile_it"), RUNS)
def test_a_run_is_repeatable_and_is_used_without_a_gpu(
    small_config: Configure, tmp_path: Path, method: str, compile_it: str
) -> None:
    options = {
        "train.method": method,
        "train.device": "cuda",
        "train.compile": compile_it,
        "network.symmetry": "canonical",
        "ppo.rollout_steps": 10,
        "ppo.minibatch_size": 40,
    }
    runs = [train(small_config(**options), tmp_path / name) for name in ("one", "other")]
    infos = [json.loads((run / "run.json").read_text()) for run in runs]
    assert infos[0]["device"] == "cuda"
    assert infos[0]["compiled"] is (compile_it == "on")
    assert infos[0]["updates"] > 0
    assert infos[0]["weights_sha256"] == infos[1]["weights_sha256"]

    config, there = load_policy(runs[0], device="cuda")
    _, here = load_policy(runs[0])
    with closing(BatchEnv(config.scenario, 256, seed=1, num_threads=1)) as env:
        obs = torch.from_numpy(env.reset())
    seen = [one.as_seen(o, actions)[0].cpu() for one, o, actions in both(there, here, obs)]
    torch.testing.assert_close(seen[0], seen[1])
    chosen = [one.act(o, greedy=True).cpu() for one, o, _ in both(there, here, obs)]
    assert (chosen[0] == chosen[1]).float().mean() > 0.99  # but where two outputs are nearly equal


def both(there: Learner, here: Learner, obs: Tensor) -> list[tuple[Learner, Tensor, Tensor]]:
    """A policy on the GPU and on the CPU, with observations and actions there."""
    actions = torch.zeros(obs.shape[:2], dtype=torch.int64)
    return [(there, obs.cuda(), actions.cuda()), (here, obs, actions)]


def test_less_precise_products_are_learnt_with(small_config: Configure, tmp_path: Path) -> None:
    options = {"train.device": "cuda", "network.precision": "bfloat16"}
    run = train(small_config(**options), tmp_path / "run")
    assert json.loads((run / "run.json").read_text())["state"] == "done"


def test_the_command_trains_and_measures(
    tmp_path: Path, tiny: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    assert main(["train", "--device", "cuda", "--run-dir", str(run), *tiny]) == 0
    assert (run / "evaluation" / "summary.json").exists()
    assert main(["info"]) == 0
    assert f"cuda ({torch.cuda.get_device_name()})" in capsys.readouterr().out
    assert main(["train", "--device", "cuda:99", "--run-dir", str(tmp_path / "no"), *tiny]) == 1
    last = torch.cuda.device_count() - 1
    assert f"must be 'cpu', 'cuda' or 'cuda:0' to 'cuda:{last}'" in capsys.readouterr().err
