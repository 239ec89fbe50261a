"""Products of less precision change an update a little, and no weight's type."""

import pytest
import torch

from innerattn.config import NetworkConfig, TDConfig
from innerattn.learn import TD, Team, Transitions, td

BATCH = 64


def transitions() -> Transitions:
    source = torch.Generator().manual_seed(5)
    return Transitions(
        torch.randn(BATCH, 4, 6, generator=source),
        torch.randint(3, (BATCH, 4), generator=source),
        torch.randn(BATCH, 4, generator=source),
        torch.randn(BATCH, 4, 6, generator=source),
        torch.arange(BATCH) % 3 == 0,
    )


def updated(precision: str, attention: str, *, compiled: bool) -> tuple[TD, dict[str, float]]:
    network = NetworkConfig(
        hidden_width=16, attention_heads=2, attention=attention, precision=precision
    )
    numbers = TDConfig(batch_size=BATCH, replay_capacity=BATCH)
    learner = TD(Team(4, 6, 3), network, numbers, seed=0, device=torch.device("cpu"))
    learner.replay.add(transitions())
    if compiled:
        learner.compile("aot_eager")
    for _ in range(3):
        values = learner.update(transitions())
    return learner, dict(zip(td._METRICS, values.tolist(), strict=True))


@pytest.mark.parametrize(
    ("attention", "compiled"),
    [
        ("inner", False),
        ("uniform", False),
        pytest.param("inner", True, marks=pytest.mark.long),
        pytest.param("uniform", True, marks=pytest.mark.slow),
    ],
)
def test_bfloat16_is_nearly_float32(attention: str, compiled: bool) -> None:
    exact, expected = updated("float32", attention, compiled=compiled)
    rough, found = updated("bfloat16", attention, compiled=compiled)
    assert found == pytest.approx(expected, rel=0.1, abs=0.02)
    assert found != expected
    state = rough.state()
    for name, tensor in exact.state().items():
        assert state[name].dtype == tensor.dtype
    assert {tensor.dtype for name, tensor in state.items() if name.startswith("critic.")} == {
        torch.float32
    }
    obs = transitions().obs
    logits = rough.actor(obs.transpose(0, 1))  # acting is exact
    assert torch.equal(rough.act(obs, greedy=True), logits.argmax(dim=1).t())
