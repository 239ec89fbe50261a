"""Poolings against plain loops."""

import pytest
import torch
from torch import Tensor

from innerattn.nn.teams.pooling import POOLINGS, InnerPooling, Pooling, as_table

VICTIMS, ROBOTS, WIDTH = 3, 4, 5


def by_hand(
    name: str, pool: Pooling, rows: Tensor, others: list[int], own: int, time: Tensor
) -> Tensor:
    """What one row pools of ``others``, indices of rows."""
    if not others:
        return torch.zeros(WIDTH)
    seen = rows[others]
    if name == "uniform":
        return seen.mean(0)
    if name == "max":
        return seen.amax(0)
    if name == "nearest":
        return rows[min(others, key=lambda row: float(time[row]))]
    assert isinstance(pool, InnerPooling)
    logits = torch.stack([pool.query(rows[own]) @ pool.key(row) for row in seen])
    return (logits * pool.key_width**-0.5).softmax(0) @ seen


@pytest.mark.parametrize("name", POOLINGS)
def test_it_is_that_of_plain_loops(name: str) -> None:
    torch.manual_seed(3)
    pool = POOLINGS[name](WIDTH, 2)
    cells = torch.tensor([0, 1, 3, 4, 5, 6, 7, 9])  # nobody else at the last victim
    rows, times = torch.randn(len(cells), WIDTH), torch.rand(VICTIMS, ROBOTS)
    masks = (torch.rand(VICTIMS, ROBOTS, ROBOTS) < 0.7) & ~torch.eye(ROBOTS, dtype=torch.bool)
    there = torch.zeros(VICTIMS * ROBOTS, dtype=torch.bool)
    there[cells] = True
    masks &= there.view(VICTIMS, 1, ROBOTS)
    found = pool(rows, as_table(rows, cells, VICTIMS, ROBOTS), cells, masks, times)
    row_of = {int(cell): row for row, cell in enumerate(cells)}
    time = times.view(-1)[cells]
    for row, cell in enumerate(cells.tolist()):
        victim, robot = divmod(cell, ROBOTS)
        others = [row_of[victim * ROBOTS + j] for j in range(ROBOTS) if masks[victim, robot, j]]
        expected = by_hand(name, pool, rows, others, row, time)
        torch.testing.assert_close(found[row], expected, atol=1e-6, rtol=1e-5)
    assert not bool(found[-1].any())
