"""The learner of any team, against plain loops on small worlds."""

import pytest
import torch
from random_teams import Size, random_tables
from torch import Tensor

from innerattn.learn.teams import TeamLearner, TeamRollout, Weights
from innerattn.nn.teams import Relations, joined_tables, relate
from innerattn.nn.teams.features import Bodies, Features
from innerattn.nn.teams.frames import turn_back_choices

STEPS, GROUPS, WORLDS = 6, 2, 8
IMITATION = Weights(learning_rate=3e-3, imitation=1.0, policy=0.0, entropy=0.0)
POLICY = Weights(learning_rate=3e-3, imitation=0.0, policy=1.0, entropy=0.01)


def learner(seed: int = 0, *, features: Features = "all", bodies: Bodies = "told") -> TeamLearner:
    return TeamLearner(
        width=16,
        pooling="inner",
        key_width=8,
        features=features,
        bodies=bodies,
        gamma=0.9,
        gae_lambda=0.7,
        clip=0.2,
        seed=seed,
    )


def worlds(seed: int) -> Relations:
    sizes = (Size(worlds=4, robots=3), Size(worlds=4, robots=5, victims=2))
    return relate(joined_tables([random_tables(size, seed + k) for k, size in enumerate(sizes)]))


def rollout(one: TeamLearner, seed: int = 0) -> tuple[TeamRollout, Relations]:
    """Steps through unrelated worlds; the script wants to go to the centre from afar."""
    torch.manual_seed(seed)
    steps = TeamRollout()
    for step in range(STEPS):
        seen = worlds(10 * (seed + 1) + step)
        actions, log_probs = one.act(seen)
        to_centre = turn_back_choices(torch.eye(5)[1].expand(len(actions), -1), seen.home_frames)
        far = seen.homes[:, 10] > 0.3
        steps.seen.append(seen)
        steps.actions.append(actions)
        steps.log_probs.append(log_probs)
        steps.wanted.append(torch.where(far, to_centre.argmax(1), 0))
        steps.rewards.append(torch.rand(WORLDS))
        steps.terminated.append(torch.rand(WORLDS) < 0.1)
        steps.ended.append(steps.terminated[-1] | (torch.rand(WORLDS) < 0.2))
        steps.following.append(torch.randn(WORLDS) * (steps.ended[-1] & ~steps.terminated[-1]))
    return steps, worlds(99)


def weights_of(one: TeamLearner) -> Tensor:
    networks = (one.actor, one.critic)
    return torch.cat([p.detach().flatten() for net in networks for p in net.parameters()])


def test_some_worlds_take_the_likeliest_actions() -> None:
    """The four worlds of a team of three come first; then those of a team of five."""
    seen, in_these = worlds(3), torch.arange(WORLDS) % 3 == 0
    drawn, likely, both = (
        learner(1).act(seen, greedy=greedy)[0] for greedy in (False, True, in_these)
    )
    of_robots = torch.cat([in_these[:4].repeat_interleave(3), in_these[4:].repeat_interleave(5)])
    assert torch.equal(both, torch.where(of_robots, likely, drawn))
    assert not torch.equal(drawn, likely)


def test_imitation_comes_to_agree() -> None:
    one = learner()
    agreement = [one.learn(*rollout(one, k % 3), GROUPS, IMITATION)["agreement"] for k in range(25)]
    assert agreement[-1] > 0.8
    assert agreement[-1] > agreement[0] + 0.1


def test_what_pays_becomes_likelier() -> None:
    """The team is paid for each robot that stays; advantages know no single robot."""
    one = learner()

    def share(steps: TeamRollout) -> float:
        return float(torch.cat(steps.actions).eq(0).float().mean())

    first, _ = rollout(one)
    for k in range(40):
        steps, after = rollout(one, k % 3)
        for step, seen in enumerate(steps.seen):
            world = seen.robot_cells // seen.times.shape[1]
            paid = torch.zeros(WORLDS).index_add(0, world, steps.actions[step].eq(0).float())
            steps.rewards[step] = paid
            steps.terminated[step] = steps.ended[step] = torch.ones(WORLDS, dtype=torch.bool)
        one.learn(steps, after, GROUPS, POLICY)
    last, _ = rollout(one)
    assert share(first) < 0.5
    assert share(last) > share(first) + 0.1


