"""The forms of a compiled update against the plain ones, operation by operation, in float64."""

import pytest
import torch
from torch import Tensor

from innerattn.learn.adam import AdamStepper, Forward, Network
from innerattn.learn.compiled import (
    TracedNetwork,
    TracedStepper,
    fused_dot_product_attention,
    fused_mean_attention,
    traced,
)
from innerattn.nn import (
    Attended,
    Critic,
    InnerAttention,
    TeammateAttention,
    UniformAttention,
    share_by_kind,
)
from innerattn.nn.attention import dot_product_attention, mean_attention

BATCH, WIDTH, HEADS, OBS, ACTIONS = 9, 12, 3, 5, 4


def draw(*shape: int, seed: int = 0) -> Tensor:
    source = torch.Generator().manual_seed(seed)
    return torch.randn(shape, generator=source, dtype=torch.float64)


def availability(robots: int) -> Tensor:
    available = draw(BATCH, robots, seed=7) > 0.0
    available[0] = False
    available[1] = True
    return available


def close(got: Attended, expected: Attended) -> None:
    for one, other in zip(got, expected, strict=True):
        if other is None:
            assert one is None
        else:
            torch.testing.assert_close(one, other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("robots", [1, 2, 5])
def test_the_fused_attentions_agree(robots: int, masked: bool) -> None:
    queries, keys, values = 2.0 * draw(3, robots, BATCH, WIDTH)
    available = availability(robots) if masked else None
    given = (HEADS, available)
    close(
        fused_dot_product_attention(queries, keys, values, *given),
        dot_product_attention(queries, keys, values, *given),
    )
    close(fused_mean_attention(values, *given), mean_attention(values, *given))


def critic(kind: type[TeammateAttention]) -> Critic:
    source = torch.Generator().manual_seed(1)
    made = Critic(4, OBS, ACTIONS, kind(WIDTH, HEADS, source), source)
    share_by_kind(made, ["food", "food", "medical", "food"])
    return made.double()


def loss_of(forward: Forward) -> tuple[Tensor, Tensor]:
    obs, actions = draw(4, BATCH, OBS), torch.arange(4 * BATCH).view(4, BATCH) % ACTIONS
    q = forward(obs, actions, availability(4)).q
    return q.square().mean() - q[0].mean(), q.detach().mean()


@pytest.mark.parametrize("kind", [InnerAttention, UniformAttention])
def test_gradients_and_steps_agree(kind: type[TeammateAttention]) -> None:
    plain, fast = AdamStepper(critic(kind), 0.1), traced(AdamStepper(critic(kind), 0.1))
    assert isinstance(fast, TracedStepper)
    names = {name for name, value in critic(kind).named_parameters() if value.requires_grad}
    before = {name: value.clone() for name, value in plain.values.items()}
    for rate in (0.01, 0.02, 0.005):
        expected, mean = plain.gradients(loss_of)
        with torch.no_grad():
            found, fast_mean = fast.gradients(loss_of)
        assert found.keys() == expected.keys() == names
        for name in names:
            torch.testing.assert_close(found[name], expected[name], rtol=1e-10, atol=1e-12)
        torch.testing.assert_close(fast_mean, mean)
        for one, gradients in ((plain, expected), (fast, found)):
            with torch.no_grad():
                one.step(gradients, torch.tensor(rate, dtype=torch.float64))
    for name, value in plain.values.items():
        torch.testing.assert_close(fast.values[name], value, rtol=1e-10, atol=1e-10)
        assert torch.equal(value, before[name]) == (name not in names)


def test_a_traced_network_sees_what_the_plain_one_is_given() -> None:
    module = critic(InnerAttention)
    plain = Network(module)
    fast = traced(plain)
    assert type(fast) is TracedNetwork
    with torch.no_grad():
        module.output.bias.add_(3.0)  # the given layer's parameter, not a copy's
        before = loss_of(plain)[0]
        torch.testing.assert_close(loss_of(fast)[0], before)
        for value in fast.values.values():
            value.mul_(0.5)
        assert (loss_of(plain)[0] - before).abs() > 1e-3
        torch.testing.assert_close(loss_of(fast)[0], loss_of(plain)[0])
    assert module.attention.attend is dot_product_attention
    assert fast.module.attention.attend is fused_dot_product_attention
