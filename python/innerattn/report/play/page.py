"""The page of `innerattn play`, and what its server needs."""

from __future__ import annotations

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
_SCRIPTS = ("live.js", "link.js", "hands.js", "forms.js", "app.js")


def play_page(name: str) -> str:
    """The page; it asks the server that sent it for a world.

    Args:
        name: what is played, in the title; any text.
    """
    return fill(
        _text("play.html"),
        title=escape(name),
        style=f"{shared_text('colours.css', 'arena.css')}\n{_text('play.css')}",
        script="\n".join([shared_text(*_SHARED), *map(_text, _SCRIPTS)]),
    )


def play_pages(name: str) -> dict[str, partial[Answer]]:
    """All pages by name, for `innerattn.report.local_server.LocalServer`."""
    return {"": partial(Answer, "text/html", play_page(name))}


def _text(name: str) -> str:
    return (_WEB / name).read_text("utf-8")
