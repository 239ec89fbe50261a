"""From words to a command's options; words that are wrong are told in one line each, code 2.

The library that parses tells of what it refuses by events of its own. What it tells otherwise, or
in another version, is left to it: then its own message is longer, with the same exit code.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, NoReturn, get_type_hints

import tyro

from innerattn.cli.options import UsageError
from innerattn.config.near import nearest
from innerattn.errors import plain

_HELP = ("-h", "--help", "--help-all")
_KINDS_OF_VALUES = {"INT": "a whole number", "FLOAT": "a number", "PATH": "a path", "STR": "a word"}
_MOST_MEANT = 3


def parse(command: Any, argv: Sequence[str], prog: str, *, all_known: bool = True) -> Any:
    """The command that ``argv`` describes.

    Args:
        command: dataclass of its options.
        argv: the words after the command's name.
        prog: how a user calls the command, for messages.
        all_known: whether words that are no options of ``command`` are refused; else they are
            left out.

    Raises:
        SystemExit: help was asked for (code 0), or the words are wrong (code 2).
    """
    try:
        if all_known:
            _refuse_unknown(command, argv, prog)
        with _told_in_a_line(argv, prog):
            if all_known:
                return tyro.cli(command, args=argv, prog=prog)
            return tyro.cli(command, args=argv, prog=prog, return_unknown_args=True)[0]
    except UsageError as error:
        refuse(error)


def refuse(error: UsageError) -> NoReturn:
    """Say on standard error what is wrong, and end the process with code 2."""
    print(f"innerattn: error: {plain(str(error))}", file=sys.stderr)
    raise SystemExit(2) from error


def words_of(argv: Sequence[str]) -> Iterator[str]:
    """The words before a lone "--", after which no word is an option."""
    for word in argv:
        if word == "--":
            return
        yield word


def option_names(command: Any, prefix: str = "--") -> list[str]:
    """The long options of a dataclass, spelt with dashes, those of its sections included."""
    names: list[str] = []
    hints = get_type_hints(command, include_extras=True)
    for field in dataclasses.fields(command):
        hint = hints[field.name]
        notes = getattr(hint, "__metadata__", ())
        kind = getattr(hint, "__origin__", hint) if notes else hint
        if _POSITIONAL in notes:
            continue
        given = [note for note in notes if hasattr(note, "aliases")]
        name = next((note.name for note in given if note.name), field.name).replace("_", "-")
        if dataclasses.is_dataclass(kind):
            names += option_names(kind, f"{prefix}{name}.")
            continue
        names.append(prefix + name)
        if kind is bool and _ONE_WAY not in notes:
            names.append(f"{prefix}no-{name}")
        names += [one for note in given for one in note.aliases or () if one.startswith("--")]
    return names


_POSITIONAL = tyro.conf.Positional[str].__metadata__[0]  # type: ignore[attr-defined]
_ONE_WAY = tyro.conf.FlagCreatePairsOff[bool].__metadata__[0]  # type: ignore[attr-defined]


def _refuse_unknown(command: Any, argv: Sequence[str], prog: str) -> None:
    names = option_names(command)
    for word in words_of(argv):
        option = word.partition("=")[0]
        if not option.startswith("--") or option in _HELP:
            continue
        if option.replace("_", "-") not in names:
            raise UsageError(f"{option}: unknown option{_meant(option, names, prog)}")


def _meant(option: str, names: Sequence[str], prog: str) -> str:
    """What may have been meant: the same word in a section, or the nearest option."""
    word = option.lstrip("-").replace("_", "-")
    same = [name for name in names if name.rpartition(".")[2].lstrip("-") == word]
    near = nearest(option, names) or nearest(word, [name.rpartition(".")[2] for name in names])
    if not same and near is not None:
        same = [name for name in names if name == near or name.rpartition(".")[2] == near]
    if same:
        same.sort(key=lambda name: not name.startswith("--train."))  # keys of the run come first
        return f", did you mean {' or '.join(same[:_MOST_MEANT])}?"
    return f"; {prog} --help-all lists all"


def _told_in_a_line(argv: Sequence[str], prog: str) -> AbstractContextManager[None]:
    """Inside the block, what the library refuses is a `UsageError` where its events tell enough."""
    try:
        from tyro import _errors as told
    except ImportError:  # a version without events
        return nullcontext()

    def tell(event: Any) -> None:
        line = _line(event, argv, prog)
        if line is not None:
            raise UsageError(line)

    return told.on_parse_error(tell)


def _line(event: Any, argv: Sequence[str], prog: str) -> str | None:
    """What to say of an event of the library; none where its own message is to be shown."""
    match type(event).__name__:
        case "MissingArgs":
            names = [_flags_and_metavar(one.arg)[1] for one in event.missing_arguments]
            return f"{' and '.join(names)}: must be given; {prog} --help shows how"
        case "BadValue" if event.reason == "too_few_values":
            flags, metavar = _flags_and_metavar(event.argument)
            option, _ = _as_written(flags, argv)
            if option is None:
                return f"{metavar}: must be given; {prog} --help shows how"
            return f"{option}: needs a value: {_values(metavar)}"
        case "InvalidChoice":
            flags, metavar = _flags_and_metavar(event.argument)
            option, _ = _as_written(flags, argv)
            known = [one for one in _words(metavar) or event.choices if one != "None"]
            near = nearest(event.value, known)
            end = f", did you mean {near}?" if near else ""
            if option == "--preset" and event.value.endswith(".toml"):
                end = "; --scenario reads a file"
            place = f"{option} {event.value}" if option else event.value
            return f"{place}: must be {_listed(known)}{end}"
        case "InstantiationFailure" if event.argument is not None:
            flags, metavar = _flags_and_metavar(event.argument)
            option, value = _as_written(flags, argv)
            if option is None or value is None:
                return None
            return f"{option} {value}: must be {_values(metavar)}"
        case "UnrecognizedArgs":
            return f"{event.tokens[0]}: is one word too many; {prog} --help shows how"
    return None


def _flags_and_metavar(argument: Any) -> tuple[tuple[str, ...], str]:
    lowered = argument.lowered
    return tuple(lowered.name_or_flags), str(lowered.metavar)


def _as_written(flags: Sequence[str], argv: Sequence[str]) -> tuple[str | None, str | None]:
    """The option among ``flags`` that was written last, and the word after it."""
    for place in reversed(range(len(argv))):
        option, equals, value = argv[place].partition("=")
        if option.startswith("-") and option.replace("_", "-") in flags:
            rest = argv[place + 1] if place + 1 < len(argv) else None
            return option, value if equals else rest
    return None, None


def _values(metavar: str) -> str:
    """The values that the library writes as ``metavar``, in words."""
    words = _words(metavar)
    if words:
        return _listed([word for word in words if word != "None"])
    kinds = [kind for kind in metavar.split("|") if kind != "{None}"]
    return " or ".join(_KINDS_OF_VALUES.get(kind, kind) for kind in kinds)


def _words(metavar: str) -> list[str]:
    inner = metavar.partition("{")[2].partition("}")[0]
    return inner.split(",") if "," in inner else []


def _listed(words: Sequence[str]) -> str:
    *others, last = words
    return f"{', '.join(others)} or {last}" if others else last
