"""An update as one compiled graph does what it does operation by operation, in float64."""

import warnings
from collections.abc import Callable, Sequence

import pytest
import torch
from torch import Tensor
from torch.fx import GraphModule

from innerattn.config import NetworkConfig, PPOConfig, TDConfig
from innerattn.learn import PPO, TD, Team, Transitions
from innerattn.learn.actor_critic import ActorCritic
from innerattn.nn import EntityColumns, Hearing

NETWORK = {"hidden_width": 8, "attention_heads": 2}
AVAILABLE = 4  # column of the observation
BY_KIND = {"attention": "inner", "parameter_sharing": "kind"}
ENTITIES = {"attention": "inner", "encoder": "entities"}
ENVS, STEPS = 6, 4


@pytest.fixture(autouse=True)
def _nothing_compiled() -> None:
    torch.compiler.reset()  # beyond a few forms of one function torch gives up


def columns(robots: int) -> EntityColumns:
    sizes = 5, robots - 1, 2, 2, 2, 0
    return EntityColumns(*sizes, teammate_place=(0, 1), victim_place=(0, 1))


def make(algorithm: str, robots: int, network: dict, numbers: dict) -> ActorCritic:
    team = Team(
        robots,
        columns(robots).width,
        3,
        kinds=("one", *["another"] * (robots - 1)),
        availability_column=AVAILABLE,
        entities=columns(robots),
        hearing=Hearing(AVAILABLE, (), tuple((5 + 2 * k, 6 + 2 * k) for k in range(robots - 1))),
    )
    given = NetworkConfig(**NETWORK, **network)
    common = {"critic_weight_decay": 0.01, "attention_logit_penalty": 0.1, **numbers}
    extra = {
        "seed": 3,
        "device": torch.device("cpu"),
        "dtype": torch.float64,
    }
    if algorithm == "td":
        few = {"batch_size": 7, "warmup_env_steps": 0, "update_every_env_steps": 12}
        return TD(team, given, TDConfig(**few, **common), **extra)
    few = {"minibatch_size": 12, "epochs": 1, "rollout_steps": STEPS}
    return PPO(team, given, PPOConfig(**few, **common), **extra)


def transitions(robots: int, seed: int) -> Transitions:
    source, width = torch.Generator().manual_seed(seed), columns(robots).width
    return Transitions(
        torch.randn(ENVS, robots, width, generator=source),
        torch.randint(3, (ENVS, robots), generator=source),
        torch.randn(ENVS, robots, generator=source) + 0.3,
        torch.randn(ENVS, robots, width, generator=source),
        torch.arange(ENVS) % 3 == 0,
    )


def learn(learner: ActorCritic, robots: int) -> list[dict[str, float]]:
    found = []
    for step in range(2 * STEPS):
        learner.observe(transitions(robots, step), torch.zeros(ENVS, dtype=torch.bool))
        learner.set_progress(step / (2 * STEPS))
        metrics = learner.learn()
        found += [] if metrics is None else [metrics]
    return found


def agree(algorithm: str, robots: int, backend: str, network: dict, numbers: dict) -> None:
    plain, compiled = (make(algorithm, robots, network, numbers) for _ in range(2))
    compiled.compile(backend)
    expected, found = learn(plain, robots), learn(compiled, robots)
    assert plain.updates == compiled.updates == 4
    for one, other in zip(expected, found, strict=True):
        assert other == pytest.approx(one, rel=1e-9, abs=1e-9)
    before = make(algorithm, robots, network, numbers).state()
    state: dict[str, Tensor] = compiled.state()
    for name, tensor in plain.state().items():
        torch.testing.assert_close(state[name], tensor, rtol=1e-9, atol=1e-9)
        trained = network["attention"] == "inner" or name.split(".")[-1] not in ("query", "key")
        if name.startswith(("actor.", "critic.")) and trained and robots > 2:
            assert not torch.equal(state[name], before[name]), name


