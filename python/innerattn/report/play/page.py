"""The page of `innerattn play`, and what its server needs; `innerattn page` fills the same page."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from html import escape
from importlib.resources import files

from innerattn.report.html import fill, shared_text
from innerattn.report.local_server import Answer

_WEB = files("innerattn.report.play") / "web"
_SHARED = (
    *("dom.js", "theme.js", "worlds.js", "story.js", "ground.js", "room.js"),
    *("senses.js", "scene.js", "marks.js", "charts.js", "panel.js"),
)
_BEFORE = ("live.js", "balance.js", "link.js")
_AFTER = ("hands.js", "forms.js", "about.js", "arena.js", "app.js")


def play_page(name: str, beside: str = "") -> str:
    """The page; it asks the server that sent it for a world, or for two.

    Args:
        name: what is played, in the title; any text.
        beside: as of `filled_page`.
    """
    return filled_page(name, [_text("server.js")], beside)


def filled_page(
    name: str, answering: Sequence[str], beside: str = "", head: str = "", given: str = ""
) -> str:
    """The page with the scripts that answer its messages.

    Args:
        name: what is played, in the title; any text.
        beside: policy that acts in a second arena beside the first; empty: there is none.
        answering: scripts that have a function `transport`, as in `web/server.js`.
        head: elements to add to its head.
        given: elements before its scripts, for these.
    """
    before, after = (map(_text, names) for names in (_BEFORE, _AFTER))
    return fill(
        _text("play.html"),
        title=escape(name),
        beside=escape(beside),
        head=head,
        given=given,
        style=f"{shared_text('colours.css', 'arena.css')}\n{_text('play.css')}",
        script="\n".join([shared_text(*_SHARED), *before, *answering, *after]),
    )


def play_pages(name: str, beside: str = "") -> dict[str, partial[Answer]]:
    """All pages by name, for `innerattn.report.local_server.LocalServer`; see `play_page`."""
    return {"": partial(Answer, "text/html", play_page(name, beside))}


def _text(name: str) -> str:
    return (_WEB / name).read_text("utf-8")
