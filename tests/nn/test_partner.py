"""The controls of learnt attention: right partners beside plain loops, and untrained queries."""

import numpy as np
import pytest
import torch
from torch import Tensor

from innerattn.config import Scenario, load_run_config
from innerattn.envs import BatchEnv
from innerattn.learn.adam import Network
from innerattn.learn.compiled import traced
from innerattn.nn import Critic, FrozenAttention, OracleAttention, PartnerColumns
from innerattn.nn.partner import right_partners
from innerattn.train.build import build_learner
from innerattn.train.columns import partner_columns


def seen(
    preset: str | Scenario, worlds: int = 20, steps: int = 12
) -> tuple[Tensor, PartnerColumns]:
    """Observations (R, B, D) of worlds at play, and their columns."""
    scenario = preset if isinstance(preset, Scenario) else Scenario.preset(preset)
    env = BatchEnv(scenario, worlds, seed=3, num_threads=1)
    draw = np.random.default_rng(0)
    rows = [env.reset()]
    for _ in range(steps):
        rows.append(env.step(draw.integers(0, 5, (worlds, env.num_robots))).obs)
    obs = torch.from_numpy(np.concatenate(rows)).transpose(0, 1)
    return obs, partner_columns(env.observation_names())


def plain(row: Tensor, columns: PartnerColumns, there: list[bool]) -> set[int]:
    """Numbers of the teammates, in the order of their columns, that a robot may attend to."""
    everyone = {number for number, one in enumerate(there) if one}
    if row[columns.victim_present] < 0.5:
        return everyone
    needs = [float(row[column]) for column in columns.victim_needs]
    own = [float(row[column]) > 0.0 for column in columns.abilities]
    if not any(need > 0.0 and can for need, can in zip(needs, own, strict=True)):
        return everyone
    missing = [need - can > 0.0 for need, can in zip(needs, own, strict=True)]
    chosen = set()
    for ability, is_missing in enumerate(missing):
        best, distance = None, float("inf")
        for number in sorted(everyone):
            can = row[columns.teammate_abilities[number][ability]] > 0.0
            if not (is_missing and can):
                continue
            x, y = (float(row[column]) for column in columns.teammate_places[number])
            to_x, to_y = (float(row[column]) for column in columns.victim_place)
            away = (x - to_x) ** 2 + (y - to_y) ** 2
            if away < distance:
                best, distance = number, away
        chosen |= set() if best is None else {best}
    return chosen or everyone


@pytest.mark.parametrize("preset", ["mixed", "single", "mixed-8", "mixed-1-food"])
@pytest.mark.parametrize("masked", [False, True])
def test_the_right_partner_beside_plain_loops(preset: str, masked: bool) -> None:
    obs, columns = seen(preset)
    robots, batch, _ = obs.shape
    drawn = torch.rand((batch, robots), generator=torch.Generator().manual_seed(1)) > 0.4
    available = drawn if masked else None
    found = right_partners(obs, columns, available)
    assert found.shape == (batch, robots, robots)
    alone = 0
    for b in range(batch):
        for i in range(robots):
            teammates = [j for j in range(robots) if j != i]
            there = [available is None or bool(available[b, j]) for j in teammates]
            expected = {teammates[number] for number in plain(obs[i, b], columns, there)}
            assert set(found[b, i].nonzero().flatten().tolist()) == expected
            alone += len(expected) == 1
    assert alone > batch * robots / 4  # the loop has seen partners


def test_rows_of_teammates_tell_who_the_right_partner_is() -> None:
    """Where a robot's row has no teammates, or only near ones, as where it has all of them."""
    scenario = Scenario.preset("mixed-8")
    obs, columns = seen(scenario)
    short, _ = seen(scenario.replace(observed_teammates=1))
    with BatchEnv(scenario.replace(observed_teammates=1), 1) as env:
        shared = partner_columns(env.observation_names(), teammates_in_order=False)
    assert short.shape[2] < obs.shape[2]
    drawn = torch.rand(obs.shape[1::-1], generator=torch.Generator().manual_seed(1)) > 0.4
    for available in (None, drawn):
        found = right_partners(short, shared, available)
        assert torch.equal(found, right_partners(obs, columns, available))