@pytest.mark.parametrize(
    ("algorithm", "robots", "attention"),
    [
        ("td", 4, "inner"),
        pytest.param("ppo", 4, "uniform", marks=pytest.mark.slow),
        pytest.param("ppo", 1, "inner", marks=pytest.mark.slow),
        pytest.param("td", 1, "inner", marks=pytest.mark.slow),
        pytest.param("td", 4, "uniform", marks=pytest.mark.slow),
        pytest.param("ppo", 4, "inner", marks=pytest.mark.slow),
    ],
)
def test_the_traced_update_agrees(algorithm: str, robots: int, attention: str) -> None:
    agree(algorithm, robots, "aot_eager", {"attention": attention}, {})


@pytest.mark.parametrize(
    ("algorithm", "attention", "numbers"),
    [
        pytest.param(
            "td",
            "inner",
            {"policy_gradient": "sampled", "entropy_target": "maac"},
            marks=pytest.mark.slow,
        ),
        pytest.param("ppo", "uniform", {"advantage": "value"}, marks=pytest.mark.long),
    ],
)
def test_the_traced_update_agrees_masked_and_clipped(
    algorithm: str, attention: str, numbers: dict
) -> None:
    numbers = numbers | {"critic_grad_clip": 0.3, "actor_grad_clip": 0.02}
    agree(algorithm, 4, "aot_eager", {"attention": attention, "mask_unavailable": True}, numbers)


@pytest.mark.long
def test_the_traced_update_agrees_without_attention() -> None:
    agree("ppo", 4, "aot_eager", {"attention": "none"}, {"advantage": "value"})


@pytest.mark.parametrize(
    ("algorithm", "pooling"),
    [
        pytest.param("ppo", "attention", marks=pytest.mark.long),
        pytest.param("ppo", "nearest", marks=pytest.mark.long),
        pytest.param("td", "mean", marks=pytest.mark.slow),
        pytest.param("td", "max", marks=pytest.mark.slow),
    ],
)
def test_the_traced_update_agrees_by_entities(algorithm: str, pooling: str) -> None:
    agree(algorithm, 4, "aot_eager", ENTITIES | {"pooling": pooling}, {})


@pytest.mark.parametrize(
    "network",
    [
        pytest.param({"symmetry": "canonical"}, marks=pytest.mark.long),
        pytest.param({"message_pooling": "mean"}, marks=pytest.mark.slow),
        pytest.param({"message_pooling": "max"}, marks=pytest.mark.slow),
        pytest.param({"message_pooling": "nearest", **BY_KIND}, marks=pytest.mark.slow),
    ],
)
def test_the_traced_update_agrees_with_messages(network: dict) -> None:
    agree("ppo", 4, "aot_eager", {"attention": "inner", "message_width": 4, **network}, {})


@pytest.mark.long
def test_the_traced_update_agrees_by_kind() -> None:
    agree("td", 4, "aot_eager", {**BY_KIND, "shared_gradients": "mean"}, {})


@pytest.mark.parametrize(
    ("algorithm", "robots"),
    [
        pytest.param("ppo", 4, marks=pytest.mark.long),
        pytest.param("td", 1, marks=pytest.mark.long),
        pytest.param("td", 4, marks=pytest.mark.slow),
    ],
)
def test_the_compiled_update_agrees(algorithm: str, robots: int) -> None:
    agree(algorithm, robots, "inductor", {"attention": "inner"}, {})


def test_advice_of_the_compiler_is_not_passed_on() -> None:
    def advising(graph: GraphModule, _: Sequence[Tensor]) -> Callable[..., Tensor]:
        where = {"filename": "lowering.py", "lineno": 1, "module": "torch._inductor.lowering"}
        warnings.warn_explicit("Cut an issue", UserWarning, **where)
        return graph.forward

    learner = make("ppo", 4, {"attention": "inner"}, {})
    learner.compile(advising)
    assert len(learn(learner, 4)) == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "network",
    [ENTITIES, BY_KIND, *(ENTITIES | {"pooling": one} for one in ("mean", "max", "nearest"))],
    ids=["entities", "kind", "mean", "max", "nearest"],
)
def test_the_compiled_update_agrees_with_other_networks(network: dict) -> None:
    agree("td", 4, "inductor", network, {})
