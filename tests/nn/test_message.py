"""Messages against a plain form that loops over robots, and what holds of them whatever is said."""

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor

from innerattn.config import NetworkConfig
from innerattn.learn import Team
from innerattn.learn.networks import draw_networks
from innerattn.nn import NUM_ELEMENTS, Hearing, ListeningActor, Messages, share_by_kind
from innerattn.nn.message import row_width, with_element
from innerattn.nn.symmetry import between

ROBOTS, WORLDS, WIDTH, HIDDEN = 4, 40, 8, 12
OWN, MATE = 3, 5  # whether it sends and two numbers; place, whether seen, whether heard, a number
OBS_WIDTH = OWN + (ROBOTS - 1) * MATE
POOLINGS = ("attention", "mean", "max", "nearest")


def hearing(*, delay: int = 0, limited: bool = True, sees: bool = False) -> Hearing:
    first = [OWN + k * MATE for k in range(ROBOTS - 1)]
    return Hearing(
        sends=0,
        heard=tuple(k + 3 for k in first) if limited else (),
        places=tuple((k, k + 1) for k in first),
        seen=tuple(k + 2 for k in first) if sees else (),
        delay=delay,
    )


def observations(seed: int, worlds: int = WORLDS) -> Tensor:
    """(R, B, D): everyone may be silent, unheard or unseen; in the first world nobody is heard."""
    source = torch.Generator().manual_seed(seed)
    obs = torch.randn(ROBOTS, worlds, OBS_WIDTH, generator=source, dtype=torch.float64)
    flags = [0, *(OWN + k * MATE + at for k in range(ROBOTS - 1) for at in (2, 3))]
    drawn = torch.rand(ROBOTS, worlds, len(flags), generator=source) < 0.7
    obs[..., flags] = drawn.double()
    obs[:, 0, flags] = 0.0
    return obs


def rows(seed: int, form: Hearing, framed: bool, worlds: int = WORLDS) -> Tensor:
    parts = []
    for k in range(2 if form.delay else 1):
        source = torch.Generator().manual_seed(seed + 50 + k)
        element = torch.randint(NUM_ELEMENTS, (ROBOTS, worlds), generator=source)
        parts.append(with_element(observations(seed + k, worlds), element if framed else None))
    found = torch.cat(parts, dim=2)
    assert found.shape[2] == row_width(OBS_WIDTH, form.delay)
    return found


def messages(pooling: str, form: Hearing, framed: bool) -> Messages:
    source = torch.Generator().manual_seed(5)
    sizes = ROBOTS, OBS_WIDTH, HIDDEN, WIDTH
    return Messages(*sizes, pooling, form, source, turns=framed).double()


Floats = NDArray[np.float64]


def matrix(element: int) -> Floats:
    """Of an element of the group: mirrors x, then y, then swaps both."""
    mirrors = np.diag([-1.0 if element & 1 else 1.0, -1.0 if element & 2 else 1.0])
    return np.array([[0.0, 1.0], [1.0, 0.0]]) @ mirrors if element & 4 else mirrors


def plain(net: Messages, pooling: str, form: Hearing, rows: Tensor) -> Floats:
    """What robots hear (R, B, K), one robot of one world at a time."""
    layers = {name: value.detach().numpy() for name, value in net.named_parameters()}

    def layer(name: str, robot: int, x: Floats) -> Floats:
        return layers[f"{name}.weight"][robot] @ x + layers[f"{name}.bias"][robot]

    def encoded(robot: int, x: Floats) -> Floats:
        hidden = layer("encoder", robot, x)
        return np.where(hidden > 0, hidden, 0.01 * hidden)

    found = np.zeros((ROBOTS, rows.shape[1], WIDTH))
    for world in range(rows.shape[1]):
        now = rows[:, world, : OBS_WIDTH + 1].numpy()
        then = rows[:, world, -OBS_WIDTH - 1 :].numpy()
        for i in range(ROBOTS):
            arrived, distances = [], []
            for k, j in enumerate(j for j in range(ROBOTS) if j != i):
                if then[j, form.sends] <= 0.5:
                    continue
                if form.heard and now[i, form.heard[k]] <= 0.5:
                    continue
                said = np.tanh(layer("output", j, encoded(j, then[j, :-1])))
                quarter = WIDTH // 4
                turn = matrix(int(now[i, -1])) @ matrix(int(then[j, -1])).T
                vectors = turn @ said[2 * quarter :].reshape(2, quarter)
                arrived.append(np.concatenate([said[: 2 * quarter], *vectors]))
                known = not form.seen or now[i, form.seen[k]] > 0.5
                x, y = form.places[k]
                distances.append(np.hypot(now[i, x], now[i, y]) if known else np.inf)
            if not arrived:
                continue
            if pooling == "attention":
                asked = layer("query", i, encoded(i, now[i, :-1]))
                scores = np.exp([asked @ one / np.sqrt(WIDTH) for one in arrived])
                shares = scores / scores.sum()
                found[i, world] = sum(a * one for a, one in zip(shares, arrived, strict=True))
            elif pooling == "mean":
                found[i, world] = np.mean(arrived, axis=0)
            elif pooling == "max":
                found[i, world] = np.max(arrived, axis=0)
            else:
                pairs = zip(distances, arrived, strict=True)
                nearest = [one for at, one in pairs if at == min(distances)]
                found[i, world] = np.mean(nearest, axis=0)
    return found


