"""Compares an exported team with the learner that it comes from, on observations that it plays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from innerattn.config import RunConfig, Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import ExportError
from innerattn.learn.framed import as_seen
from innerattn.learn.types import Learner
from innerattn.nn import Actor
from innerattn.nn.actions import mean_and_log_std
from innerattn.policies.exported.contract import Checked
from innerattn.policies.exported.network import probabilities_of
from innerattn.policies.exported.team import Exported
from innerattn.train.teams.policy import TeamPolicy

OBSERVATIONS = 10_000
"""Observations that are compared at least, those of all robots together."""
MOST_DIFFERENCE = 1e-5
"""Largest difference of a probability or force, and of an output as a share of the largest one, if
above 1."""
MOST_OF_PAIRS = 1e-4
"""The same for policies for any team, whose last layer is multiplied by ten."""
_STEPS = 25
_SEED = 20_260
_NUDGE, _NUDGES, _NEAR = 1e-6, 32, 1e-3
"""Of rows that are tried beside one where a policy for any team jumps: how far their numbers differ
as a share, how many there are, and how near a probability must come."""


@dataclass
class _Tally:
    """What is found, over all robots."""

    rows: int = 0
    same: int = 0
    near_ties: int = 0
    onnx: float = 0.0
    numpy: float = 0.0

    def checked(self, onnx: float | None) -> Checked:
        """For a contract; ``onnx`` is the largest difference there, if there are such files."""
        return Checked(
            observations=self.rows,
            same_greedy_action=self.same,
            near_ties=self.near_ties,
            largest_difference_onnx=onnx,
            largest_difference_numpy=self.numpy,
        )


def check_export(
    config: RunConfig, learner: Learner, actor: Actor, onnx: Exported, plain: Exported
) -> Checked:
    """Play the team and compare every robot's logits and likeliest action.

    A robot whose two best actions differ by less than rounding has no likeliest action: such
    observations are counted as near ties where the greedy actions differ.

    Args:
        config: the run.
        learner: with its weights; it draws actions.
        actor: the policies inside it.
        onnx: the export in onnxruntime.
        plain: the export in numpy.

    Raises:
        ExportError: they differ; the message says where.
    """
    tally, teams = _Tally(), {"onnx": onnx, "numpy": plain}
    for obs, seen in _played(config.scenario, learner):
        logits = logits_of(learner, actor, seen)
        greedy = learner.act(seen, greedy=True).numpy()
        for index, robot in enumerate(onnx.robot_names):
            _compare(robot, logits[:, index], greedy[:, index], obs[:, index], teams, tally)
    return tally.checked(onnx=tally.onnx)


def check_pairs(
    scenario: Scenario, policy: TeamPolicy, plain: Exported, onnx: Exported | None = None
) -> Checked:
    """As `check_export`, of a policy for any team.

    Each robot looks at its own row, in the learner too. Where two robots arrive at a victim at the
    same time but for rounding, the policy itself jumps: there the export must give what the learner
    gives for a row that is hardly another.

    Args:
        scenario: the worlds.
        policy: with its weights; it draws actions.
        plain: the export in numpy.
        onnx: the export in onnxruntime; None: it has no ONNX file.

    Raises:
        ExportError: they differ; the message says where.
    """
    tally, teams = _Tally(), {"numpy": plain}
    if onnx is not None:
        teams["onnx"] = onnx
    names = [column.name for column in plain.contract.observation]
    moving = np.array(["position" in name or "velocity" in name for name in names])
    for obs, seen in _played(scenario, policy):
        logits = np.asarray(policy.own_log_probs(seen).numpy())
        for index, robot in enumerate(plain.robot_names):
            own = logits[:, index]
            greedy, jumps = own.argmax(axis=1), partial(at_edge, policy, moving, index)
            _compare(robot, own, greedy, obs[:, index], teams, tally, MOST_OF_PAIRS, jumps)
    return tally.checked(onnx=None if onnx is None else tally.onnx)


def _played(
    scenario: Scenario, learner: Learner
) -> Iterator[tuple[NDArray[np.float32], torch.Tensor]]:
    """Observations (E, R, D) that a team plays, and a copy of them; `OBSERVATIONS` rows in all."""
    worlds = -(-OBSERVATIONS // (_STEPS * len(scenario.robots)))
    learner.seed_draws(_SEED)
    with closing(BatchEnv(scenario, worlds, seed=_SEED)) as env:
        obs = env.reset()
        for _ in range(_STEPS):
            seen = torch.tensor(obs)
            yield obs, seen
            obs = env.step(learner.act(seen).numpy()).obs


def at_edge(
    policy: TeamPolicy,
    moving: NDArray[np.bool_],
    robot: int,
    row: NDArray[np.float32],
    found: NDArray[np.float32],
) -> bool:
    """Whether a policy gives log-probabilities (5) for a row that is ``row`` (D,) but for rounding.

    Args:
        policy: the learner's.
        moving: (D,) which columns are places or velocities.
        robot: whose row it is.
        row: its row.
        found: what the export says of it.
    """
    noise = np.random.default_rng(_SEED).uniform(-_NUDGE, _NUDGE, (_NUDGES, len(row)))
    noise[:, ~moving] = 0.0
    near = torch.zeros(_NUDGES, policy.num_robots, len(row))
    near[:, robot] = torch.from_numpy((row * (1.0 + noise)).astype(np.float32))
    theirs = policy.own_log_probs(near)[:, robot].exp().numpy()
    return bool(np.abs(theirs - np.exp(found)).max(axis=1).min() < _NEAR)


@torch.no_grad()
def logits_of(learner: Learner, actor: Actor, obs: torch.Tensor) -> NDArray[np.float32]:
    """Logits (B, R, A) of the world's actions for observations (B, R, D), as training has them.

    (B, R, 4) where actions are continuous, as `innerattn.policies.exported.contract` has them.
    """
    if learner.act(obs[:1], greedy=True).is_floating_point():
        return _vectors_of(learner, actor, obs)
    seen, _ = as_seen(learner, obs, torch.zeros(obs.shape[:2], dtype=torch.int64))
    inside = actor(seen.transpose(0, 1)).permute(2, 0, 1)
    named = [
        as_seen(learner, obs, torch.full(obs.shape[:2], action))[1]
        for action in range(inside.shape[2])
    ]
    return np.asarray(inside.gather(2, torch.stack(named, dim=2)).numpy())


def _vectors_of(learner: Learner, actor: Actor, obs: torch.Tensor) -> NDArray[np.float32]:
    """Means and log standard deviations (B, R, 4) in the frame of the world."""
    nothing = torch.zeros(*obs.shape[:2], 2)
    seen, _ = as_seen(learner, obs, nothing)
    mean, log_std = (one.permute(2, 0, 1) for one in mean_and_log_std(actor(seen.transpose(0, 1))))
    # What x and y of the world are called in the frames: a vector's x is its part along the first.
    axes = [as_seen(learner, obs, nothing + axis)[1] for axis in torch.eye(2)]
    back = [(mean * axis).sum(dim=2) for axis in axes]
    back += [(log_std * axis.abs()).sum(dim=2) for axis in axes]
    return np.asarray(torch.stack(back, dim=2).numpy())


def _compare(
    robot: str,
    logits: NDArray[np.float32],
    greedy: NDArray[Any],
    rows: NDArray[np.float32],
    teams: Mapping[str, Exported],
    tally: _Tally,
    most: float = MOST_DIFFERENCE,
    jumps: Callable[[NDArray[np.float32], NDArray[np.float32]], bool] | None = None,
) -> None:
    """Compare the rows of one robot.

    Args:
        robot: its name.
        logits: (B, A) or (B, 4) of the learner.
        greedy: (B,) or (B, 2) its likeliest actions.
        rows: (B, D).
        teams: the export in each backend.
        tally: is added to.
        most: `MOST_DIFFERENCE`, or what takes its place.
        jumps: says of a row and what the export gives whether the learner itself jumps there.
    """
    rows = np.ascontiguousarray(rows)
    continuous = greedy.ndim == 2
    scale = np.maximum(1.0, np.abs(logits).max(axis=1))
    tied = np.zeros(len(rows), bool)
    if not continuous:
        best = np.sort(logits, axis=1)
        tied = best[:, -1] - best[:, -2] <= 2 * most * scale
    differ = np.zeros(len(rows), bool)
    for name, team in teams.items():
        # One by one, as a robot asks: other numbers of rows round in another way.
        found = np.concatenate([team.logits(robot, row[None]) for row in rows])
        differences = np.abs(found - logits).max(axis=1) / scale
        if continuous:
            away = np.abs(np.tanh(found[:, :2]) - greedy).max(axis=1)
            chances, others = away, away >= most
        else:
            chances = np.abs(probabilities_of(found) - probabilities_of(logits)).max(axis=1)
            others = found.argmax(axis=1) != greedy
        apart = np.maximum(differences, chances)
        if jumps is not None:
            for row in np.flatnonzero(apart >= most):
                if jumps(rows[row], found[row]):
                    apart[row], tied[row] = 0.0, True
        largest = float(apart.max())
        if not largest < most:  # NaN too
            raise ExportError(
                f"{robot}: the exported policy ({team.backend}) differs from the trained one by "
                f"{largest:.1e}: must be below {most:.0e}; nothing was written"
            )
        setattr(tally, name, max(getattr(tally, name), largest))
        if (others & ~tied).any():
            raise ExportError(
                f"{robot}: the exported policy ({team.backend}) takes another likeliest action in "
                f"{int((others & ~tied).sum())} of {len(rows)} observations; nothing was written"
            )
        differ |= others
    tally.rows += len(rows)
    tally.same += int((~differ).sum())
    tally.near_ties += int(differ.sum())
