"""Draws the moving picture of the README into docs/images; run it as `make docs`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.envs.render import draw_world
from innerattn.policies import PolicyInput, WorldState, scripted_policy

IMAGES = Path(__file__).parent / "images"
SEED = 99
STEPS = 40
PIXELS = 400
COLOURS = 48


def main() -> None:
    """Draw one mixed world in which `hungarian` acts, a picture for each control step."""
    frames = [Image.fromarray(frame) for frame in play()]
    palette = frames[0].quantize(COLOURS)
    small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    IMAGES.mkdir(exist_ok=True)
    small[0].save(
        IMAGES / "rescue.gif", save_all=True, append_images=small[1:], duration=150, loop=0
    )


def play() -> list[NDArray[np.uint8]]:
    """Pictures (H, W, 3) of an episode; the title counts the rescues."""
    scenario = Scenario.preset("mixed").replace(episode_steps=STEPS)
    policy = scripted_policy("hungarian", scenario)
    frames, rescues = [], 0
    with BatchEnv(scenario, 1, seed=SEED) as env:
        obs = env.reset()
        for step in range(STEPS):
            state = WorldState.of(env)
            count = "1 rescue" if rescues == 1 else f"{rescues} rescues"
            frames.append(
                draw_world(
                    scenario,
                    state.positions[0],
                    state.velocities[0],
                    state.victims[0],
                    env.obstacles()[0],
                    title=f"{step * scenario.dt_s:.1f} s, {count}",
                    pixels=PIXELS,
                )
            )
            result = env.step(policy.act(PolicyInput(obs, state)))
            obs, rescues = result.obs, rescues + len(result.rescues)
    return frames


if __name__ == "__main__":
    main()
