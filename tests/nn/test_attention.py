"""Properties of the attentions."""

import pytest
import torch
from torch import Tensor

from innerattn.learn.adam import Network
from innerattn.learn.compiled import traced
from innerattn.nn import Critic, InnerAttention, MaxAttention, NoAttention, UniformAttention

WIDTH, HEADS, BATCH = 8, 2, 5
KINDS = [InnerAttention, UniformAttention, MaxAttention]


def make(kind: type, seed: int = 0):
    return kind(WIDTH, HEADS, torch.Generator().manual_seed(seed)).double()


def encodings(robots: int, seed: int = 1) -> tuple[Tensor, Tensor]:
    source = torch.Generator().manual_seed(seed)
    shape = (2, robots, BATCH, WIDTH)
    own, others = 3 * torch.randn(shape, generator=source, dtype=torch.float64)
    return own, others


def values(attention, others: Tensor) -> Tensor:
    x = others @ attention.value.detach().T + attention.value_bias.detach()
    return torch.where(x > 0, x, 0.01 * x)


@pytest.mark.parametrize("robots", [2, 3, 6])
def test_uniform_attention_is_the_mean_of_the_teammates(robots: int) -> None:
    attention = make(UniformAttention)
    own, others = encodings(robots)
    out = attention(own, others)
    v = values(attention, others)
    for i in range(robots):
        mean = torch.stack([v[j] for j in range(robots) if j != i]).mean(0)
        torch.testing.assert_close(out.mixed[i], mean)
    assert out.scores is None
    expected = (torch.ones(robots, robots) - torch.eye(robots)) / (robots - 1)
    torch.testing.assert_close(out.weights, expected.double().expand(BATCH, HEADS, -1, -1))


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("robots", [1, 2, 3, 6])
def test_max_attention_beside_plain_loops(robots: int, masked: bool) -> None:
    attention = make(MaxAttention)
    own, others = encodings(robots)
    drawn = torch.rand((BATCH, robots), generator=torch.Generator().manual_seed(2)) > 0.5
    out = attention(own, others, drawn if masked else None)
    v = values(attention, others)
    for i in range(robots):
        for b in range(BATCH):
            seen = [j for j in range(robots) if j != i and (drawn[b, j] or not masked)]
            shares = torch.zeros(HEADS, robots, dtype=torch.float64)
            for feature in range(WIDTH):
                most = max(seen, key=lambda j: v[j, b, feature], default=None)
                if most is not None:
                    shares[feature * HEADS // WIDTH, most] += HEADS / WIDTH
                assert out.mixed[i, b, feature] == (0.0 if most is None else v[most, b, feature])
            torch.testing.assert_close(out.weights[b, :, i], shares)
    assert out.scores is None


def test_the_largest_values_alone_get_a_gradient() -> None:
    attention = make(MaxAttention)
    own, others = encodings(4)
    others.requires_grad_()
    attention(own, others).mixed[0].sum().backward()
    assert not others.grad[0].any()  # a robot is not its own teammate
    assert others.grad[1:].any(2).any(1).all()


@pytest.mark.parametrize("kind", [MaxAttention, NoAttention])
def test_a_compiled_critic_gives_the_same_values(kind: type) -> None:
    source = torch.Generator().manual_seed(0)
    critic = Critic(4, 6, 5, kind(8, 2, source), source)
    obs = torch.randn(4, 7, 6, generator=source)
    actions = torch.randint(0, 5, (4, 7), generator=source)
    for available in (None, torch.rand((7, 4), generator=source) > 0.4):
        compiled = traced(Network(critic))(obs, actions, available)
        torch.testing.assert_close(compiled.q, critic(obs, actions, available).q)


def test_without_attention_a_value_depends_on_the_robot_alone() -> None:
    source = torch.Generator().manual_seed(0)
    critic = Critic(3, 6, 5, NoAttention(8, 2, source), source)
    obs = torch.randn(3, 4, 6, generator=source)
    actions = torch.zeros(3, 4, dtype=torch.int64)
    before = critic(obs, actions)
    assert not before.attended.weights.any()
    assert not before.attended.visible.any()
    obs[1:] += 1.0
    actions[1:] = 2
    after = critic(obs, actions).q
    assert torch.equal(after[0], before.q[0])
    assert not torch.equal(after[1], before.q[1])


@pytest.mark.parametrize("kind", KINDS)
def test_permuting_teammates_permutes_the_weights(kind: type) -> None:
    attention = make(kind)
    own, others = encodings(4)
    order = torch.tensor([0, 3, 1, 2])
    before, after = attention(own, others), attention(own[order], others[order])
    torch.testing.assert_close(after.weights, before.weights[:, :, order][..., order])
    torch.testing.assert_close(after.mixed, before.mixed[order])


def test_learnt_weights_depend_on_who_asks_and_who_is_asked() -> None:
    own, others = encodings(4)
    weights = make(InnerAttention)(own, others).weights
    assert weights.std(dim=(0, 1)).flatten()[1:4].min() > 0.05
    assert (weights[:, 0] - weights[:, 1]).abs().max() > 0.1  # heads differ


@pytest.mark.parametrize("kind", KINDS)
def test_one_robot_alone_gets_nothing_and_two_get_each_other(kind: type) -> None:
    attention = make(kind)
    alone = attention(*encodings(1))
    assert not alone.mixed.any()
    assert not alone.weights.any()
    own, others = encodings(2)
    both = attention(own, others)
    torch.testing.assert_close(both.mixed, values(attention, others).flip(0))


@pytest.mark.parametrize("kind", KINDS)
def test_unavailable_teammates_are_not_seen(kind: type) -> None:
    attention = make(kind)
    own, others = encodings(4)
    available = torch.ones(BATCH, 4, dtype=torch.bool)
    available[0, 2] = False
    available[1] = False
    available[2, 1:] = False  # the first robot sees nobody, the rest only the first
    out = attention(own, others, available)
    assert not out.weights[0, :, :, 2].any()
    assert not out.weights[1].any()
    assert not out.weights[2, :, 0].any()
    assert (out.weights[2, :, 1:, 0] == 1).all()
    sums = out.weights.sum(3)
    expected = (available.unsqueeze(1) & ~torch.eye(4, dtype=torch.bool)).any(2)
    torch.testing.assert_close(sums, expected.unsqueeze(1).expand(-1, HEADS, -1).double())
    assert not out.mixed[:, 1].any()
    changed = others.clone()
    changed[2, 0] += 100.0
    assert torch.equal(attention(own, changed, available).mixed[:, 0], out.mixed[:, 0])
    # Those who see all teammates get what they get without a mask.
    torch.testing.assert_close(out.weights[3:], attention(own, others).weights[3:])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("robots", [1, 3])
def test_gradients_are_finite_even_for_huge_scores_and_lonely_robots(
    kind: type, robots: int
) -> None:
    attention = make(kind)
    own, others = (1e3 * x for x in encodings(robots))
    available = torch.zeros(BATCH, robots, dtype=torch.bool)
    available[1:] = True
    out = attention(own.requires_grad_(), others.requires_grad_(), available)
    out.mixed.square().sum().backward()
    for gradient in (own.grad, others.grad, attention.value.grad):
        assert gradient is None or gradient.isfinite().all()
    assert out.weights.isfinite().all()


@pytest.mark.parametrize("kind", KINDS)
def test_heads_must_divide_the_width(kind: type) -> None:
    with pytest.raises(ValueError, match=r"width = 8.*3 attention heads"):
        kind(8, 3, torch.Generator())
