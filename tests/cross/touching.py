"""Whether robots may touch something in a control period; nothing else is known of contacts."""

from __future__ import annotations

import numpy as np
from stepper import Array, Bools, State, Stepper


def may_touch(plain: Stepper, state: State, velocities: Array) -> Bools:
    """Whether anything comes near anything in the period, (E,); errs towards yes."""
    if plain.scenario.engine == "none":
        return plain.grazed
    dt, at = plain.scenario.dt_s, state.positions
    end = at + velocities * dt
    wall = plain.scenario.arena_half_width_m - plain.radii
    there = plain.there(state)
    near = ((np.maximum(abs(at), abs(end)).max(-1) > wall - 1e-4) & there).any(-1)
    apart = at[:, :, None] - at[:, None]
    closing = (velocities[:, :, None] - velocities[:, None]) * dt
    reach = plain.radii[:, None] + plain.radii + 1e-4 - 10 * np.eye(len(plain.radii))
    both = there[:, :, None] & there[:, None] & (plain.layers[:, None] == plain.layers)
    near |= ((closest(apart, closing) < reach) & both).any((-1, -2))
    for index, obstacle in enumerate(plain.scenario.obstacles):
        size = obstacle.radius_m or np.hypot(*(obstacle.half_extents_m or (0.0, 0.0)))
        apart = at - state.obstacles[:, None, index]
        close = closest(apart, velocities * dt) < plain.radii + size + 0.05
        blocked = [layer in (obstacle.layers or plain.layers) for layer in plain.layers]
        near |= (close & there & blocked).any(-1)
    return np.asarray(near)


def closest(apart: Array, motion: Array) -> Array:
    """Least distance from the origin on the way from `apart` to `apart + motion`."""
    length = (motion**2).sum(-1)
    share = -(apart * motion).sum(-1) / np.where(length > 0, length, 1.0)
    nearest = apart + np.clip(share, 0.0, 1.0)[..., None] * motion
    return np.asarray(np.linalg.norm(nearest, axis=-1))
