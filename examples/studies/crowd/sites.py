"""Writes the worlds of ../crowd.toml: sites far apart, with three robots and a victim each.

`python examples/studies/crowd/sites.py` writes crowd_3.toml to crowd_63.toml beside itself.
"""

import math
from pathlib import Path

SITES = (1, 3, 5, 11, 21)
PITCH_M, REACH_M = 3.0, 0.6
"""From site to site, and from the middle of a site to where its victims end."""
TEAM = (  # kind, ability, top speed [m/s], mass [kg], start beside the middle of the site [m]
    ("food", "food", 1.0, 1.0, (-0.4, -0.4)),
    ("navigation", "information", 1.5, 0.5, (0.4, -0.4)),
    ("medical", "medicine", 1.5, 0.5, (0.0, 0.4)),
)


def world(sites: int) -> str:
    """The scenario of so many sites as TOML."""
    across = math.ceil(math.sqrt(sites))
    half = across * PITCH_M / 2
    middles = [
        (PITCH_M * (site % across + 0.5) - half, PITCH_M * (site // across + 0.5) - half)
        for site in range(sites)
    ]
    robots = [
        f'  {{ name = "{kind}_{site}", kind = "{kind}", abilities = ["{ability}"], '
        f"max_speed_mps = {speed}, mass_kg = {mass}, start_m = [{x + dx:.1f}, {y + dy:.1f}] }},"
        for site, (x, y) in enumerate(middles)
        for kind, ability, speed, mass, (dx, dy) in TEAM
    ]
    tasks = []
    for site, (x, y) in enumerate(middles):
        ends = ", ".join(
            f"{end:.1f}" for end in (x - REACH_M, y - REACH_M, x + REACH_M, y + REACH_M)
        )
        needs = ", ".join(f'"{ability}"' for _, ability, *_ in TEAM)
        tasks.append(f'  {{ name = "site_{site}", needs = [{needs}], area_m = [{ends}] }},')
    return "\n".join(
        [
            "# Made by sites.py.",
            'situation = "double"',
            f"arena_half_width_m = {half}",
            "rescue_radius_m = 0.35",
            "episode_steps = 50",
            'engine = "discs"',
            "observed_teammates = 0",
            "observed_victims = 1",
            "robots = [",
            *robots,
            "]",
            "tasks = [",
            *tasks,
            "]",
            "",
        ]
    )


if __name__ == "__main__":
    for sites in SITES:
        path = Path(__file__).with_name(f"crowd_{len(TEAM) * sites}.toml")
        path.write_text(world(sites), encoding="utf-8")