def test_a_victim_with_three_needs_asks_for_two_partners() -> None:
    mixed = Scenario.preset("mixed-8")
    needs = tuple(sorted({ability for robot in mixed.robots for ability in robot.abilities}))
    assert len(needs) == 3
    scenario = mixed.replace(tasks=({"name": "all", "needs": needs},))
    obs, columns = seen(scenario)
    found = right_partners(obs, columns, None)
    robots, batch, _ = obs.shape
    for b in range(batch):
        for i in range(robots):
            teammates = [j for j in range(robots) if j != i]
            expected = {teammates[n] for n in plain(obs[i, b], columns, [True] * (robots - 1))}
            assert len(expected) == 2
            assert set(found[b, i].nonzero().flatten().tolist()) == expected


def test_a_victim_with_two_of_one_need_asks_for_a_robot_of_the_same_kind() -> None:
    columns = PartnerColumns((0,), ((1,), (4,)), ((2, 3), (5, 6)), 7, (8,), (9, 10))
    row = torch.tensor([1.0, 1.0, 3.0, 0.0, 1.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0])
    found = right_partners(row.expand(3, 1, -1), columns, None)
    assert found[0, 0].tolist() == [False, False, True]  # the nearer one
    enough = row.clone()
    enough[8] = 1.0  # what the robot brings itself
    found = right_partners(enough.expand(3, 1, -1), columns, None)
    assert found[0, 0].tolist() == [False, True, True]


def test_a_robot_alone_has_no_partner() -> None:
    columns = PartnerColumns((0,), (), (), 1, (2,), (3, 4))
    assert not right_partners(torch.ones(1, 2, 5), columns, None).any()


@pytest.mark.parametrize("masked", [False, True])
def test_the_critic_gives_the_partner_the_whole_weight(masked: bool) -> None:
    obs, columns = seen("mixed", worlds=5)
    robots, batch, width = obs.shape
    source = torch.Generator().manual_seed(0)
    attention = OracleAttention(8, 2, source)
    attention.partners = columns
    critic = Critic(robots, width, 5, attention, source)
    actions = torch.randint(0, 5, (robots, batch), generator=source)
    available = torch.rand((batch, robots), generator=source) > 0.4 if masked else None
    weights = critic(obs, actions, available).attended.weights
    allowed = right_partners(obs, columns, available).unsqueeze(1)
    expected = allowed / allowed.sum(3, keepdim=True).clamp_min(1)
    assert torch.equal(weights, expected.expand(-1, 2, -1, -1).to(weights.dtype))
    compiled = traced(Network(critic))(obs, actions, available)
    torch.testing.assert_close(compiled.q, critic(obs, actions, available).q)


def test_a_partner_stays_the_partner_in_a_robots_own_frame() -> None:
    config = load_run_config("mixed", "ppo-oracle", "fast")
    assert config.network.symmetry == "canonical"
    obs, columns = seen("mixed", worlds=5)
    with BatchEnv(config.scenario, 5) as env:
        learner = build_learner(config, env)
        rows = obs.transpose(0, 1).contiguous()
        turned, _ = learner.as_seen(rows, torch.zeros(rows.shape[:2], dtype=torch.int64))
    assert not torch.equal(turned, rows)
    after = right_partners(turned.transpose(0, 1), columns, None)
    assert torch.equal(after, right_partners(obs, columns, None))


def test_frozen_queries_and_keys_are_not_trained() -> None:
    attention = FrozenAttention(8, 2, torch.Generator().manual_seed(0))
    trained = {name for name, one in attention.named_parameters() if one.requires_grad}
    assert trained == {"value", "value_bias"}


def test_learners_without_the_columns_are_refused() -> None:
    from innerattn.config import NetworkConfig
    from innerattn.learn.networks import draw_networks
    from innerattn.learn.types import Team

    with pytest.raises(ValueError, match="partners = None"):
        draw_networks(
            Team(4, 44, 5), NetworkConfig(attention="oracle"), torch.Generator().manual_seed(0)
        )
