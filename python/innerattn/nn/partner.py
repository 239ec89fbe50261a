"""A control for learnt attention: the whole weight on the teammates that a robot should mind.

A robot's own observation tells who they are, so the control knows nothing that the critic does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from innerattn.nn.attention import Attended, MatrixAttention, mean_attention


@dataclass(frozen=True)
class PartnerColumns:
    """The columns of an observation that tell who can help whom.

    Attributes:
        abilities: (A,) own abilities.
        teammate_abilities: (T, A) those of each teammate, in team order; none where the rows of
            teammates tell.
        teammate_places: (T, 2) x and y of each teammate, relative to the robot; likewise.
        victim_present: Whether there is a first victim.
        victim_needs: (A,) what it needs of each ability.
        victim_place: (2,) x and y, relative to the robot.
        own_place: (2,) x and y of the robot itself, in one frame for all robots; None where
            columns of teammates tell.
    """

    abilities: tuple[int, ...]
    teammate_abilities: tuple[tuple[int, ...], ...]
    teammate_places: tuple[tuple[int, int], ...]
    victim_present: int
    victim_needs: tuple[int, ...]
    victim_place: tuple[int, int]
    own_place: tuple[int, int] | None = None


def right_partners(obs: Tensor, columns: PartnerColumns, available: Tensor | None) -> Tensor:
    """The teammates that each robot needs most, else all of them.

    A robot's first victim is the nearest one that the robot can help. For each ability that the
    victim still needs beside the robot's own, the right partner is the teammate nearest to this
    victim that has it. Where there is no such victim or no such teammate, there is no right
    partner, and the robot may attend to all teammates.

    Args:
        obs: (R, B, D) observations.
        columns: Where they say it.
        available: (B, R) bool, robots that can be partners at all; None: all.

    Returns:
        (B, R, R) bool: whether robot i may attend to robot j.
    """
    robots, batch, _ = obs.shape
    teammates = robots - 1
    others = ~torch.eye(robots, dtype=torch.bool, device=obs.device)
    there = others.expand(batch, -1, -1)
    if available is not None:
        there = there & available.unsqueeze(1)
    if not teammates:
        return there
    own = obs[:, :, list(columns.abilities)]  # (R, B, A)
    needs = obs[:, :, list(columns.victim_needs)]
    helps = ((own > 0.0) & (needs > 0.0)).any(2) & (obs[:, :, columns.victim_present] > 0.5)
    missing = needs - own > 0.0
    has, place = _teammates_of(obs, columns)
    numbers = _teammates(robots, obs.device)  # (R, T)
    there_by_teammate = there.gather(2, numbers.expand(batch, -1, -1)).transpose(0, 1)
    useful = has & missing.unsqueeze(2) & there_by_teammate.unsqueeze(3)  # (R, B, T, A)
    away = (place - obs[:, :, list(columns.victim_place)].unsqueeze(2)).square().sum(3)
    nearest = away.unsqueeze(3).masked_fill(~useful, torch.inf).argmin(2)  # (R, B, A)
    found = useful.any(2)
    robot = numbers.gather(1, nearest.flatten(1)).view(nearest.shape)
    chosen = (functional.one_hot(robot, robots).bool() & found.unsqueeze(3)).any(2)  # (R, B, R)
    known = (helps & found.any(2)).unsqueeze(2)
    return torch.where(known, chosen, there.transpose(0, 1)).transpose(0, 1)


def _teammates_of(obs: Tensor, columns: PartnerColumns) -> tuple[Tensor, Tensor]:
    """What each robot's teammates have, (R, B, T, A) bool, and where they are, (R, B, T, 2)."""
    robots, batch, _ = obs.shape
    if columns.own_place is None:
        flat = [column for one in columns.teammate_abilities for column in one]
        has = obs[:, :, flat].view(robots, batch, robots - 1, -1) > 0.0
        flat = [column for one in columns.teammate_places for column in one]
        return has, obs[:, :, flat].view(robots, batch, robots - 1, 2)
    numbers = _teammates(robots, obs.device)
    has = (obs[:, :, list(columns.abilities)] > 0.0)[numbers].transpose(1, 2)
    places = obs[:, :, list(columns.own_place)]
    return has, places[numbers].transpose(1, 2) - places.unsqueeze(2)


def _teammates(robots: int, device: torch.device) -> Tensor:
    """(R, R - 1) the numbers of each robot's teammates, in the order of their columns."""
    number = torch.arange(robots - 1, device=device).expand(robots, -1)
    return number + (number >= torch.arange(robots, device=device).unsqueeze(1))


class OracleAttention(MatrixAttention):
    """Equal weights on `right_partners`, and on all teammates for a robot that has none.

    It has the parameters of `InnerAttention`, but does not use or train query and key.

    Attributes:
        partners: Where observations say who the right partners are; whoever builds the critic sets
            it.
        attend: From values to the result; a compiled update has another form.
    """

    partners: PartnerColumns

    def __init__(self, width: int, heads: int, generator: torch.Generator) -> None:
        """Draw the parameters; arguments as in `TeammateAttention`."""
        super().__init__(width, heads, generator)
        self.query.requires_grad_(False)
        self.key.requires_grad_(False)
        self.attend = mean_attention

    def forward(self, own: Tensor, others: Tensor, available: Tensor | None = None) -> Attended:
        """Average over those that a robot may attend to; arguments as in `TeammateAttention`.

        ``available`` is what `right_partners` gives.
        """
        del own
        return self.attend(self.values(others), self.heads, available)
