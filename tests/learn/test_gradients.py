"""What is done with gradients before a step."""

import pytest
import torch

from innerattn.learn.gradients import average_over_robots, clip_norm, clip_norm_by_robot


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
    norms = clip_norm_by_robot(gradients, 1.0)
    torch.testing.assert_close(norms, expected)
    after = [torch.cat([g[robot].flatten() for g in gradients.values()]) for robot in range(3)]
    assert expected[1] < 1.0 < expected[0]
    for robot, (before, row) in enumerate(zip(whole, after, strict=True)):
        share = 1.0 if robot == 1 else 1.0 / expected[robot]
        torch.testing.assert_close(row, share * before, rtol=1e-5, atol=0.0)


def test_the_whole_is_clipped_to_a_common_norm() -> None:
    gradients = {"a": torch.tensor([[3.0, 0.0]]), "b": torch.tensor([4.0])}
    assert clip_norm(gradients, 10.0).item() == 5.0
    torch.testing.assert_close(gradients["a"], torch.tensor([[3.0, 0.0]]))
    assert clip_norm(gradients, 2.5).item() == 5.0
    torch.testing.assert_close(gradients["a"], torch.tensor([[1.5, 0.0]]))
    torch.testing.assert_close(gradients["b"], torch.tensor([2.0]))


def test_only_what_all_robots_share_is_averaged() -> None:
    names = ("attention.key", "hidden.weight", "attention.value_bias")
    gradients = {name: torch.full((4, 3), 8.0) for name in names}
    average_over_robots(gradients, 4)
    assert [gradients[name].unique().item() for name in names] == [2.0, 8.0, 2.0]
