"""Writes the worlds of ../short_sight.toml: teams of 8 and 16 robots that see and hear so far.

`python examples/studies/short_sight/teams.py` writes team_8_sight_2.toml to
team_16_sight_40.toml beside itself.
"""

import math
from pathlib import Path

SIZES = (8, 16)
SIGHTS = (2, 4, 8, 40)
"""In diameters of a robot; the longest one is longer than every arena."""
DIAMETER_M = 0.1
TEAM = (  # kind, ability, top speed [m/s], mass [kg]; two of the first for one of each other
    ("food", "food", 1.0, 1.0),
    ("food", "food", 1.0, 1.0),
    ("navigation", "information", 1.5, 0.5),
    ("medical", "medicine", 1.5, 0.5),
)


def world(size: int, sight: int) -> str:
    """The scenario of so many robots, which see so many diameters far, as TOML.

    The arena and the victims grow with the team: two victims and 4 m2 for four robots, as in
    `mixed`.
    """
    reach_m = sight * DIAMETER_M
    counts: dict[str, int] = {}
    robots = []
    for kind, ability, speed, mass in sorted(TEAM * (size // len(TEAM))):
        number = counts[kind] = counts.get(kind, -1) + 1
        robots.append(
            f'  {{ name = "{kind}_{number}", kind = "{kind}", abilities = ["{ability}"], '
            f"max_speed_mps = {speed}, mass_kg = {mass}, sight_m = {reach_m:.1f} }},"
        )
    return "\n".join(
        [
            f"# {size} robots that see and hear {sight} diameters far. Written by teams.py.",
            'situation = "mixed"',
            f"arena_half_width_m = {math.sqrt(size / len(TEAM)):.2f}",
            f"max_victims = {size // 2}",
            "episode_steps = 50",
            "robots = [",
            *robots,
            "]",
            f'communication = {{ range_m = {reach_m:.1f}, share = "victims" }}',
            "",
        ]
    )


if __name__ == "__main__":
    for size in SIZES:
        for sight in SIGHTS:
            name = f"team_{size}_sight_{sight}.toml"
            (Path(__file__).parent / name).write_text(world(size, sight), encoding="utf-8")
