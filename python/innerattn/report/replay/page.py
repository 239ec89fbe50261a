"""A replay as one page: records, styles and scripts in a single file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from innerattn.records.record import Record
from innerattn.report.html import fill, json_text, shared_text
from innerattn.report.replay.data import replay_document

_WEB = files("innerattn.report.replay") / "web"
_SHARED = (
    *("dom.js", "theme.js", "worlds.js", "story.js", "ground.js", "room.js"),
    *("senses.js", "scene.js", "marks.js", "charts.js", "panel.js"),
)
_SCRIPTS = ("data.js", "app.js")


def replay_page(
    records: Sequence[Record], names: Sequence[str], moments: Sequence[Mapping[str, str]] = ()
) -> str:
    """A page that replays recorded episodes in a browser.

    Args:
        records: of one to four policies, in the same worlds, recorded step by step.
        names: what each is called; any text.
        moments: what `read_moments` gave; the page lists them, and opens with the first.

    Returns:
        The page; it loads nothing from elsewhere.

    Raises:
        RunError: none or too many records, steps were not recorded, or worlds differ.
    """
    document = replay_document(records, names) | {"moments": list(moments)}
    return page_of(document, names)


def page_of(document: dict[str, Any], names: Sequence[str]) -> str:
    """The page of what `replay_document` gave."""
    return fill(
        _text("page.html"),
        title=escape(_listed(names)),
        style=f"{shared_text('colours.css', 'arena.css')}\n{_text('replay.css')}",
        script="\n".join([shared_text(*_SHARED), *map(_text, _SCRIPTS)]),
        data=json_text(document),
    )


def _listed(names: Sequence[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


def _text(name: str) -> str:
    return (_WEB / name).read_text("utf-8")
