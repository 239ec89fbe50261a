"""The known word that is nearest to a misspelt one, for messages that say "did you mean"."""

from __future__ import annotations

from collections.abc import Callable, Iterable

_ALIKE = 0.6
"""Least ratio of `difflib` at which two words are taken for the same; its own default."""

_LEAST_BEGINNING = 3


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The first known word that begins as ``word``, else the one most like it, else none.

    Dashes, underscores and case make no difference.
    """
    import difflib  # slow to load, and needed only where something is wrong

    by_form = {_form(one): one for one in known}
    begun = [one for form, one in by_form.items() if form.startswith(_form(word))]
    if begun and len(word) >= _LEAST_BEGINNING:
        return begun[0]
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
