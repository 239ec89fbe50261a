"""The page of `innerattn watch` on a study: what is done, what runs, and the scores so far."""

from __future__ import annotations

import json
import threading
from collections import Counter
from collections.abc import Callable
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from innerattn.errors import InnerattnError
from innerattn.experiments.live import read_live
from innerattn.report.html import fill, shared_text
from innerattn.report.local_server import Answer
from innerattn.report.study.page import means_table, sentences
from innerattn.report.study.search import search_found, search_sentences, search_table
from innerattn.report.table import Table
from innerattn.studies.duration import duration_of, in_words
from innerattn.studies.folder import StudyFolder
from innerattn.studies.results import compare, last_line, means, read_summaries
from innerattn.studies.search.state import Now, Watched

_WEB = files("innerattn.report.watch") / "web"
_MOST_SHOWN = 500
"""Finished runs whose scores are shown; more would make each look slow."""


def study_pages(study: StudyFolder) -> dict[str, Callable[[], Answer]]:
    """All pages by name, for `innerattn.report.local_server.LocalServer`."""
    page, style, script = (
        (_WEB / name).read_text("utf-8") for name in ("study.html", "watch.css", "study.js")
    )
    first = fill(
        page,
        style=f"{shared_text('colours.css', 'page.css')}\n{style}",
        script=f"{shared_text('dom.js', 'theme.js')}\n{script}",
    )
    return {"": partial(Answer, "text/html", first), "state": _State(study).answer}


class _State:
    """How a study stands; scores are read anew only where another run has ended."""

    def __init__(self, study: StudyFolder) -> None:
        self._watched, self._lock = Watched(study), threading.Lock()
        self._scored: tuple[int, dict[str, Any]] = (0, {"heads": [], "rows": [], "verdicts": []})

    def answer(self) -> Answer:
        """The state as JSON.

        Raises:
            RunError: a summary of a finished run cannot be read.
            OSError: the ledger cannot be read.
        """
        with self._lock:
            return Answer("application/json", json.dumps(self._document(), allow_nan=False))

    def _document(self) -> dict[str, Any]:
        now = self._watched.now()
        study, states = now.study, now.states
        ledger = study.ledger()
        counts = Counter(states.values())
        left = duration_of(study.pool, states, now.left)
        named = {run.key: str(run) for run in study.planned}
        if counts["done"] != self._scored[0] and counts["done"] <= _MOST_SHOWN:
            self._scored = counts["done"], _scores(now)
        running = [
            _running(named[key], folder) for key, folder in ledger.at_work().items() if key in named
        ]
        return {
            "title": study.study.question or study.path.name,
            "runs": counts["done"] + counts["failed"] + now.left,
            "search": now.search is not None,
            "counts": {name: counts[name] for name in ("done", "claimed", "planned", "failed")},
            "left": in_words(left.left_s) if left is not None and left.left_s else None,
            "running": running,
            "failed": [
                {"name": named[key], "why": last_line(ledger.failures(key)[-1])}
                for key, state in states.items()
                if state == "failed"
            ],
            **self._scored[1],
        }


def _scores(now: Now) -> dict[str, Any]:
    """Means over seeds and what contrasts say so far; of a search its trials."""
    study = now.study
    results = read_summaries(study)
    table: Table | None = None
    if now.search is not None:
        searched = search_found(now, results)
        table = search_table(searched, cost=False)
        texts = search_sentences(searched) + sentences(searched.confirmed)
    else:
        found = means(results)
        table = means_table(found) if found else None
        texts = sentences(compare(study.study, study.planned, results))
    return {
        "heads": [] if table is None else [one.head for one in table.columns],
        "rows": [] if table is None else [list(one.cells) for one in table.sections[0].rows],
        "verdicts": [one.replace("**", "") for one in texts],
    }


def _running(name: str, folder: Path) -> dict[str, Any]:
    """How far a run is; what is not known of one that has just begun is None."""
    try:
        live = read_live(folder)
    except (InnerattnError, OSError):
        return {"name": name, "share": 0.0, "left": None, "rescues": None}
    rescues = next((value for value in live.rescues[::-1] if value is not None), None)
    left = None if live.seconds_left is None else in_words(live.seconds_left)
    share = min(live.env_steps / live.total_env_steps, 1.0)
    return {"name": name, "share": share, "left": left, "rescues": rescues}
