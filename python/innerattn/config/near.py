"""The known word that is nearest to a misspelt one, for messages that say "did you mean"."""

from __future__ import annotations

from collections.abc import Callable, Iterable

_ALIKE = 0.6
"""Least ratio of `difflib` at which two words are taken for the same; its own default."""


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known word that is most like ``word``, or none where all are too far from it."""
    import difflib  # slow to load, and needed only where something is wrong

    by_form = {_form(one): one for one in known}
    found = difflib.get_close_matches(_form(word), by_form, n=1, cutoff=_ALIKE)
    return by_form[found[0]] if found else None


def did_you_mean(word: str, known: Iterable[str], show: Callable[[str], str] = str) -> str:
    """The end of a message: ", did you mean 'mixed'?"; empty where no known word is near.

    Args:
        word: what was written.
        known: what could have been written.
        show: how the message writes a word, e.g. `repr` for a value.
    """
    found = nearest(word, known)
    return f", did you mean {show(found)}?" if found is not None else ""


def _form(word: str) -> str:
    """How words are compared: dashes and case make no difference."""
    return word.lower().replace("-", "_")