@pytest.mark.parametrize("pooling", POOLINGS)
@pytest.mark.parametrize("framed", [False, True])
@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize(("limited", "sees"), [(True, False), (True, True), (False, True)])
def test_what_is_heard_is_that_of_loops_over_robots(
    pooling: str, framed: bool, delay: int, limited: bool, sees: bool
) -> None:
    form = hearing(delay=delay, limited=limited, sees=sees)
    net, given = messages(pooling, form, framed), rows(1, form, framed)
    found = net(given)
    expected = plain(net, pooling, form, given)
    np.testing.assert_allclose(found.detach().numpy(), expected, rtol=1e-12, atol=1e-12)
    silent = (expected == 0.0).all(axis=2)
    assert 0 < silent.sum() < silent.size
    assert not found[torch.from_numpy(silent)].any()


@pytest.mark.parametrize("pooling", POOLINGS)
def test_robots_of_a_kind_say_alike(pooling: str) -> None:
    form = hearing()
    net, given = messages(pooling, form, False), rows(2, form, False)
    share_by_kind(net, ["a", "b", "a", "a"])
    alike = messages(pooling, form, False)
    for name, value in alike.named_parameters():
        layer, _, part = name.rpartition(".")
        value.data.copy_(getattr(net.get_submodule(layer), part))
    torch.testing.assert_close(net(given), alike(given), rtol=0, atol=0)


@pytest.mark.parametrize("pooling", POOLINGS)
@pytest.mark.parametrize("framed", [False, True])
def test_the_order_of_teammates_does_not_matter(pooling: str, framed: bool) -> None:
    form = hearing(sees=True, delay=1)
    net, given = messages(pooling, form, framed), rows(3, form, framed)
    expected = net(given)
    for seed in range(6):
        order = torch.randperm(ROBOTS, generator=torch.Generator().manual_seed(seed))
        other = messages(pooling, form, framed)
        for name, value in other.named_parameters():
            value.data.copy_(dict(net.named_parameters())[name][order])
        columns = torch.stack([_columns(int(robot), order) for robot in order])
        weight = other.encoder.weight.data
        other.encoder.weight.data = weight.gather(2, columns[:, None, :].expand_as(weight))
        halves = []
        for half in given[order].split(OBS_WIDTH + 1, dim=2):
            obs = half[..., :-1].gather(2, columns[:, None, :].expand(-1, WORLDS, -1))
            halves.append(torch.cat([obs, half[..., -1:]], dim=2))
        torch.testing.assert_close(other(torch.cat(halves, dim=2)), expected[order])


def _columns(robot: int, order: Tensor) -> Tensor:
    """Where a robot of the first team has the columns that it has in a team of another order."""
    before = [j for j in range(ROBOTS) if j != robot]
    found = list(range(OWN))
    for j in order.tolist():
        if j != robot:
            first = OWN + before.index(j) * MATE
            found += range(first, first + MATE)
    return torch.tensor(found)


@pytest.mark.parametrize("pooling", POOLINGS)
@pytest.mark.parametrize("delay", [0, 1])
def test_turned_worlds_say_the_same_to_the_bit(pooling: str, delay: int) -> None:
    """Turned worlds have the same observations in their frames, which lie otherwise."""
    form = hearing(delay=delay)
    net, given = messages(pooling, form, True), rows(4, form, True)
    expected = net(given)
    for number in range(NUM_ELEMENTS):
        turned = given.clone()
        for column in range(OBS_WIDTH, given.shape[2], OBS_WIDTH + 1):
            element = given[..., column].long()
            turn = torch.full_like(element, number)
            turned[..., column] = between(turn, element).double()
        assert torch.equal(net(turned), expected)
    assert not torch.equal(net(given * (1.0 - _element_columns(given))), expected)


