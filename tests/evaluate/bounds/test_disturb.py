"""What disturbing a robot moves, against plain loops; ascent against draws."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from plain_critic import (
    DRAWS,
    B,
    D,
    H,
    Plain,
    W,
    make_actor,
    make_critic,
    make_states,
    plain_found,
    some_changes,
)
from torch import Tensor

from innerattn.evaluate.bounds.disturb import disturb
from innerattn.evaluate.bounds.inequalities import logit_slopes, violated
from innerattn.evaluate.bounds.perturbation import strongest_change
from innerattn.evaluate.bounds.response import respond_to_embedding, respond_to_observation


@pytest.mark.parametrize("changed", ["embedding", "observation"])
@pytest.mark.parametrize(("robots", "masked"), [(2, False), (3, False), (4, True)])
def test_everything_against_plain_loops(changed: str, robots: int, masked: bool) -> None:
    critic, states = make_critic(robots), make_states(robots, masked)
    change = some_changes(robots, W if changed == "embedding" else D)
    found = disturb(critic, make_actor(robots), states, changed, "random", change)
    short = {"embedding": "embedding", "observation": "obs"}[changed]
    sides, moved = plain_found(critic, states, short, change)
    assert found.sides.keys() == sides.keys()
    for name, both in sides.items():
        np.testing.assert_allclose(found.sides[name], np.array(both).T, rtol=1e-9, atol=1e-13)
    assert found.moved.keys() - {"actor_flips"} == moved.keys()
    for name, values in moved.items():
        np.testing.assert_allclose(found.moved[name], values, rtol=1e-9, atol=1e-13)


def test_actor_flips_against_a_plain_loop() -> None:
    actor, states, change = make_actor(3), make_states(3), 4.0 * some_changes(3, D)
    found = disturb(make_critic(3), actor, states, "observation", "random", change)
    expected = []
    for j, m, b in product(range(3), range(DRAWS), range(B)):
        obs = states.obs[:, b : b + 1].clone()
        before = actor(obs)[:, :, 0].argmax(1)
        obs[j, 0] += change[j, m, b]
        after = actor(obs)[:, :, 0].argmax(1)
        assert (after == before).sum() >= 2  # nobody else acts otherwise
        expected.append(bool(after[j] != before[j]))
    assert found.moved["actor_flips"].tolist() == expected
    assert 0 < sum(expected) < len(expected)


@pytest.mark.parametrize("direction", ["gradient", "gradient_own"])
def test_ascent_is_at_least_as_strong_as_any_draw(direction: str) -> None:
    robots = 3
    critic, states, drawn = make_critic(robots), make_states(robots), some_changes(robots, D)
    which = 1 if direction == "gradient" else 0
    encodings = critic.encode(states.obs, states.actions)
    query, key = critic.attention.query, critic.attention.key
    matrices = (query, key) if which == 1 else (key, query)
    slopes = logit_slopes(encodings[1 - which], *matrices, H)

    def encode(obs: Tensor) -> Tensor:
        return critic.encode(obs, states.actions.repeat(1, obs.shape[1] // B))[which]

    found = strongest_change(encode, states.obs, slopes.directions, drawn, steps=8)
    assert found.shape == (robots, robots * H, B, D)
    assert found.norm(dim=3).max() <= 0.7 * (1 + 1e-12)

    def height(j: int, o: int, h: int, b: int, change: Tensor) -> float:
        obs = states.obs.clone()
        obs[j, b] += change
        moved = encode(obs)[j, b] - encodings[which][j, b]
        return abs(float(slopes.directions[o, h, b] @ moved))

    ahead = 0
    for j, o, h, b in product(range(robots), range(robots), range(H), range(B)):
        climbed = height(j, o, h, b, found[j, o * H + h, b])
        best = max(height(j, o, h, b, drawn[j, m, b]) for m in range(DRAWS))
        assert climbed >= best * (1 - 1e-12)
        ahead += climbed > 1.05 * best
    assert ahead > 0.5 * robots**2 * H * B


def test_ascent_on_an_embedding_finds_the_exact_optimum_of_what_it_aims_at() -> None:
    critic, actor, states = make_critic(3), make_actor(3), make_states(3)
    found = disturb(critic, actor, states, "embedding", "gradient", some_changes(3, W))
    reached, bound = found.sides["logit_sharp"]  # for S_ij, linear in e_j, it can be attained
    assert len(reached) == 3 * 2 * H * B
    assert (reached / bound).min() > 0.999
    assert not violated(reached, bound).any()


def test_own_logits_are_moved_further_by_what_aims_at_them() -> None:
    critic, actor, states = make_critic(3), make_actor(3), make_states(3)
    change = some_changes(3, D)
    drawn = disturb(critic, actor, states, "observation", "random", change)
    aimed = disturb(critic, actor, states, "observation", "gradient_own", change)
    assert aimed.sides["own_logit"][0].median() > 1.5 * drawn.sides["own_logit"][0].median()
    assert aimed.sides.keys() == {"own_logit", "own_logit_sharp", "own_row", "own_row_sharp"}
    assert aimed.moved.keys() == {"own_values", "own_flips", "actor_flips"}


@pytest.mark.parametrize("respond", [respond_to_embedding, respond_to_observation])
def test_only_one_logit_of_a_teammates_row_moves(respond: Callable) -> None:
    critic, states = make_critic(4), make_states(4)
    change = some_changes(4, W if respond is respond_to_embedding else D)
    response = respond(critic, states, change)
    for j, m, b in product(range(4), range(DRAWS), range(B)):
        kind = "embedding" if respond is respond_to_embedding else "obs"
        old, new = (
            Plain(critic, states, b),
            Plain(critic, states, b, **{kind: {j: change[j, m, b]}}),
        )
        rows = [i for i in range(4) if i != j]
        still = [k for k in range(4) if k != j]
        np.testing.assert_array_equal(new.S[:, rows][:, :, still], old.S[:, rows][:, :, still])
        # The others' weights shrink or grow by one factor, by as much in all as this one gains.
        total = abs(new.alpha - old.alpha)[:, rows].sum(2)
        np.testing.assert_allclose(response.weights[j, m, b][:, rows].abs() * 2, total, rtol=1e-9)
