"""Networks with a memory, against torch's own unit, and step by step."""

import pytest
import torch
from torch import Tensor, nn

from innerattn.config import NetworkConfig
from innerattn.learn import Team
from innerattn.learn.networks import draw_networks
from innerattn.nn import NUM_ELEMENTS, Memory, SquareSymmetry, VectorColumns
from innerattn.nn.memory import turned_memory
from innerattn.nn.symmetry import between, inverse

ROBOTS, OBS_WIDTH, WIDTH, STEPS, WORLDS, ACTIONS = 3, 6, 8, 5, 4, 5
# two vectors and two numbers
COLUMNS = VectorColumns(width=OBS_WIDTH, vectors=((0, 1), (3, 4)), handed=(), anchors=((0, 1),))
SYMMETRY = SquareSymmetry(COLUMNS, torch.device("cpu"))


def networks(**changes: object):
    given = {"hidden_width": 16, "attention_heads": 2, "memory_width": WIDTH, **changes}
    team = Team(ROBOTS, OBS_WIDTH, ACTIONS, kinds=("a", "a", "b"))
    return draw_networks(team, NetworkConfig(**given), torch.Generator().manual_seed(1))


def sequences() -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Observations and actions of some worlds, what was remembered before, and new episodes."""
    source = torch.Generator().manual_seed(7)
    obs = torch.randn(ROBOTS, STEPS, WORLDS, OBS_WIDTH, generator=source)
    actions = torch.randint(ACTIONS, (ROBOTS, STEPS, WORLDS), generator=source)
    past = torch.rand(ROBOTS, WORLDS, WIDTH, generator=source) * 2 - 1
    begins = torch.rand(STEPS, WORLDS, generator=source) < 0.3
    begins[0] = False
    assert begins.any()
    return obs, actions, past, begins


def test_a_step_is_that_of_torchs_unit() -> None:
    memory = Memory(ROBOTS, OBS_WIDTH, WIDTH, torch.Generator().manual_seed(0))
    obs, past = torch.randn(ROBOTS, 9, OBS_WIDTH), torch.randn(ROBOTS, 9, WIDTH).tanh()
    (found,) = memory(obs, past)
    for robot in range(ROBOTS):
        cell = nn.GRUCell(OBS_WIDTH, WIDTH)
        with torch.no_grad():
            for name, layer in (("ih", memory.of_input), ("hh", memory.of_past)):
                getattr(cell, f"weight_{name}").copy_(layer.weight[robot])
                getattr(cell, f"bias_{name}").copy_(layer.bias[robot])
        torch.testing.assert_close(found[robot], cell(obs[robot], past[robot]))


@pytest.mark.parametrize("framed", [False, True])
@pytest.mark.parametrize("sharing", ["none", "kind"])
@pytest.mark.parametrize("attention", ["inner", "none"])
def test_a_sequence_is_its_steps_one_by_one(framed: bool, sharing: str, attention: str) -> None:
    actor, critic = networks(parameter_sharing=sharing, attention=attention)
    obs, actions, past, begins = sequences()
    elements = SYMMETRY.frame(obs) if framed else torch.zeros_like(actions)
    turns = torch.cat([elements[:, :1], between(elements[:, :-1], elements[:, 1:])], dim=1)
    recall = past, begins, turns.flatten(1, 2) if framed else None
    logits = actor(obs.flatten(1, 2), *recall).unflatten(2, (STEPS, WORLDS))
    q = critic(obs.flatten(1, 2), actions.flatten(1, 2), None, *recall).q
    q = q.unflatten(2, (STEPS, WORLDS))
    of_actor, of_critic = past, past
    for step in range(STEPS):
        new, element = begins[step].view(1, -1, 1), elements[:, step]
        of_actor = torch.where(new, torch.zeros(()), of_actor)
        of_critic = torch.where(new, torch.zeros(()), of_critic)
        found = critic(obs[:, step], actions[:, step], None, of_critic, None, element).q
        torch.testing.assert_close(q[:, :, step], found)
        found, after = actor.act(obs[:, step], of_actor, element)
        torch.testing.assert_close(logits[:, :, step], found)
        assert torch.equal(actor(obs[:, step], of_actor, None, element), found)
        of_critic = critic.remember(obs[:, step], of_critic, element)
        of_actor = actor.remember(obs[:, step], of_actor, element)
        assert torch.equal(of_actor, after)
    assert of_actor.abs().max() <= 1.0
    assert not torch.equal(of_actor, of_critic)


def test_what_was_remembered_decides() -> None:
    actor, critic = networks()
    obs, actions, past, _ = sequences()
    now, acts = obs[:, 0], actions[:, 0]
    assert not torch.equal(actor(now, past), actor(now, -past))
    assert not torch.equal(critic(now, acts, None, past).q, critic(now, acts, None, -past).q)


def test_turned_memories_are_the_same_in_frames_that_turn_alike() -> None:
    """What was remembered in a turned world, seen in the turned frame, is the same to the bit."""
    actor, _ = networks()
    obs, _, past, _ = sequences()
    now, element = obs[:, 0], SYMMETRY.frame(obs[:, 0])
    logits = actor(now, past, None, element)
    known = actor.remember(now, past, element)
    for number in range(NUM_ELEMENTS):
        turn = torch.full(element.shape, number)
        there = turned_memory(past, turn)
        back = between(turn, element)  # of the turned world into the same frame
        assert torch.equal(actor(now, there, None, back), logits)
        assert torch.equal(actor.remember(now, there, back), turned_memory(known, turn))


def test_a_memory_turns_back() -> None:
    past = torch.rand(NUM_ELEMENTS, 3, WIDTH)
    element = torch.arange(NUM_ELEMENTS).unsqueeze(1).expand(-1, 3)
    there = turned_memory(past, element)
    assert torch.equal(turned_memory(there, inverse(element)), past)
    assert torch.equal(there[..., : WIDTH // 2], past[..., : WIDTH // 2])
    for number in range(1, NUM_ELEMENTS):
        assert not torch.equal(there[number], past[number])


def test_vectors_of_a_memory_turn_as_those_of_an_observation() -> None:
    source = torch.Generator().manual_seed(3)
    obs = torch.randn(NUM_ELEMENTS, 2, OBS_WIDTH, generator=source)
    element = torch.arange(NUM_ELEMENTS).unsqueeze(1).expand(-1, 2)
    turned = SYMMETRY.turn(obs, element)
    (x, y), (also_x, also_y) = ((obs[..., a], obs[..., b]) for a, b in COLUMNS.vectors)
    plain = torch.zeros(NUM_ELEMENTS, 2, 4)
    vectors = torch.stack([x, also_x, y, also_y], dim=-1)
    found = turned_memory(torch.cat([plain, vectors], dim=-1), element)[..., 4:]
    assert torch.equal(found[..., [0, 2, 1, 3]], turned[..., [0, 1, 3, 4]])


@pytest.mark.parametrize("first", range(NUM_ELEMENTS))
@pytest.mark.parametrize("second", range(NUM_ELEMENTS))
def test_turning_by_one_and_by_what_lies_between_is_turning_by_the_other(
    first: int, second: int
) -> None:
    obs = torch.arange(1.0, OBS_WIDTH + 1).expand(1, -1)
    one, other = torch.tensor([first]), torch.tensor([second])
    found = SYMMETRY.turn(SYMMETRY.turn(obs, one), between(one, other))
    assert torch.equal(found, SYMMETRY.turn(obs, other))
