"""The symmetries of the square, against turning vectors by hand."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from innerattn.nn import NUM_ELEMENTS, SquareSymmetry, VectorColumns

CPU = torch.device("cpu")
# flag, victim x, victim y, own x, own y, angle, velocity x, velocity y
COLUMNS = VectorColumns(
    width=8, vectors=((1, 2), (3, 4), (6, 7)), handed=(5,), anchors=((1, 2), (3, 4), (6, 7))
)
SYMMETRY = SquareSymmetry(COLUMNS, CPU)
# Few different values, so that zeros, axes and diagonals come often.
VALUES = st.sampled_from([-0.75, -0.5, 0.0, 0.5, 0.75])
ROWS = st.lists(VALUES, min_size=8, max_size=8)
ACTIONS = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))


def by_hand(vector: tuple[float, float], element: int) -> tuple[float, float]:
    """Mirror, then swap, one vector."""
    x, y = vector
    x = -x if element in (1, 3, 5, 7) else x
    y = -y if element in (2, 3, 6, 7) else y
    return (y, x) if element >= 4 else (x, y)


def turned(row: list[float], element: int) -> list[float]:
    flag, vx, vy, px, py, angle, wx, wy = row
    handed = -angle if element in (1, 2, 4, 7) else angle  # an odd number of mirrors
    return [
        flag,
        *by_hand((vx, vy), element),
        *by_hand((px, py), element),
        handed,
        *by_hand((wx, wy), element),
    ]


def frame_and_form(row: list[float]) -> tuple[Tensor, Tensor]:
    obs = torch.tensor([row])
    element = SYMMETRY.frame(obs)
    return element, SYMMETRY.turn(obs, element)


@given(row=ROWS, element=st.integers(0, NUM_ELEMENTS - 1))
def test_turning_is_turning_by_hand(row: list[float], element: int) -> None:
    got = SYMMETRY.turn(torch.tensor([row]), torch.tensor([element]))
    assert got.tolist() == [turned(row, element)]


@given(row=ROWS, element=st.integers(0, NUM_ELEMENTS - 1), action=st.integers(0, 4))
def test_a_turned_world_has_the_same_form_and_the_turned_action(
    row: list[float], element: int, action: int
) -> None:
    images = [turned(row, g) for g in range(NUM_ELEMENTS)]
    vectors = {tuple(x + 0.0 for x in image[1:5] + image[6:]) for image in images}
    if len(vectors) < NUM_ELEMENTS:  # the row is itself symmetric: some turns leave it as it is
        row = [*row[:5], 0.0, *row[6:]]
    frame, form = frame_and_form(row)
    other_frame, other_form = frame_and_form(turned(row, element))
    assert torch.equal(form, other_form)
    if len(vectors) == NUM_ELEMENTS:
        # The same action in the frame, brought back to both worlds.
        chosen = torch.tensor([action])
        here = ACTIONS[int(SYMMETRY.turn_actions_back(chosen, frame))]
        there = ACTIONS[int(SYMMETRY.turn_actions_back(chosen, other_frame))]
        assert by_hand(here, element) == there


@given(row=ROWS)
def test_the_first_anchor_that_is_there_lies_in_the_first_octant(row: list[float]) -> None:
    _, form = frame_and_form(row)
    for x, y in COLUMNS.anchors:
        if row[x] or row[y]:
            assert form[0, x] >= form[0, y] >= 0
            return


@pytest.mark.parametrize("element", range(NUM_ELEMENTS))
def test_actions_turn_as_their_pushes(element: int) -> None:
    actions = torch.arange(5)
    elements = torch.full((5,), element)
    there = SYMMETRY.turn_actions(actions, elements)
    for action, got in zip(ACTIONS, there.tolist(), strict=True):
        assert ACTIONS[got] == by_hand(action, element)
    assert torch.equal(SYMMETRY.turn_actions_back(there, elements), actions)


@pytest.mark.parametrize("element", range(NUM_ELEMENTS))
def test_vectors_turn_as_by_hand_and_back_to_the_bit(element: int) -> None:
    vectors = torch.tensor([[0.3, -0.7], [0.0, 0.5], [-1.0, 1.0]], dtype=torch.float64)
    elements = torch.full((3,), element)
    there = SYMMETRY.turn_actions(vectors, elements)
    assert there.tolist() == [list(by_hand((x, y), element)) for x, y in vectors.tolist()]
    assert torch.equal(SYMMETRY.turn_actions_back(there, elements), vectors)


@pytest.mark.parametrize("element", range(NUM_ELEMENTS))
def test_actions_on_wheels_are_mirrored_and_do_not_turn(element: int) -> None:
    drives = ("force", "unicycle", "differential", "velocity")
    symmetry = SquareSymmetry(COLUMNS, CPU, drives)
    odd = element in (1, 2, 4, 7)
    actions = torch.arange(5).unsqueeze(1).expand(5, 4)
    elements = torch.full((5, 4), element)
    there = symmetry.turn_actions(actions, elements)
    wheels = [0, 1, 2, 4, 3] if odd else [0, 1, 2, 3, 4]
    assert there[:, 1].tolist() == there[:, 2].tolist() == wheels
    for robot in (0, 3):
        for action, got in zip(ACTIONS, there[:, robot].tolist(), strict=True):
            assert ACTIONS[got] == by_hand(action, element)
    assert torch.equal(symmetry.turn_actions_back(there, elements), actions)
    pairs = torch.tensor([[0.3, -0.7]] * 4, dtype=torch.float64)
    there = symmetry.turn_actions(pairs, elements[0])
    assert there[1].tolist() == ([0.3, 0.7] if odd else [0.3, -0.7])
    assert there[2].tolist() == ([-0.7, 0.3] if odd else [0.3, -0.7])
    assert there[0].tolist() == there[3].tolist() == list(by_hand((0.3, -0.7), element))
    assert torch.equal(symmetry.turn_actions_back(there, elements[0]), pairs)


def test_columns_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="needs an anchor"):
        SquareSymmetry(VectorColumns(2, ((0, 1),), (), ()), CPU)
    with pytest.raises(ValueError, match=r"columns in 0\.\.1"):
        SquareSymmetry(VectorColumns(2, ((0, 2),), (), ((0, 2),)), CPU)


def test_the_first_anchor_decides_however_many_follow() -> None:
    """As in a team of 64 whose teammates all lie on one side of a robot in a corner."""
    pairs = tuple((2 * k, 2 * k + 1) for k in range(97))
    symmetry = SquareSymmetry(VectorColumns(194, pairs, (), pairs), CPU)
    row = torch.full((1, 194), 0.25)
    row[0, :2] = -0.75
    row[0, 2], row[0, 3::2] = 0.5, 0.75
    for element in range(NUM_ELEMENTS):
        there = symmetry.turn(row, torch.tensor([element]))
        form = symmetry.turn(there, symmetry.frame(there))[0]
        assert form[:4].tolist() == [0.75, 0.75, -0.5, -0.75]
