"""What a notebook shows of a scenario, of worlds, of a record and of a run: a picture or a replay.

Without Matplotlib the picture of a world is left out.
"""

from __future__ import annotations

import base64
import io
from contextlib import closing
from dataclasses import replace
from functools import singledispatch
from html import escape
from typing import TYPE_CHECKING

from innerattn.config import Scenario
from innerattn.config.amounts import in_words
from innerattn.envs import BatchEnv
from innerattn.envs.render import draw_world, positions_of
from innerattn.evaluate import Evaluation
from innerattn.experiments.run import FinishedRun
from innerattn.records.record import Record
from innerattn.report.html import html_table
from innerattn.report.replay.data import NEEDED
from innerattn.report.replay.page import replay_page
from innerattn.report.runs.tables import scores_table
from innerattn.report.table import columns, plain_table

if TYPE_CHECKING:
    from innerattn.report.table import Table

MOST_EPISODES = 12
"""As many episodes of a record a notebook replays."""

_PIXELS = 420


@singledispatch
def html_of(thing: object) -> str:
    """HTML of a scenario, of worlds, of a record, of an evaluation or of a finished run.

    Raises:
        TypeError: it is something else.
    """
    raise TypeError(f"{type(thing).__name__}: has no picture")


@html_of.register
def _(scenario: Scenario) -> str:
    with closing(BatchEnv(scenario, 1, seed=0, num_threads=1)) as env:
        env.reset()
        picture = _picture(env, "a start")
    return f"{picture}{html_table(_team(scenario))}{html_table(_tasks(scenario))}"


@html_of.register
def _(env: BatchEnv) -> str:
    worlds = "1 world" if env.num_envs == 1 else f"{env.num_envs:,} worlds, the first of them"
    step, episode = int(env.step_counts()[0]), int(env.episodes()[0])
    return _picture(env, f"{worlds}: episode {episode}, step {step}")


@html_of.register
def _(record: Record) -> str:
    if any(name not in record.steps for name in NEEDED):
        return html_table(_counts(record))
    return _replay(record, record.policy)


@html_of.register
def _(evaluation: Evaluation) -> str:
    return html_of(evaluation.records[0])


@html_of.register
def _(run: FinishedRun) -> str:
    scores = html_table(scores_table([[run]]))
    return f"{scores}{html_of(run.recorded)}"


def _picture(env: BatchEnv, title: str) -> str:
    try:
        pixels = draw_world(
            env.scenario,
            positions_of(env.positions()[0], env.present()[0]),
            env.velocities()[0],
            env.victims()[0],
            env.obstacles()[0],
            env.headings()[0],
            step=int(env.step_counts()[0]),
            title=title,
            pixels=_PIXELS,
        )
    except ImportError:
        return f"<p>{escape(title)} (pip install matplotlib shows a picture)</p>"
    from PIL import Image

    data = io.BytesIO()
    Image.fromarray(pixels).quantize(64).save(data, "PNG", optimize=True)
    text = base64.b64encode(data.getvalue()).decode("ascii")
    alt = f"Arena, situation {env.scenario.situation}, {title}"
    return f'<img alt="{escape(alt, quote=True)}" src="data:image/png;base64,{text}">'


def _replay(record: Record, name: str) -> str:
    page = replay_page([_first_episodes(record)], [name])
    style = "width:100%;height:900px;max-height:88svh;border:0"
    return f'<iframe title="Replay" style="{style}" srcdoc="{escape(page, quote=True)}"></iframe>'


def _first_episodes(record: Record) -> Record:
    end = record.first_episode + MOST_EPISODES
    return replace(
        record,
        lengths=record.lengths[:MOST_EPISODES],
        rescues=record.rescues[record.rescues["episode"] < end],
        rewards_total=record.rewards_total[:MOST_EPISODES],
        steps={name: values[:MOST_EPISODES] for name, values in record.steps.items()},
    )


def _team(scenario: Scenario) -> Table:
    heads = columns(["robot", "kind", "abilities"], ["m/s", "kg"])
    rows = [
        [
            *(robot.name, robot.kind, ", ".join(in_words(robot.abilities))),
            *(f"{robot.max_speed_mps:g}", f"{robot.mass_kg:g}"),
        ]
        for robot in scenario.robots
    ]
    return plain_table(heads, rows)


def _tasks(scenario: Scenario) -> Table:
    rows = [[task.name, ", ".join(in_words(task.needs))] for task in scenario.tasks]
    return plain_table(columns(["task", "needs"]), rows)


def _counts(record: Record) -> Table:
    heads = columns(["policy"], ["episodes", "rescues", "seed"])
    row = [record.policy, f"{record.num_episodes:,}", f"{len(record.rescues):,}", str(record.seed)]
    return plain_table(heads, [row])
