"""Compares an exported team with the learner that it comes from, on observations that it plays."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from innerattn.config import RunConfig
from innerattn.envs import BatchEnv
from innerattn.errors import ExportError
from innerattn.learn.framed import as_seen
from innerattn.learn.types import Learner
from innerattn.nn import Actor
from innerattn.nn.actions import mean_and_log_std
from innerattn.policies.exported.contract import Checked
from innerattn.policies.exported.network import probabilities_of
from innerattn.policies.exported.team import Exported

OBSERVATIONS = 10_000
"""Observations that are compared at least, those of all robots together."""
MOST_DIFFERENCE = 1e-5
"""Largest difference of a probability or force, and of an output as a share of the largest one, if
above 1."""
_STEPS = 25
_SEED = 20_260


@dataclass
class _Tally:
    """What is found, over all robots."""

    rows: int = 0
    same: int = 0
    near_ties: int = 0
    onnx: float = 0.0
    numpy: float = 0.0


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
    tally = _Tally()
    worlds = -(-OBSERVATIONS // (_STEPS * len(onnx.robot_names)))
    learner.seed_draws(_SEED)
    with closing(BatchEnv(config.scenario, worlds, seed=_SEED)) as env:
        obs = env.reset()
        for _ in range(_STEPS):
            seen = torch.tensor(obs)
            logits = logits_of(learner, actor, seen)
            greedy = learner.act(seen, greedy=True).numpy()
            for index, robot in enumerate(onnx.robot_names):
                _compare(
                    robot, logits[:, index], greedy[:, index], obs[:, index], onnx, plain, tally
                )
            obs = env.step(learner.act(seen).numpy()).obs
    return Checked(
        observations=tally.rows,
        same_greedy_action=tally.same,
        near_ties=tally.near_ties,
        largest_difference_onnx=tally.onnx,
        largest_difference_numpy=tally.numpy,
    )


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
    onnx: Exported,
    plain: Exported,
    tally: _Tally,
) -> None:
    rows = np.ascontiguousarray(rows)
    continuous = greedy.ndim == 2
    scale = np.maximum(1.0, np.abs(logits).max(axis=1))
    tied = np.zeros(len(rows), bool)
    if not continuous:
        best = np.sort(logits, axis=1)
        tied = best[:, -1] - best[:, -2] <= 2 * MOST_DIFFERENCE * scale
    differ = np.zeros(len(rows), bool)
    for team, name in ((onnx, "onnx"), (plain, "numpy")):
        # One by one, as a robot asks: other numbers of rows round in another way.
        found = np.concatenate([team.logits(robot, row[None]) for row in rows])
        differences = np.abs(found - logits).max(axis=1) / scale
        if continuous:
            away = np.abs(np.tanh(found[:, :2]) - greedy).max(axis=1)
            chances, others = away, away >= MOST_DIFFERENCE
        else:
            chances = np.abs(probabilities_of(found) - probabilities_of(logits)).max(axis=1)
            others = found.argmax(axis=1) != greedy
        largest = float(np.maximum(differences, chances).max())
        if not largest < MOST_DIFFERENCE:  # NaN too
            raise ExportError(
                f"{robot}: the exported policy ({team.backend}) differs from the trained one by "
                f"{largest:.1e}: must be below {MOST_DIFFERENCE:.0e}; nothing was written"
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
