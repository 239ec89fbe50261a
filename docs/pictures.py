"""Draws the pictures of the documentation into docs/images; run it as `make docs`."""

from pathlib import Path

from matplotlib.image import imsave

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.envs.render import draw_world
from innerattn.policies import PolicyInput, WorldState, scripted_policy

IMAGES = Path(__file__).parent / "images"
SEED = 99
STEPS = 4


def main() -> None:
    """Draw one mixed world, a few steps into an episode that `hungarian` plays."""
    scenario = Scenario.preset("mixed")
    policy = scripted_policy("hungarian", scenario)
    with BatchEnv(scenario, 1, seed=SEED) as env:
        obs = env.reset()
        for _ in range(STEPS):
            seen = PolicyInput(obs, WorldState.of(env))
            obs = env.step(policy.act(seen)).obs
        picture = draw_world(
            scenario,
            env.positions()[0],
            env.velocities()[0],
            env.victims()[0],
            env.obstacles()[0],
        )
    IMAGES.mkdir(exist_ok=True)
    imsave(IMAGES / "world.png", picture)


if __name__ == "__main__":
    main()