def _element_columns(rows: Tensor) -> Tensor:
    found = torch.zeros(rows.shape[2], dtype=rows.dtype)
    found[OBS_WIDTH :: OBS_WIDTH + 1] = 1.0
    return found


@pytest.mark.parametrize("pooling", POOLINGS)
def test_worlds_of_a_batch_do_not_mix(pooling: str) -> None:
    form = hearing(delay=1)
    net, given = messages(pooling, form, True), rows(6, form, True)
    whole = net(given)
    for chosen in (slice(0, 1), slice(3, 17), slice(17, WORLDS)):
        torch.testing.assert_close(net(given[:, chosen]), whole[:, chosen])


def actor(pooling: str = "attention", **changes: object) -> ListeningActor:
    form = hearing(delay=int(changes.pop("delay", 0)))
    network = NetworkConfig(
        hidden_width=12,
        attention_heads=2,
        message_width=WIDTH,
        message_pooling=pooling,
        **changes,
    )
    team = Team(ROBOTS, OBS_WIDTH, 5, kinds=("a", "a", "b", "b"), hearing=form)
    found, _ = draw_networks(team, network, torch.Generator().manual_seed(2))
    assert isinstance(found, ListeningActor)
    return found.double()


@pytest.mark.parametrize("pooling", POOLINGS)
def test_who_hears_nobody_acts_as_on_zeros(pooling: str) -> None:
    policies, given = actor(pooling), rows(7, hearing(), False)
    deaf = given.clone()
    deaf[..., list(hearing().heard)] = 0.0
    silence = torch.zeros(ROBOTS, WORLDS, WIDTH, dtype=given.dtype)
    expected = policies.network(torch.cat([deaf[..., :OBS_WIDTH], silence], dim=2))
    assert torch.equal(policies(deaf), expected)
    assert not torch.equal(
        policies(given), policies.network(torch.cat([given[..., :OBS_WIDTH], silence], dim=2))
    )


@pytest.mark.parametrize("pooling", POOLINGS)
@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("heard", [(), (1,), (3,), (1, 2), (1, 2, 3)])
def test_a_gradient_reaches_those_who_are_heard_and_no_others(
    pooling: str, delay: int, heard: tuple[int, ...]
) -> None:
    """Of what the first robot decides; the last one is silent, and robot 1 is the nearest."""
    form = hearing(delay=delay)
    policies, given = actor(pooling, delay=delay), rows(8, form, False)
    for first in range(0, given.shape[2], OBS_WIDTH + 1):
        given[:, :, first] = 1.0
        given[3, :, first] = 0.0
    for k, j in enumerate((1, 2, 3)):
        given[0, :, form.heard[k]] = float(j in heard)
        x, y = form.places[k]
        given[0, :, x], given[0, :, y] = float(j), 0.0
    policies(given)[0].square().sum().backward()
    sender = policies.messages.output.weight.grad
    encoder = policies.messages.encoder.weight.grad
    assert sender is not None
    expected = [j for j in heard if j != 3]
    if pooling == "nearest":
        expected = expected[:1]
    assert [j for j in range(ROBOTS) if sender[j].any()] == expected
    reached = [j for j in range(1, ROBOTS) if encoder[j].any()]
    assert reached == expected
    others = policies.network.first.weight.grad
    assert [j for j in range(ROBOTS) if others[j].any()] == [0]


def test_one_robot_hears_nobody() -> None:
    form = Hearing(sends=0, heard=(), places=())
    for pooling in POOLINGS:
        source = torch.Generator().manual_seed(5)
        net = Messages(1, OWN, HIDDEN, WIDTH, pooling, form, source, turns=True)
        assert not net(with_element(torch.ones(1, 3, OWN), None)).any()


def test_rows_end_with_the_elements() -> None:
    obs, element = torch.randn(2, 3, 4), torch.arange(6).view(2, 3)
    found = with_element(obs, element)
    assert torch.equal(found[..., :4], obs)
    assert torch.equal(found[..., 4].long(), element)
    assert not with_element(obs, None)[..., 4].any()


def test_whom_it_hears_is_needed() -> None:
    team = Team(ROBOTS, OBS_WIDTH, 5)
    network = NetworkConfig(hidden_width=12, attention_heads=2, message_width=4)
    with pytest.raises(ValueError, match=r"hearing = None: network.message_width needs"):
        draw_networks(team, network, torch.Generator())
