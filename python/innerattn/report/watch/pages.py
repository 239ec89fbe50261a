"""The pages of `innerattn watch`: the state of trainings, and episodes of their newest policy."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from innerattn.errors import InnerattnError
from innerattn.experiments.live import LiveRun, read_live
from innerattn.records.record import Record
from innerattn.records.run_folder import read_config
from innerattn.report.html import fill, shared_text
from innerattn.report.local_server import Answer
from innerattn.report.replay.page import replay_page
from innerattn.report.runs.plots import Line, Plot, line_colour

_WEB = files("innerattn.report.watch") / "web"

PlayNewest = Callable[[Path], Record]
"""Plays some episodes with the newest policy of a run."""


class NewestEpisodes:
    """Replays of the newest policy of a run, played once for each checkpoint."""

    def __init__(self, folder: Path, play: PlayNewest) -> None:
        """Replay the run in ``folder``; ``play`` gives its episodes."""
        self._folder, self._play = folder, play
        self._lock = threading.Lock()
        self._made: tuple[int, str] | None = None

    def page(self) -> Answer:
        """The replay.

        Raises:
            RunError: there is no checkpoint yet, or it cannot be played.
        """
        with self._lock:
            live = read_live(self._folder)
            if live.checkpoint is None or self._made is None or self._made[0] != live.checkpoint:
                record = self._play(self._folder)
                name = f"{live.name} after {live.checkpoint or 0:,} env-steps"
                self._made = (live.checkpoint or 0, replay_page([record], [name]))
            return Answer("text/html", self._made[1])


def watch_pages(
    folders: Sequence[Path],
    scripts: Mapping[str, float],
    play: PlayNewest,
    more: Callable[[], Iterable[Path]] = tuple,
) -> dict[str, Callable[[], Answer]]:
    """All pages by name, for `innerattn.report.local_server.LocalServer`.

    Args:
        folders: of the runs, at least one.
        scripts: rescues per episode of scripts, to show beside the first run's.
        play: plays the newest policy of a run.
        more: gives the folders of all runs that there are later; those that are new get pages.
    """
    first = fill(
        _text("watch.html"),
        style=f"{shared_text('colours.css', 'page.css')}\n{_text('watch.css')}",
        script=f"{shared_text('dom.js', 'theme.js', 'marks.js', 'plots.js')}\n{_text('watch.js')}",
    )
    pages: dict[str, Callable[[], Answer]] = {
        "": partial(Answer, "text/html", first),
    }
    runs = _Runs(pages, scripts, play)
    for folder in folders:
        runs.add(folder)
    pages["state"] = partial(runs.state, more)
    return pages


class _Runs:
    """The runs that are watched, and their pages; runs that begin later come last."""

    def __init__(
        self, pages: dict[str, Callable[[], Answer]], scripts: Mapping[str, float], play: PlayNewest
    ) -> None:
        self._pages, self._scripts, self._play = pages, scripts, play
        self._folders: dict[Path, Path] = {}
        self._lock = threading.Lock()

    def add(self, folder: Path) -> None:
        """Watch one more run.

        Raises:
            RunError: it cannot be read.
        """
        scenario = read_config(folder).training_scenario
        read_live(folder)
        first = next(iter(self._folders.values()), folder)
        if read_config(first).training_scenario != scenario:
            self._scripts = {}  # they played other worlds
        self._pages[f"episodes/{len(self._folders)}"] = NewestEpisodes(folder, self._play).page
        self._folders[folder.resolve()] = folder

    def state(self, more: Callable[[], Iterable[Path]]) -> Answer:
        """How all runs stand, those that have begun in between, too."""
        with self._lock:
            for folder in more():
                if folder.resolve() not in self._folders:
                    with suppress(InnerattnError):  # it has only begun, or is none
                        self.add(folder)
            folders = list(self._folders.values())
        return _state(folders, self._scripts)


def _state(folders: Sequence[Path], scripts: Mapping[str, float]) -> Answer:
    runs = [read_live(folder) for folder in folders]
    names = ("name", "method", "situation", "seed", "state", "env_steps", "total_env_steps")
    numbers = ("env_steps_per_s", "seconds_left", "silent_s", "checkpoint")
    rows: list[dict[str, Any]] = [
        {
            **{name: getattr(run, name) for name in (*names, *numbers)},
            "rescues": next((value for value in run.rescues[::-1] if value is not None), None),
        }
        for run in runs
    ]
    plots = [plot.to_json() for plot in _plots(runs, scripts)]
    return Answer("application/json", json.dumps({"runs": rows, "plots": plots}, allow_nan=False))


def _plots(runs: Sequence[LiveRun], scripts: Mapping[str, float]) -> list[Plot]:
    per = " or ".join(dict.fromkeys(run.rescues_per for run in runs))
    rescues = Plot(
        title=f"Rescues per {per} in training",
        note="",
        lines=[_line(index, run, run.rescues) for index, run in enumerate(runs)],
        x="env-steps",
        y=f"rescues per {per}",
        levels=dict(scripts),
    )
    attentive = [(index, run) for index, run in enumerate(runs) if run.entropy]
    evens = {f"even, {one.even_nats:.2f}": one.even_nats for _, one in attentive if one.even_nats}
    entropy = Plot(
        title="Attention entropy, mean",
        note="",
        lines=[_line(index, run, run.entropy) for index, run in attentive],
        x="env-steps",
        y="entropy [nats]",
        levels=evens,
    )
    return [rescues, entropy] if attentive else [rescues]


def _line(index: int, run: LiveRun, values: Sequence[float | None]) -> Line:
    return Line(run.name, run.times, values, **line_colour(index))


def _text(name: str) -> str:
    return (_WEB / name).read_text("utf-8")
