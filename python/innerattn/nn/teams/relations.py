"""Who can help whom, when, and what it means to the others: from tables to rows of pairs.

A row is a pair of a robot and a victim that it can help; a robot has rows for its `NEAREST` victims
at most, blocked ones after all others. Times are those of
`innerattn.policies.scripted.steering.Steering.arrival_times`.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from innerattn.nn.teams.coalitions import NEVER_S, coalitions
from innerattn.nn.teams.frames import frame_of, turn
from innerattn.nn.teams.moves import GAINS_WIDTH, gains
from innerattn.nn.teams.tables import ENDLESS_S, TeamTables

NEAREST = 6
"""Victims that a robot looks at, by its own arrival time."""
LONGEST_S = 8.0
"""Beyond this, arrival times tell no more."""
BLOCKED_S = 100.0
"""What the arrival time at a blocked victim is longer, where victims are put in order [s]."""
_MOST_NEARER, _MOST_OTHERS = 4, 6
"""Beyond these numbers of rivals and partners, more of them change nothing."""
PAIR_WIDTH, PAIR_TURNING_WIDTH, HOME_WIDTH, VICTIM_WIDTH, ROBOT_WIDTH, WORLD_WIDTH = (
    *(27, 10 + GAINS_WIDTH, 16 + GAINS_WIDTH, 12, 12),
    9,
)


class Relations(NamedTuple):
    """What networks see of B worlds: P pairs, M victims, N robots (of all worlds).

    Attributes:
        pairs: (P, PAIR_WIDTH) columns that do not turn with the world.
        turning: (P, PAIR_TURNING_WIDTH) vectors (x, y) in each pair's frame, and what actions gain
            on the way to its victim.
        frames: (P,) int64 frame of each pair, which brings its victim to x >= y >= 0.
        cells: (P,) int64 where each pair stands in a table of (M, R).
        robots: (P,) int64 each pair's robot, of N.
        slots: (P,) int64 where each pair stands in a table of (N, NEAREST).
        rivals: (M, R, R) bool, who could take whose part at a victim.
        partners: (M, R, R) bool, who completes whom at a victim.
        times: (M, R) arrival times [s].
        homes: (N, HOME_WIDTH) the robots themselves, in the frames of their ways to the centre.
        home_frames: (N,) int64.
        victims: (M, VICTIM_WIDTH) what stands to happen at each victim.
        victim_worlds: (M,) int64 world of each victim.
        team: (N, ROBOT_WIDTH) the robots, for a critic.
        robot_cells: (N,) int64 where each robot stands in a table of (B, R).
        worlds: (B, WORLD_WIDTH).
    """

    pairs: Tensor
    turning: Tensor
    frames: Tensor
    cells: Tensor
    robots: Tensor
    slots: Tensor
    rivals: Tensor
    partners: Tensor
    times: Tensor
    homes: Tensor
    home_frames: Tensor
    victims: Tensor
    victim_worlds: Tensor
    team: Tensor
    robot_cells: Tensor
    worlds: Tensor


@torch.no_grad()
def relate(tables: TeamTables) -> Relations:
    """The relations in B worlds; what comes of them does not depend on any order or name."""
    world, slot = tables.is_victim.nonzero(as_tuple=True)
    envs, size = tables.is_robot.shape
    slots = tables.is_victim.shape[1]
    way = tables.places[world, slot].unsqueeze(1) - tables.positions[world]
    distance = way.norm(dim=-1)
    speed, lag = tables.bodies[world, :, 0].clamp(min=1e-6), tables.bodies[world, :, 1]
    towards = (way * tables.velocities[world]).sum(-1) / distance.clamp(min=1e-6)
    radius, half = tables.worlds[world, 1:2], tables.worlds[world, 0:1]
    gap = (distance - radius).clamp(min=0.0)
    times = gap / speed + (lag * (1.0 - towards / speed)).clamp(min=0.0) * (gap > 0.0)
    times = times.clamp(max=LONGEST_S)
    needed = tables.needs[world, slot]
    able = tables.abilities[world] * tables.is_robot[world, :, None]
    fills = able * (needed > 0.0)[:, None]
    useful = fills.any(-1)
    inside = (distance <= radius) & useful
    teams = coalitions(times, inside, needed, fills)
    rivals, partners = _rivals_and_partners(fills, useful, needed)

    # Each robot's victims, by its own arrival time.
    place = (world[:, None] * size + torch.arange(size)) * slots + slot[:, None]  # (M, R)
    own = torch.full((envs * size * slots,), NEVER_S)
    wait, left, blocked = (column[:, None] for column in tables.waits[world, slot].unbind(-1))
    own[place] = torch.where(useful, times + BLOCKED_S * blocked, NEVER_S)
    own = own.view(envs * size, slots)
    order = own.argsort(stable=True, dim=1)
    rank = torch.empty_like(order).scatter_(1, order, torch.arange(slots).expand_as(order))
    ranks = rank.view(-1)[place]
    soonest = own.amin(1).view(envs, size)
    choices = (own < NEVER_S).sum(1).view(envs, size)

    count, waiting = needed.sum(-1, keepdim=True), tables.is_victim.sum(1)[world].unsqueeze(1)
    nearer = ((times[:, None] < times[:, :, None]) & rivals).sum(-1)
    columns = [
        distance,
        times / 2.0,
        towards,
        inside,
        count / 3.0,
        teams.met[:, None] / 3.0,
        fills.sum(-1) / 2.0,
        teams.spare[:, None].clamp(-1.0, 4.0) / 3.0,
        teams.spare_mine.clamp(-1.0, 4.0) / 3.0,
        speed,
        tables.bodies[world, :, 2].clamp(max=3.0),
        half,
        waiting / 4.0,
        tables.worlds[world, 2:3] / 4.0,
        ranks / 2.0,
        (times - soonest[world]).clamp(0.0, 4.0),
        choices[world] / 3.0,
        (teams.without - times).clamp(-3.0, 3.0),
        teams.others.clamp(max=4.0),
        (teams.others - times).clamp(-3.0, 3.0),
        nearer.clamp(max=_MOST_NEARER) / 3.0,
        rivals.sum(-1).clamp(max=_MOST_OTHERS) / 3.0,
        partners.sum(-1).clamp(max=_MOST_OTHERS) / 3.0,
    ]
    at_victim = _waits(wait, left, blocked, teams.complete[:, None])
    columns += at_victim
    rows = torch.stack([column.expand_as(times).float() for column in columns], -1)
    cells = (useful & (ranks < NEAREST)).view(-1).nonzero().squeeze(1)
    victim, robot = cells // size, cells % size
    of_all = world[victim] * size + robot

    # Vectors, in a frame that brings the victim to x >= y >= 0.
    mate = _nearest_teammate(tables).view(-1, 2)
    position, velocity = tables.positions.flatten(0, 1), tables.velocities.flatten(0, 1)
    target = way.view(-1, 2)[cells]
    next_way = _next_victim(tables, order, own, of_all, slot[victim])
    vectors = (target, velocity[of_all], mate[of_all], position[of_all], next_way)
    frames = frame_of(target)
    turned = [turn(vector, frames) for vector in vectors]
    turned.append(gains(turned[0], turned[1], tables.bodies.flatten(0, 1)[of_all]))

    robot_cells = tables.is_robot.flatten(0, 1).nonzero().squeeze(1)
    number = torch.full((envs * size,), -1)
    number[robot_cells] = torch.arange(len(robot_cells))
    scarcity = _scarcity(tables).view(-1, 2)
    homes, home_frames, team = _robots(tables, robot_cells, soonest, choices, mate, scarcity)
    victims = [
        teams.complete.clamp(max=5.0),
        (teams.complete >= NEVER_S).float(),
        teams.first.clamp(max=5.0),
        count.squeeze(1) / 3.0,
        teams.met / 3.0,
        teams.spare.clamp(-1.0, 4.0) / 3.0,
        waiting.squeeze(1) / 4.0,
        half.squeeze(1),
        *(column.squeeze(1) for column in at_victim),
    ]
    return Relations(
        pairs=rows.view(-1, PAIR_WIDTH)[cells],
        turning=torch.cat(turned, -1),
        frames=frames,
        cells=cells,
        robots=number[of_all],
        slots=number[of_all] * NEAREST + ranks.view(-1)[cells],
        rivals=rivals,
        partners=partners,
        times=times,
        homes=homes,
        home_frames=home_frames,
        victims=torch.stack(victims, -1),
        victim_worlds=world,
        team=team,
        robot_cells=robot_cells,
        worlds=_worlds(tables),
    )


def _waits(wait: Tensor, left: Tensor, blocked: Tensor, complete: Tensor) -> tuple[Tensor, ...]:
    """Four columns (M, 1) of victims: service, deadline, order, and how much time is to spare."""
    spare = torch.where(left < ENDLESS_S, left - complete - wait, 3.0)
    return wait.clamp(max=4.0) / 2.0, left.clamp(max=LONGEST_S) / 4.0, blocked, spare.clamp(-3, 3)


def _rivals_and_partners(fills: Tensor, useful: Tensor, needed: Tensor) -> tuple[Tensor, Tensor]:
    """(M, R, R) bool: who could take whose part; who completes whom."""
    others = ~torch.eye(fills.shape[1], dtype=torch.bool)
    alike = (fills @ fills.transpose(1, 2)) > 0.0
    # Two robots fill two needs where the needs that either can fill are two or more.
    units = fills * needed[:, None]
    either = units.sum(-1)[:, :, None] + units.sum(-1)[:, None] - units @ fills.transpose(1, 2)
    both = useful[:, :, None] & useful[:, None] & others
    return alike & others, both & (either > 1.0)


def _nearest_teammate(tables: TeamTables) -> Tensor:
    """(B, R, 2) way to the nearest teammate, at most 2 m in x and y; zero for a robot alone."""
    ways = tables.positions[:, None] - tables.positions[:, :, None]
    squares = ways.pow(2).sum(-1)
    nobody = torch.eye(ways.shape[1], dtype=torch.bool) | ~tables.is_there[:, None]
    nearest = squares.masked_fill(nobody, torch.inf).argmin(-1)
    found = ways.gather(2, nearest[..., None, None].expand(-1, -1, 1, 2)).squeeze(2)
    return found.clamp(-2.0, 2.0) * (~nobody).any(-1, keepdim=True)


def _next_victim(
    tables: TeamTables, order: Tensor, own: Tensor, robot: Tensor, slot: Tensor
) -> Tensor:
    """(P, 2) way from a pair's robot to its soonest other victim; zero where there is none."""
    if order.shape[1] < 2:
        return torch.zeros(len(robot), 2)
    first, second = order[robot, 0], order[robot, 1]
    other = torch.where(first == slot, second, first)
    way = tables.places[robot // tables.is_robot.shape[1], other]
    way = way - tables.positions.flatten(0, 1)[robot]
    return way * (own[robot, other] < NEVER_S)[:, None]


def _scarcity(tables: TeamTables) -> Tensor:
    """(B, R, 2) how much a robot's abilities are asked for: of the scarcest one, and of all."""
    have = tables.abilities * tables.is_robot[..., None]
    share = have * (tables.demand / have.sum(1).clamp(min=1.0))[:, None]
    return torch.stack([share.amax(-1), share.sum(-1)], -1)


def _robots(
    tables: TeamTables,
    cells: Tensor,
    soonest: Tensor,
    choices: Tensor,
    mate: Tensor,
    scarcity: Tensor,
) -> tuple[Tensor, Tensor, Tensor]:
    """The N robots for their actors, with their frames, and for a critic."""
    home = -tables.positions.flatten(0, 1)[cells]
    velocity, body = tables.velocities.flatten(0, 1)[cells], tables.bodies.flatten(0, 1)[cells]
    half = tables.worlds[cells // tables.is_robot.shape[1], 0]
    frames = frame_of(home)
    chosen = choices.view(-1)[cells]
    own = torch.stack(
        [
            body[:, 0],
            body[:, 1],
            body[:, 2].clamp(max=3.0),
            (chosen > 0).float(),
            chosen / 3.0,
            tables.abilities.flatten(0, 1)[cells].amax(-1),
            soonest.view(-1)[cells].clamp(max=4.0),
            half,
            *scarcity[cells].unbind(-1),
        ],
        -1,
    )
    vectors = [turn(vector, frames) for vector in (home, velocity, mate[cells])]
    way = home.norm(dim=-1)
    towards = (velocity * home).sum(-1) / way.clamp(min=1e-6)
    team = torch.cat([own, torch.stack([way / half, towards], -1)], -1)
    vectors.append(gains(vectors[0], vectors[1], body))
    return torch.cat([own, *vectors], -1), frames, team


def _worlds(tables: TeamTables) -> Tensor:
    """(B, WORLD_WIDTH) what tells teams and their tasks apart, for a critic."""
    robots = tables.is_there.float()
    number = robots.sum(1).clamp(min=1.0)
    speeds = tables.bodies[..., 0]
    slowest = speeds.masked_fill(~tables.is_there, torch.inf).amin(1).clamp(max=100.0)
    have = (tables.abilities * robots[..., None]).sum(1)
    spare = torch.where(tables.demand > 0.0, have / tables.demand.clamp(min=1e-6), 9.0).amin(1)
    return torch.stack(
        [
            number / 10.0,
            tables.worlds[:, 0],
            tables.worlds[:, 1] * 5.0,
            tables.worlds[:, 2] / 4.0,
            tables.demand.sum(1) / 2.0,
            spare.clamp(max=6.0) / 3.0,
            (speeds * robots).sum(1) / number,
            slowest,
            tables.is_victim.sum(1) / 4.0,
        ],
        -1,
    )
