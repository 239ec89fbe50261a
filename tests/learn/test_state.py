"""What a learner gives out and takes back."""

import pytest
import torch
from torch import Tensor

from innerattn.config import NetworkConfig, TDConfig
from innerattn.learn import TD, Team, Transitions


def make(attention: str = "inner", seed: int = 0) -> TD:
    network = NetworkConfig(hidden_width=8, attention_heads=2, attention=attention)
    numbers = TDConfig(batch_size=8, replay_capacity=64)
    return TD(Team(3, 4, 5), network, numbers, seed=seed, device=torch.device("cpu"))


def batch(seed: int) -> Transitions:
    source = torch.Generator().manual_seed(seed)
    return Transitions(
        torch.randn(8, 3, 4, generator=source),
        torch.randint(5, (8, 3), generator=source),
        torch.randn(8, 3, generator=source),
        torch.randn(8, 3, 4, generator=source),
        torch.zeros(8, dtype=torch.bool),
    )


def equal(left: dict[str, Tensor], right: dict[str, Tensor]) -> bool:
    return left.keys() == right.keys() and all(torch.equal(left[k], right[k]) for k in left)


@pytest.mark.parametrize("attention", ["inner", "uniform"])
def test_a_loaded_learner_equals_the_saved_one(attention: str) -> None:
    saved, other = make(attention), make(attention, seed=1)
    for seed in range(3):
        saved.update(batch(seed))
    state = saved.state()
    assert {"updates", "critic.attention.query", "critic_adam.attention.value.exp_avg"} <= set(
        state
    )
    other.load(state)
    assert other.updates == 3
    assert equal(other.state(), state)
    obs = batch(9).obs
    assert torch.equal(other.act(obs, greedy=True), saved.act(obs, greedy=True))
    # The moments of the optimisers count too: the critic's next step is the same.
    other._noise.set_state(saved._noise.get_state())
    for learner in (saved, other):
        learner.update(batch(7))
    assert equal(other.state(), saved.state())


def test_a_state_is_a_copy() -> None:
    learner = make()
    state = learner.state()
    before = {name: tensor.clone() for name, tensor in state.items()}
    learner.update(batch(0))
    assert equal(state, before)
    assert not equal(learner.state(), before)


def test_both_attentions_have_the_same_parameters() -> None:
    inner, uniform = make("inner").state(), make("uniform").state()
    assert equal(inner, uniform)


NAME = "critic.attention.key"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda state: state.pop(NAME), f"no tensor '{NAME}'"),
        (lambda state: state.update(extra=torch.zeros(1)), "unknown tensor 'extra'"),
        (lambda state: state.update({NAME: torch.zeros(8, 7)}), r"\(8, 7\): must be .*\(8, 8\)"),
        (lambda state: state.update({NAME: torch.zeros(8, 8).double()}), "torch.float64 .*float32"),
        (lambda state: state.update(updates=torch.tensor(1.0)), "'updates'.*float32.*int64"),
    ],
)
def test_a_wrong_state_is_refused_and_changes_nothing(change, message: str) -> None:
    learner, other = make(), make(seed=1)
    other.update(batch(0))
    state, before = other.state(), learner.state()
    change(state)
    with pytest.raises(ValueError, match=message):
        learner.load(state)
    assert equal(learner.state(), before)
    assert learner.updates == 0
