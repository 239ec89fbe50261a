"""The page of a schedule: data, styles and scripts in a single file that needs no network."""

from __future__ import annotations

from html import escape
from importlib.resources import files

from innerattn.config.instances import Instance
from innerattn.policies.scripted.planner import Schedule
from innerattn.report.html import fill, json_text, shared_text
from innerattn.report.schedule.data import schedule_document
from innerattn.report.tables.instances import schedule_line

_WEB = files("innerattn.report.schedule") / "web"
_SHARED = ("dom.js", "theme.js", "story.js", "ground.js", "marks.js", "plots.js")
_SCRIPTS = ("course.js", "map.js", "gantt.js", "app.js")


def schedule_page(instance: Instance, schedule: Schedule, policy: str) -> str:
    """A page that shows in a browser how robots carry out a schedule.

    Args:
        instance: the robots and tasks.
        schedule: for this instance.
        policy: which planner made it; any text.

    Returns:
        The page; it loads nothing from elsewhere.
    """
    return fill(
        _text("page.html"),
        title=escape(f"{instance.name}, planned by {policy}"),
        headline=escape(schedule_line(instance, schedule)),
        style=f"{shared_text('colours.css', 'arena.css')}\n{_text('schedule.css')}",
        script="\n".join([shared_text(*_SHARED), *map(_text, _SCRIPTS)]),
        data=json_text(schedule_document(instance, schedule)),
    )


def _text(name: str) -> str:
    return (_WEB / name).read_text("utf-8")
