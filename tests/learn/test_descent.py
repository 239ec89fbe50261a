"""Clipping of gradients."""

import pytest
import torch

from innerattn.learn.descent import clip_each_robot


@pytest.mark.parametrize("count", [1, 6, 8, 9, 20, 70])
def test_each_robot_is_clipped_alone_whatever_the_number_of_parameters(count: int) -> None:
    source = torch.Generator().manual_seed(count)
    gradients = {
        str(k): torch.randn(3, 2 + k % 3, 4, generator=source, dtype=torch.float64)
        for k in range(count)
    }
    for gradient in gradients.values():
        gradient[1] *= 1e-3
    whole = [torch.cat([g[robot].flatten() for g in gradients.values()]) for robot in range(3)]
    expected = torch.stack([row.square().sum().sqrt() for row in whole])
    norms = clip_each_robot(gradients, 1.0)
    torch.testing.assert_close(norms, expected)
    after = [torch.cat([g[robot].flatten() for g in gradients.values()]) for robot in range(3)]
    assert expected[1] < 1.0 < expected[0]
    for robot, (before, row) in enumerate(zip(whole, after, strict=True)):
        share = 1.0 if robot == 1 else 1.0 / expected[robot]
        torch.testing.assert_close(row, share * before, rtol=1e-5, atol=0.0)