def test_equal_seeds_learn_equal_weights() -> None:
    found = []
    for seed in (3, 3, 4):
        one = learner(seed)
        one.learn(*rollout(one), GROUPS, IMITATION)
        one.learn(*rollout(one), GROUPS, POLICY)
        found.append(weights_of(one))
    assert torch.equal(found[0], found[1])
    assert not torch.equal(found[0], found[2])


def test_targets_are_those_of_plain_loops() -> None:
    one = learner()
    steps, after = rollout(one)
    values = [one.values(seen).tolist() for seen in (*steps.seen, after)]
    advantage, target = one._targets(steps, after, GROUPS)
    returns = target * one._std + one._mean
    raw = torch.zeros(STEPS, WORLDS)
    for world in range(WORLDS):
        later = 0.0
        for step in reversed(range(STEPS)):
            ended, over = bool(steps.ended[step][world]), bool(steps.terminated[step][world])
            following = float(steps.following[step][world]) if ended else values[step + 1][world]
            error = float(steps.rewards[step][world]) - values[step][world]
            error += 0.0 if over else 0.9 * following
            later = error + (0.0 if ended else 0.9 * 0.7 * later)
            raw[step, world] = later
            assert float(returns[step, world]) == pytest.approx(
                later + values[step][world], abs=1e-4
            )
    for group in range(GROUPS):
        rows = raw[:, 4 * group : 4 * group + 4]
        expected = (rows - rows.mean()) / (rows.std() + 0.02)
        torch.testing.assert_close(
            advantage[:, 4 * group : 4 * group + 4], expected, atol=1e-4, rtol=1e-4
        )


def test_values_stay_when_returns_are_scaled_anew() -> None:
    one = learner()
    steps, after = rollout(one)
    steps.rewards = [100.0 + 7.0 * reward for reward in steps.rewards]
    before = one.values(after)
    one._targets(steps, after, GROUPS)
    assert float(one._std) > 2.0
    torch.testing.assert_close(one.values(after), before, atol=1e-3, rtol=1e-4)


def test_the_loss_of_the_policy_is_clipped() -> None:
    one = learner()
    steps, _ = rollout(one)
    seen, size = steps.seen[0], steps.seen[0].times.shape[1]
    steps.log_probs[0] = steps.log_probs[0] + 0.5 * torch.randn_like(steps.log_probs[0])
    advantage = torch.randn(WORLDS)
    target = one.critic(seen).detach()
    loss, found = one._loss(steps, 0, advantage, target, POLICY)
    now = one.actor(seen).detach()
    gains = []
    for robot, action in enumerate(steps.actions[0].tolist()):
        ratio = float((now[robot, action] - steps.log_probs[0][robot]).exp())
        gain = float(advantage[int(seen.robot_cells[robot]) // size])
        gains.append(min(ratio * gain, min(max(ratio, 0.8), 1.2) * gain))
    expected = -sum(gains) / len(gains) - 0.01 * float(found["entropy"])
    assert float(loss.detach()) == pytest.approx(expected, abs=1e-5)
    assert float(found["kl"]) > 0.0


@pytest.mark.parametrize("bodies", ["told", "hidden"])
def test_weights_of_hidden_columns_stay_zero(bodies: Bodies) -> None:
    one = learner(features="plain", bodies=bodies)
    pairs, homes = {1, 5, 7, 8, 14, 15, 17, 18, 19, 20, 26}, {6, 8, 9, *range(16, 25)}
    if bodies == "hidden":
        pairs, homes = pairs | {9, 10}, homes | {0, 1, 2}
    first, fourth, home = (
        layer.weight.detach().clone()
        for layer in (one.actor.first, one.actor.fourth, one.actor.home)
    )
    for seed, weights in enumerate((IMITATION, POLICY, POLICY)):
        steps, after = rollout(one, seed)
        one.learn(steps, after, GROUPS, weights)
    for layer, before, columns, width in (
        (one.actor.first, first, pairs, 27),
        (one.actor.fourth, fourth, {*pairs, *range(35, 46)}, 46),
        (one.actor.home, home, homes, 25),
    ):
        empty = (layer.weight == 0.0).all(0).nonzero().squeeze(1).tolist()
        assert set(empty) == columns
        changed = (layer.weight != before).any(0)[:width].nonzero().squeeze(1).tolist()
        assert set(changed) == set(range(width)) - columns
