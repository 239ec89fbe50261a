"""The example of a new network part, additive attention, against plain loops."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import torch
from torch import Tensor

from innerattn.config import NetworkConfig, TDConfig, registry
from innerattn.learn import TD, Team, Transitions
from innerattn.nn import TeammateAttention

WIDTH, HEADS, BATCH, ROBOTS = 6, 2, 5, 4


@pytest.fixture(autouse=True)
def _installed(imported: Callable[[str], ModuleType]) -> None:
    imported("additive_attention")


def attention() -> TeammateAttention:
    from additive_attention.network import AdditiveAttention

    return AdditiveAttention(WIDTH, HEADS, torch.Generator().manual_seed(0)).double()


def plain(parts: dict[str, Tensor], own: Tensor, others: Tensor, seen: Tensor) -> Tensor:
    """x_i of robot i, world by world and head by head."""
    mixed, d = torch.zeros_like(own), WIDTH // HEADS
    for b in range(BATCH):
        for i in range(ROBOTS):
            teammates = [j for j in range(ROBOTS) if j != i and seen[b, j]]
            for h in range(HEADS):
                of_head = slice(h * d, (h + 1) * d)
                q = parts["query"][of_head] @ own[i, b]
                scores = [
                    parts["score"][h] @ torch.tanh(q + parts["key"][of_head] @ others[j, b])
                    for j in teammates
                ]
                total = sum(score.exp() for score in scores)
                for j, score in zip(teammates, scores, strict=True):
                    v = parts["value"][of_head] @ others[j, b]
                    v = torch.where(v > 0, v, 0.01 * v)
                    mixed[i, b, of_head] += score.exp() / total * v
    return mixed


@pytest.mark.parametrize("masked", [False, True])
def test_it_agrees_with_plain_loops(masked: bool) -> None:
    source = torch.Generator().manual_seed(1)
    own, others = torch.randn(
        2, ROBOTS, BATCH, WIDTH, generator=source, dtype=torch.float64
    ).unbind()
    seen = torch.ones(BATCH, ROBOTS, dtype=torch.bool)
    if masked:
        seen[0, 1] = False
        seen[1] = False
    with torch.no_grad():
        made = attention()
        out = made(own, others, seen if masked else None)
        expected = plain(dict(made.named_parameters()), own, others, seen)
    torch.testing.assert_close(out.mixed, expected)
    sums = out.weights.sum(dim=3)
    assert set(sums.round(decimals=9).unique().tolist()) == ({0.0, 1.0} if masked else {1.0})
    assert not out.weights.diagonal(dim1=2, dim2=3).any()


def learner() -> TD:
    network = NetworkConfig(hidden_width=8, attention_heads=2, attention="additive")
    numbers = TDConfig(attention_logit_penalty=0.1)
    return TD(Team(ROBOTS, 5, 3), network, numbers, seed=1, device=torch.device("cpu"))


def updated(made: TD) -> dict[str, Tensor]:
    for seed in range(2):
        source = torch.Generator().manual_seed(seed)
        obs = torch.randn(2, BATCH, ROBOTS, 5, generator=source)
        actions = torch.randint(3, (BATCH, ROBOTS), generator=source)
        reward = torch.randn(BATCH, ROBOTS, generator=source)
        batch = Transitions(obs[0], actions, reward, obs[1], torch.arange(BATCH) == 0)
        made.observe(batch, torch.zeros(BATCH, dtype=torch.bool))
        made.update(batch)
    return made.state()


@pytest.mark.long
def test_it_is_trained_plain_and_compiled() -> None:
    torch.compiler.reset()
    compiled = learner()
    compiled.compile("aot_eager")
    before, after, found = learner().state(), updated(learner()), updated(compiled)
    names = [name for name in after if name.startswith("critic.attention.")]
    assert sorted(names) == [
        f"critic.attention.{part}" for part in ("key", "query", "score", "value")
    ]
    for name in names:
        assert not torch.equal(after[name], before[name])
        torch.testing.assert_close(found[name], after[name], rtol=1e-4, atol=1e-5)


@pytest.mark.long
def test_its_methods_train_from_the_command_line(
    run_installed: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    assert {"td-additive", "ppo-additive"} < registry.methods().keys()
    options = ["--train.env-steps", "640", "--train.threads", "1", "--td.warmup-env-steps", "64"]
    options += ["--evaluate.episodes", "2", "--evaluate.score-episodes", "2"]
    options += ["--evaluate.long-episodes", "2", "--run-dir", "run"]
    run_installed("additive_attention", "train", "--method", "td-additive", *options)
    line = json.loads((tmp_path / "run" / "metrics.jsonl").read_text().splitlines()[-1])
    assert line["updates"] > 0
    entropies = [value for row in line["attention_entropy"].values() for value in row]
    assert len(entropies) == 4 * 4
    assert all(0.0 < value <= 1.0987 for value in entropies)
