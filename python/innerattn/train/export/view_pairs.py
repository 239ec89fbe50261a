"""What a robot for any team makes of its view, as a graph: `innerattn.policies.exported.pairs`.

Sizes are those of the view: R robots, the robot itself first, V victims and K abilities. There are
M = V + NEAREST victims in here: behind those of the view come some that need nothing, so that a
robot always has `NEAREST` to look at. Tables have robots last, so that an array need not be laid
out anew for each number of a pair.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.teams.coalitions import NEVER_S
from innerattn.nn.teams.frames import frame_of
from innerattn.nn.teams.moves import gains
from innerattn.nn.teams.relations import BLOCKED_S, LONGEST_S, NEAREST
from innerattn.nn.teams.tables import ENDLESS_S
from innerattn.policies.exported.contract import MOST_NEEDS
from innerattn.policies.exported.pairs import HIGH, LOW, SCALE, Column

_FARTHEST_M = 2.0
_MOST_PUSH = float(HIGH[Column.PUSH])
COLUMN_ORDER = (
    # Of a robot at a victim.
    *(Column.DISTANCE, Column.TIME, Column.TOWARDS, Column.INSIDE, Column.FILLS),
    *(Column.SPARE_MINE, Column.RANK, Column.LATER, Column.WITHOUT, Column.OTHERS, Column.LAST),
    *(Column.NEARER, Column.RIVALS, Column.PARTNERS),
    # Of a robot.
    *(Column.SPEED, Column.PUSH, Column.CHOICES),
    # Of a victim.
    *(Column.NEEDED, Column.MET, Column.SPARE),
    *(Column.WAIT, Column.LEFT, Column.BLOCKED, Column.TO_SPARE),
    # Of the world.
    *(Column.ARENA, Column.WAITING, Column.MOST_WAITING),
)
"""The columns of a pair as they are put together here: those of a robot at a victim come first."""


class View(NamedTuple):
    """What one robot sees, as of `innerattn.policies.exported.table.Table`; inputs of the graph.

    Attributes:
        positions: (R, 2) [m].
        velocities: (R, 2) [m/s].
        bodies: (R, 6), as of `innerattn.nn.teams.TeamTables`.
        abilities: (R, K).
        present: (R,) bool.
        victims: (V, 2) [m].
        needs: (V, K); a victim that needs nothing is none.
        waits: (V, 3).
        demand: (K,) how many robots with an ability a victim needs on average.
        world: (3,) half the side of the arena [m], rescue radius [m], most victims at a time.
    """

    positions: Tensor
    velocities: Tensor
    bodies: Tensor
    abilities: Tensor
    present: Tensor
    victims: Tensor
    needs: Tensor
    waits: Tensor
    demand: Tensor
    world: Tensor


class ViewPairs(NamedTuple):
    """All pairs of M victims and R robots, and the `NEAREST` victims of the robot itself.

    Attributes:
        columns: (M, R, PAIR_WIDTH), in the order of `COLUMN_ORDER`.
        there: (M, R, 1), 1 where there is a pair, else 0.
        at: (NEAREST,) int64 the robot's own victims.
        helps: (NEAREST, 1) bool, which of them it can help.
        times: (NEAREST, 1, R) arrival times there [s].
        masks: (NEAREST, 2, R, R), 1 for each robot whose part another could take there, and for
            those that complete it, else 0.
        turning: (NEAREST, PAIR_TURNING_WIDTH) vectors in the frames of its pairs, and gains.
        home: (1, HOME_WIDTH) the robot itself.
        frames: (NEAREST + 1,) int64 frames of its pairs and of its way to the centre.
    """

    columns: Tensor
    there: Tensor
    at: Tensor
    helps: Tensor
    times: Tensor
    masks: Tensor
    turning: Tensor
    home: Tensor
    frames: Tensor


class _Roles(NamedTuple):
    """What M victims need of R robots, over S sets of needs.

    Attributes:
        useful: (M, 1, R) bool, who can fill a need.
        useful_in: (M, S, R), 1 where a robot can fill a need in a set, else 0.
        elsewhere: (M, S, 1) robots needed for all needs outside of a set.
        needed: (M, 1, 1) robots needed.
        filled_by: (M, 1, R) how many needs a robot could fill.
        spare: (M, 1, 1) useful robots minus needed ones, for the scarcest set of needs.
        spare_mine: (M, 1, R) the same among sets with a need that a robot can fill; 5 if none.
        rivals: (M, R, R), 1 for who could take whose part, else 0.
        partners: (M, R, R), 1 for who completes whom, else 0.
    """

    useful: Tensor
    useful_in: Tensor
    elsewhere: Tensor
    needed: Tensor
    filled_by: Tensor
    spare: Tensor
    spare_mine: Tensor
    rivals: Tensor
    partners: Tensor


class Relate(nn.Module):
    """Makes the pairs of a view."""

    def __init__(self) -> None:
        """Prepare constants."""
        super().__init__()
        numbers = torch.arange(2**MOST_NEEDS)
        bits = numbers[:, None] >> torch.arange(MOST_NEEDS) & 1
        self.sets = nn.Buffer(bits.float())  # (256, MOST_NEEDS) all sets of needs
        self.numbers_of_sets = nn.Buffer(2 ** torch.arange(MOST_NEEDS + 1))
        order = list(COLUMN_ORDER)
        self.lowest, self.highest, self.scale = (
            nn.Buffer(torch.from_numpy(one[order])[:, None]) for one in (LOW, HIGH, SCALE)
        )
        self.first_ranks = nn.Buffer(torch.arange(NEAREST))

    def forward(self, view: View) -> ViewPairs:
        """The pairs of a view."""
        robots = view.bodies.t()
        places = functional.pad(view.victims, (0, 0, 0, NEAREST))
        waits = functional.pad(view.waits, (0, 0, 0, NEAREST))[..., None]
        roles = self._roles(view)
        useful, needed, elsewhere = roles.useful, roles.needed, roles.elsewhere

        ways = places[..., None] - view.positions.t()  # (M, 2, R)
        distance = ways.square().sum(1, keepdim=True).sqrt()  # (M, 1, R)
        speed, lag = robots[:1].clamp_min(1e-6), robots[1:2]
        towards = (ways * view.velocities.t()).sum(1, keepdim=True) / distance.clamp_min(1e-6)
        gap = (distance - view.world[1]).clamp_min(0.0)
        late = (lag * (1.0 - towards / speed)).clamp_min(0.0)
        times = (gap / speed + torch.where(gap > 0.0, late, 0.0)).clamp_max(LONGEST_S)
        inside = (useful & (distance <= view.world[1])).float()
        own = torch.where(useful, times + BLOCKED_S * waits[:, 2:], NEVER_S)
        ranks = self._ranks(own)
        soonest = own.amin(0)  # (1, R)
        choices = useful.float().sum(0)  # (1, R)

        met = (roles.useful_in @ inside.transpose(1, 2) + elsewhere).amin(1, keepdim=True)
        arrivals = times.transpose(1, 2)
        nearer = (roles.rivals * (arrivals < times).float()).sum(1, keepdim=True)
        without, others = self._when_filled(times, arrivals, roles)
        complete = torch.where(useful, torch.maximum(times, others), NEVER_S)
        complete = complete.amin(2, keepdim=True)
        left = waits[:, 1:2]
        to_spare = torch.where(left < ENDLESS_S, left - complete - waits[:, :1], ENDLESS_S)

        numbers = (one.sum(1, keepdim=True) for one in (roles.rivals, roles.partners))
        of_pairs = torch.cat(
            [
                *(distance, times, towards, inside, roles.filled_by, roles.spare_mine, ranks),
                *(times - soonest, without - times, others, others - times, nearer, *numbers),
            ],
            1,
        )
        of_robots = torch.cat([speed, robots[2:3], choices])
        of_victims = torch.cat([needed, met, roles.spare, waits, to_spare], 1)
        waiting = (needed > 0.0).float().sum(0)
        of_world = torch.cat([view.world[:1, None], waiting, view.world[2:, None]])
        sizes = (of_pairs.shape[0], -1, of_pairs.shape[2])
        wide = (one.expand(sizes) for one in (of_robots, of_victims, of_world))
        columns = torch.cat([of_pairs, *wide], 1)
        columns = torch.minimum(torch.maximum(columns, self.lowest), self.highest) * self.scale

        at = (ranks[:, 0, :1] == self.first_ranks).float().argmax(0)
        helps = useful[:, 0, :1].index_select(0, at)
        vectors, frames = self._vectors(view, ways[:, :, 0].index_select(0, at), helps)
        gained = gains(vectors[:, 0], vectors[:, 1], view.bodies[:1])
        home = torch.cat(
            [
                *(robots[:2, 0], robots[2:3, 0].clamp_max(_MOST_PUSH)),
                *((choices[0, :1] > 0.0).float(), choices[0, :1] / 3.0),
                *(view.abilities[:1].amax(1), soonest[0, :1].clamp_max(4.0), view.world[:1]),
                *(self._asked(view), vectors[NEAREST, :3].flatten(), gained[NEAREST]),
            ]
        )
        return ViewPairs(
            columns=columns.transpose(1, 2),
            there=(useful & (ranks < NEAREST)).float().transpose(1, 2),
            at=at,
            helps=helps,
            times=times.index_select(0, at),
            masks=torch.stack([roles.rivals, roles.partners], 1).index_select(0, at),
            turning=torch.cat([vectors[:NEAREST].flatten(1), gained[:NEAREST]], 1),
            home=home[None],
            frames=frames,
        )

    def _roles(self, view: View) -> _Roles:
        """Who can help whom; see `innerattn.policies.exported.roles`."""
        needs = functional.pad(view.needs, (0, MOST_NEEDS, 0, NEAREST))
        abilities = functional.pad(view.abilities, (0, MOST_NEEDS))
        # Of each victim the abilities that it needs, which are MOST_NEEDS at most.
        wanted, chosen = (needs > 0.0).float().topk(MOST_NEEDS, dim=1)
        units = needs.gather(1, chosen)[..., None]  # (M, MOST_NEEDS, 1)
        fills = abilities.t()[chosen] * wanted[..., None]  # (M, MOST_NEEDS, R)
        filled_by = fills.sum(1, keepdim=True)
        needed, useful = units.sum(1, keepdim=True), filled_by > 0.0

        sets = self._sets(wanted.sum(1).amax(0).long())
        useful_in = (sets @ fills > 0.0).float()
        units_in = sets @ units
        spare_in = torch.where(units_in > 0.0, useful_in.sum(2, keepdim=True) - units_in, 5.0)
        spare_mine = torch.where(useful_in > 0.0, spare_in, 5.0)

        filled, turned = fills * units, fills.transpose(1, 2)
        mine = filled.sum(1, keepdim=True)
        either = mine.transpose(1, 2) + mine - turned @ filled
        apart = torch.eye(view.positions.shape[0]) < 0.5
        both = apart & useful & useful.transpose(1, 2)
        return _Roles(
            useful=useful,
            useful_in=useful_in,
            elsewhere=needed - units_in,
            needed=needed,
            filled_by=filled_by,
            spare=spare_in.amin(1, keepdim=True),
            spare_mine=spare_mine.amin(1, keepdim=True),
            rivals=(apart & (turned @ fills > 0.0)).float(),
            partners=(both & (either > 1.0)).float(),
        )

    def _sets(self, most: Tensor) -> Tensor:
        """Sets (S, MOST_NEEDS) of as many needs as a victim has at ``most``."""
        number: Any = self.numbers_of_sets[most].item()
        torch._check(number >= 1)
        torch._check(number <= 2**MOST_NEEDS)
        return self.sets[:number]

    def _ranks(self, own: Tensor) -> Tensor:
        """(M, 1, R) which victim comes when for each robot; of equal ones the first."""
        index = torch.arange(own.shape[0])
        first = (index < index[:, None])[..., None]  # (M, M, 1)
        theirs = own.transpose(0, 1)
        sooner = (theirs < own) | (first & (theirs == own))
        return sooner.float().sum(1, keepdim=True)

    def _when_filled(self, times: Tensor, arrivals: Tensor, roles: _Roles) -> tuple[Tensor, Tensor]:
        """From when on others fill all that a robot could fill, and complete it, (M, 1, R) [s].

        What others fill grows with time, and what a robot adds to it falls, so that robots that
        arrive at the same time can be counted at once.
        """
        moments = functional.pad(times, (1, 0))  # (M, 1, 1 + R)
        here = functional.pad((arrivals <= times).float(), (1, 0))  # (M, R, 1 + R)
        room = roles.useful_in @ here + roles.elsewhere  # (M, S, 1 + R)
        helps = roles.useful_in[..., None]  # (M, S, R, 1)
        others = room[:, :, None] - helps * here[:, None]
        without = others.amin(1)
        beside = (others + helps).amin(1)
        found = [
            torch.where(holds, moments, NEVER_S).amin(2)[:, None]
            for holds in (beside == without, beside >= roles.needed)
        ]
        return found[0], found[1]

    def _vectors(self, view: View, targets: Tensor, helps: Tensor) -> tuple[Tensor, Tensor]:
        """Five vectors (x, y) in each frame, (NEAREST + 1, 5, 2), and the frames.

        Ways to a victim and, last, to the centre; velocity; way to the nearest teammate; place; way
        to the soonest other victim.
        """
        place, velocity = view.positions[:1], view.velocities[:1]
        ways = view.positions - place
        mates = view.present & (torch.arange(ways.shape[0]) > 0)
        squares = torch.where(mates, ways.square().sum(1), torch.inf)
        mate = ways.index_select(0, squares.argmin(0, keepdim=True))
        mate = mate.clamp(-_FARTHEST_M, _FARTHEST_M) * mates.float().amax(0)
        known = torch.where(helps, targets, 0.0)
        nexts = torch.cat([known[1:2], known[:1].expand(NEAREST, -1)])
        heads = torch.cat([targets, -place])
        same = torch.cat([velocity, mate, place])[None].expand(NEAREST + 1, -1, -1)
        vectors = torch.cat([heads[:, None], same, nexts[:, None]], 1)
        negative = heads < 0.0
        swaps = heads[:, 1:].abs() > heads[:, :1].abs()
        vectors = vectors * torch.where(negative, -1.0, 1.0)[:, None]
        vectors = torch.where(swaps[..., None], vectors.flip(2), vectors)
        return vectors, frame_of(heads)

    def _asked(self, view: View) -> Tensor:
        """(2,) how much the robot's abilities are asked for: of the scarcest one, and of all."""
        share = view.abilities[:1] * (view.demand / view.abilities.sum(0).clamp_min(1.0))
        return torch.cat([share.amax(1), share.sum(1)])
