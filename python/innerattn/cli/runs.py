"""Runs by name: a path, `zoo:NAME`, `latest`, or the beginning of a name of a folder in `runs`."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path

from innerattn.config.near import did_you_mean
from innerattn.errors import RunError
from innerattn.zoo import PREFIX, run_path, zoo_names

RUNS = Path("runs")
"""Where `innerattn train` makes run folders, unless it is told another place."""

LATEST = "latest"
_MOST_NAMED = 8


def named_run(name: str) -> Path:
    """The run folder that ``name`` means; a path where something is always wins.

    Args:
        name: a path; `zoo:NAME`, a team that comes with the package; `latest`, the run in `runs`
            that was begun last; or the beginning of the name of just one run folder in `runs`.

    Returns:
        The folder. Where nothing fits, ``name`` itself as a path, so that what reads it says what
        is missing.

    Raises:
        RunError: the names of several runs begin so, there is no run that could be the latest, or
            no such team.
    """
    path = Path(name)
    if not name or os.path.lexists(path):
        return path
    if name.startswith(PREFIX):
        return _zoo_team(name)
    if name == LATEST:
        runs = _runs()
        if not runs:
            raise RunError(f"{name}: no run is in {RUNS} yet")
        return max(runs, key=lambda run: (_begun(run), run.name))
    if os.sep in name or path.is_absolute():
        return path
    fitting = [run for run in _runs() if run.name.startswith(name)]
    fitting = [run for run in fitting if run.name == name] or fitting
    if len(fitting) > 1:
        shown = ", ".join(run.name for run in fitting[:_MOST_NAMED])
        more = f" and {len(fitting) - _MOST_NAMED} more" if len(fitting) > _MOST_NAMED else ""
        raise RunError(f"{name}: {len(fitting)} runs in {RUNS} begin so: {shown}{more}")
    return fitting[0] if fitting else path


def existing_run(name: str) -> Path:
    """The run folder that ``name`` means; see `named_run`.

    Raises:
        RunError: there is nothing; the message asks for the nearest name.
    """
    found = named_run(name)
    if not os.path.lexists(found):
        raise RunError(f"{found}: no such run folder{_meant(name, [LATEST])}")
    return found


def runs_within(folder: Path) -> list[Path]:
    """The run folders in a folder that holds runs and is none itself, by name; else none."""
    return [] if (folder / "run.json").exists() else _runs(folder)


def named_policy(name: str, scripts: Collection[str]) -> str:
    """The script or the path of the run that ``name`` means; see `named_run`.

    Raises:
        RunError: there is neither; the message names the scripts.
    """
    if name in scripts:
        return name
    found = named_run(name)
    if not found.exists():
        raise RunError(
            f"{name}: neither a run's folder nor one of {', '.join(scripts)}"
            f"{_meant(name, [*scripts, LATEST])}"
        )
    return str(found)


def shown_names(policies: Sequence[str], scripts: Collection[str]) -> list[str]:
    """What to call policies, as of `named_policy`: a script by its name, a run by its folder's.

    Two runs in folders of one name are called by their paths.
    """

    def folder_of(run: str) -> str:
        return Path(run).resolve().name

    runs = {one for one in policies if one not in scripts}
    folders = Counter(map(folder_of, runs))
    names = []
    for one in policies:
        name = one if one in scripts or folders[folder_of(one)] > 1 else folder_of(one)
        names.append(f"{name} (run)" if one in runs and name in scripts else name)
    return names


def _meant(name: str, words: Collection[str]) -> str:
    """The end of a message: the nearest run in the same folder, or of the words and runs.

    Names alone are compared: two names in one long path are no more alike than elsewhere.
    """
    path = Path(name)
    if path.parent == Path():
        return did_you_mean(name, [*words, *(run.name for run in _runs())])
    known = [run.name for run in _runs(path.parent)]
    return did_you_mean(path.name, known, lambda found: str(path.parent / found))


def _zoo_team(name: str) -> Path:
    """The folder of `zoo:NAME`; if there is none, the message asks for the nearest name."""
    try:
        return run_path(name)
    except RunError as error:
        known = [f"{PREFIX}{one}" for one in zoo_names()]
        raise RunError(f"{error}{did_you_mean(name, known)}") from None


def _runs(folder: Path = RUNS) -> list[Path]:
    """The run folders in `runs`, or in another folder, by name."""
    try:
        return sorted(path for path in folder.iterdir() if (path / "run.json").is_file())
    except OSError:
        return []


def _begun(run: Path) -> float:
    """When a run was begun [s]: its configuration is written once, first of all."""
    try:
        return (run / "config.toml").stat().st_mtime
    except OSError:
        return 0.0
