"""Learners whose networks encode observations by entities."""

import pytest
import torch

from innerattn.config import NetworkConfig, PPOConfig, TDConfig
from innerattn.learn import PPO, TD, Team, Transitions
from innerattn.learn.actor_critic import ActorCritic
from innerattn.learn.framed import FramedLearner
from innerattn.nn import EntityColumns, SquareSymmetry, VectorColumns

ENVS, STEPS, ACTIONS = 8, 4, 5
CPU = torch.device("cpu")


def columns(robots: int) -> EntityColumns:
    sizes = 3, robots - 1, 4, 2, 3, 0
    return EntityColumns(*sizes, teammate_place=(0, 1), victim_place=(1, 2))


def make(algorithm: str, robots: int, encoder: str = "entities", **network: object) -> ActorCritic:
    given = NetworkConfig(hidden_width=32, attention_heads=2, encoder=encoder, **network)
    team = Team(robots, columns(robots).width, ACTIONS, entities=columns(robots))
    extra = {"seed": 1, "device": torch.device("cpu")}
    if algorithm == "td":
        few = TDConfig(batch_size=8, warmup_env_steps=0, update_every_env_steps=8)
        return TD(team, given, few, **extra)
    few = PPOConfig(rollout_steps=STEPS, minibatch_size=16, epochs=2)
    return PPO(team, given, few, **extra)


def observations(robots: int, seed: int) -> torch.Tensor:
    shape = (ENVS, robots, columns(robots).width)
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed))


def transitions(robots: int, seed: int) -> Transitions:
    source = torch.Generator().manual_seed(seed)
    return Transitions(
        observations(robots, seed),
        torch.randint(ACTIONS, (ENVS, robots), generator=source),
        torch.randn(ENVS, robots, generator=source),
        observations(robots, seed + 1),
        torch.arange(ENVS) % 3 == 0,
    )


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
@pytest.mark.parametrize("robots", [1, 4])
@pytest.mark.parametrize(
    ("algorithm", "pooling"),
    [("td", "attention"), ("td", "nearest"), ("ppo", "attention"), ("ppo", "mean"), ("ppo", "max")],
)
def test_updates_change_every_parameter(
    algorithm: str, pooling: str, robots: int, precision: str
) -> None:
    learner = make(algorithm, robots, precision=precision, pooling=pooling)
    before = learner.state()
    for step in range(STEPS):
        learner.observe(transitions(robots, step), torch.zeros(ENVS, dtype=torch.bool))
        learner.learn()
    assert learner.updates == 4
    for name, tensor in learner.state().items():
        assert tensor.isfinite().all(), name
        idle = robots == 1 and name.startswith(("critic.attention.", "critic.action_encoder."))
        if name.startswith(("actor.", "critic.")) and not idle:  # nobody to attend to
            assert not torch.equal(tensor, before[name]), name


@pytest.mark.parametrize("pooling", ["mean", "max", "nearest"])
def test_actors_and_critics_pool_alike_and_nothing_is_kept_of_queries(pooling: str) -> None:
    attending, learner = make("td", 3), make("td", 3, pooling=pooling)
    parts = ("weight", "bias", "weight.exp_avg", "bias.exp_avg")
    encoders = {"actor": ["first"], "critic": ["state_encoder", "action_encoder"]}
    queries = {
        f"{network}{kind}.{encoder}.query.{part}"
        for network, of in encoders.items()
        for encoder in of
        for part in parts
        for kind in (("_adam",) if part.endswith("avg") else ("",))
    }
    assert queries <= attending.state().keys()
    assert not [name for name in learner.state() if name in queries or "first.query" in name]
    assert "critic.attention.query" in learner.state()


@pytest.mark.parametrize("pooling", ["attention", "mean", "max", "nearest"])
def test_the_policy_heeds_no_order_of_teammates_and_victims(pooling: str) -> None:
    learner = make("td", 3, pooling=pooling)
    own, first, second, *victims = observations(3, 0).split([3, 4, 4, 3, 3], dim=2)
    obs = torch.cat([own, first, second, *victims], dim=2)
    other = torch.cat([own, second, first, *reversed(victims)], dim=2)
    for given in (obs, other):
        torch.testing.assert_close(
            learner.actor(given.transpose(0, 1)), learner.actor(obs.transpose(0, 1))
        )


def test_the_attention_of_actors_names_teammates_by_their_number() -> None:
    learner, obs = make("ppo", 4), observations(4, 3)
    found = learner.actor_attention(obs)
    weights = learner.actor.first.teammate_weights(obs.transpose(0, 1))
    assert found is not None
    assert found.shape == (ENVS, 1, 4, 4)
    for i in range(4):
        assert (found[:, :, i, i] == 0.0).all()
        for k, j in enumerate(j for j in range(4) if j != i):
            assert torch.equal(found[:, 0, i, j], weights[i, 0, k])
    torch.testing.assert_close(found.sum(3), torch.ones(ENVS, 1, 4))
    assert (found.amax(3) - found.sum(3) / 3).abs().max() > 0.01  # it is not even


@pytest.mark.parametrize(
    "network",
    [
        {"encoder": "flat"},
        {"pooling": "mean"},
        {"memory_width": 4},
    ],
)
def test_other_actors_have_no_attention(network: dict[str, object]) -> None:
    assert make("ppo", 3, **network).actor_attention(observations(3, 0)) is None


def test_attention_in_a_frame_is_that_to_what_is_seen_there() -> None:
    vectors = VectorColumns(17, ((0, 1), (3, 4), (7, 8)), (), ((0, 1),))
    learner = make("ppo", 3)
    framed = FramedLearner(learner, SquareSymmetry(vectors, CPU), drawn=None)
    drawn = FramedLearner(learner, SquareSymmetry(vectors, CPU), drawn=5)
    obs = observations(3, 0)
    seen, _ = framed.as_seen(obs, torch.zeros(ENVS, 3, dtype=torch.int64))
    assert not torch.equal(seen, obs)
    assert torch.equal(framed.actor_attention(obs), learner.actor_attention(seen))
    assert torch.equal(drawn.actor_attention(obs), learner.actor_attention(obs))


def test_flat_networks_ignore_whose_the_columns_are() -> None:
    given = make("td", 3, encoder="flat").state()
    network = NetworkConfig(hidden_width=32, attention_heads=2)
    team = Team(3, columns(3).width, ACTIONS)
    plain = TD(team, network, TDConfig(), seed=1, device=torch.device("cpu")).state()
    assert given.keys() == plain.keys()
    assert all(torch.equal(tensor, plain[name]) for name, tensor in given.items())


def test_the_nearest_needs_places() -> None:
    network = NetworkConfig(encoder="entities", pooling="nearest")
    team = Team(3, columns(3).width, ACTIONS, entities=EntityColumns(3, 2, 4, 2, 3, 0))
    with pytest.raises(ValueError, match=r"network\.pooling = 'nearest' needs the places"):
        TD(team, network, TDConfig(), seed=1, device=torch.device("cpu"))


@pytest.mark.parametrize("entities", [None, columns(2)])
def test_columns_must_be_those_of_the_observation(entities: EntityColumns | None) -> None:
    network = NetworkConfig(encoder="entities")
    team = Team(3, columns(3).width, ACTIONS, entities=entities)
    with pytest.raises(ValueError, match=r"entities = .*'entities' needs the 17 columns"):
        TD(team, network, TDConfig(), seed=1, device=torch.device("cpu"))
