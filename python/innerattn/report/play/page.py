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
_BEFORE, _AFTER = ("live.js", "link.js"), ("hands.js", "forms.js", "about.js", "app.js")


def play_page(name: str) -> str:
    """The page; it asks the server that sent it for a world.

    Args:
        name: what is played, in the title; any text.
    """
    return filled_page(name, [_text("server.js")])


def filled_page(name: str, answering: Sequence[str], head: str = "", given: str = "") -> str:
    """The page with the scripts that answer its messages.

    Args:
        name: what is played, in the title; any text.
        answering: scripts that have a function `transport`, as in `web/server.js`.
        head: elements to add to its head.
        given: elements before its scripts, for these.
    """
    before, after = (map(_text, names) for names in (_BEFORE, _AFTER))
    return fill(
        _text("play.html"),
        title=escape(name),
        head=head,
        given=given,
        style=f"{shared_text('colours.css', 'arena.css')}\n{_text('play.css')}",
        script="\n".join([shared_text(*_SHARED), *before, *answering, *after]),
    )


def play_pages(name: str) -> dict[str, partial[Answer]]:
    """All pages by name, for `innerattn.report.local_server.LocalServer`."""
    return {"": partial(Answer, "text/html", play_page(name))}


def _text(name: str) -> str:
    return (_WEB / name).read_text("utf-8")
