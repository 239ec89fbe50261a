"""The file of `innerattn page`: worlds as WebAssembly, policies, and the page to play with."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping
from contextlib import closing
from importlib.resources import files
from typing import Any

from innerattn.config import Scenario
from innerattn.config.streams import stream_seed
from innerattn.envs import BatchEnv
from innerattn.envs.senses import ray_columns
from innerattn.evaluate.interactive import endless
from innerattn.report.html import json_text
from innerattn.report.page.scripts import script_document
from innerattn.report.page.team import PageTeam
from innerattn.report.play.page import filled_page
from innerattn.report.play.state import playable_worlds

WORLDS = "worlds.wasm"
"""The compiled worlds, beside this file; `make wasm` makes them."""
_FOLDER = files("innerattn.report.page")
_SCRIPTS = (
    *("rust.js", "layers.js", "frame.js", "encoder.js", "memory.js", "messages.js"),
    *("attention.js", "team.js", "roles.js", "pairs.js", "any_team.js"),
    *("scripts.js", "engine.js"),
)
_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline' 'wasm-unsafe-eval'"
)


def worlds_page(
    title: str,
    scenario: Scenario,
    policies: Mapping[str, PageTeam | None],
    seed: int,
    beside: str = "",
    num_own: int | None = None,
) -> str:
    """A page in which a person plays with a team; it loads nothing from elsewhere.

    Args:
        title: what is played; any text.
        scenario: the worlds.
        policies: teams by the name to show; None: the script of that name. The first one acts.
        seed: of the worlds, 0 to 2**63 - 1.
        beside: which of the policies acts in a second arena beside the first, in the same world;
            empty: there is none.
        num_own: how many robots of ``scenario`` are the team, the first ones; the others are spare
            ones of `innerattn.evaluate.spares`. None: all are the team.

    Raises:
        ConfigError: a page cannot compute such a script in these worlds.
    """
    code = (_FOLDER / WORLDS).read_bytes()
    packed = base64.b64encode(gzip.compress(code, 9, mtime=0)).decode()
    given = page_document(scenario, policies, seed, num_own) | {"rust": packed}
    return filled_page(
        title,
        [(_FOLDER / "web" / name).read_text("utf-8") for name in _SCRIPTS],
        beside,
        head=f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n',
        given=f'<script id="given" type="application/json">{json_text(given)}</script>\n',
    )


def page_document(
    scenario: Scenario,
    policies: Mapping[str, PageTeam | None],
    seed: int,
    num_own: int | None = None,
) -> dict[str, Any]:
    """What the page's world begins with, but for its code; arguments as of `worlds_page`."""
    worlds = endless(scenario)
    with closing(BatchEnv(worlds, 1, num_threads=1)) as env:
        rays = ray_columns(env)
    return {
        "scenario": worlds.model_dump_json(),
        "seed": str(stream_seed(seed, "evaluation")),
        "worlds": playable_worlds(worlds, num_own),
        "slots": [list(worlds.slots_of(task)) for task in range(len(worlds.tasks))],
        "rays": rays,
        "policies": [_policy(name, team, worlds) for name, team in policies.items()],
    }


def _policy(name: str, team: PageTeam | None, worlds: Scenario) -> dict[str, Any]:
    if team is not None:
        return {"name": name, "team": team.document, "weights": team.base64}
    return {"name": name} | script_document(name, worlds)
