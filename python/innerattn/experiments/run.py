"""A finished run as a study sees it: what it is, what made it, and what its evaluation recorded.

`read_run` reads every file of a run folder once; nothing is played, trained or hashed anew.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from innerattn.config import RunConfig, Scenario
from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json
from innerattn.errors import RunError
from innerattn.experiments.plan import Case
from innerattn.measures.summary import SCHEMA_VERSION
from innerattn.records.logged import METRICS, MOST_METRICS_BYTES, logged_lines, logged_rescues
from innerattn.records.parquet import RECORD_FILES, read_records
from innerattn.records.record import Record
from innerattn.records.run_files import AlteredFileError, RunFiles
from innerattn.records.run_folder import RunInfo, config_of
from innerattn.records.tables import MOST_FILE_BYTES, refuse_damaged
from innerattn.shown import Shown

Found = TypeVar("Found")


class NotMeasuredError(RunError):
    """The evaluation of a run is not there as a whole."""


@dataclass(frozen=True)
class Scores:
    """What is scored at one length of episodes; ``score`` is None where it means nothing."""

    episode_steps: int
    rescues_per_episode: float
    score: float | None


@dataclass(frozen=True)
class FinishedRun(Shown):
    """A trained and measured run.

    Attributes:
        case: what tells it from the other runs of its study.
        folder: its run folder; of an archived run, where that lay.
        config: what it was trained and measured with.
        info: how it was made.
        summary: its ``evaluation/summary.json``.
        read: gives the records of its own episodes, each time anew.
        archived: whether it comes from an archive, which holds neither metrics nor steps.
        beside: what a study measured it in beside its own evaluation: JSON documents by the name
            of their file in the folder of the study.
    """

    case: Case
    folder: Path
    config: RunConfig
    info: RunInfo
    summary: dict[str, Any]
    read: Callable[[], Sequence[Record]]
    archived: bool = False
    beside: Mapping[str, Any] = field(default_factory=dict)

    @property
    def situation(self) -> str:
        """The situation of the worlds it was trained and measured in."""
        return self.config.scenario.situation

    @property
    def method(self) -> str:
        """How it was trained, such as "td-inner"."""
        return self.case.method

    @property
    def seed(self) -> int:
        """The seed of its training."""
        return self.case.seed

    @cached_property
    def config_sha256(self) -> str:
        """The digest of its configuration, see `innerattn.config.RunConfig.digest`."""
        return self.config.digest()

    @property
    def weights_sha256(self) -> str | None:
        """The digest of its weights; None where the run is older than this record of it."""
        return self.info.weights_sha256

    @cached_property
    def scored(self) -> tuple[Record, ...]:
        """Its own episodes of the standard length, those recorded step by step first.

        Raises:
            RunError: the records cannot be read, or hold no episode of the run.
        """
        own = [r for r in self.read() if r.policy == self.method and r.length == "standard"]
        if not own:
            raise RunError(f"{self.folder / 'evaluation'}: holds no episodes of {self.method}")
        return tuple(own)

    @property
    def recorded(self) -> Record:
        """Its episodes that were recorded step by step; an archive keeps no steps of them.

        Raises:
            RunError: as of `scored`.
        """
        return self.scored[0]

    def scores(self) -> tuple[Scores, Scores]:
        """What its evaluation found at the standard and at the second length of episodes."""
        return scores_in(self.summary)


def read_run(case: Case, folder: Path, *, steps: bool = True) -> FinishedRun:
    """The finished run in ``folder``.

    Args:
        case: what it is listed as.
        folder: the run folder, or a link to it.
        steps: whether its records are to hold what was recorded step by step.

    Raises:
        NotMeasuredError: a file of its evaluation is missing or damaged.
        RunError: the folder is no finished run, a file in it is a link, or the run was measured
            otherwise than its configuration says, or by another version.
        ConfigError: its configuration is not valid.
        OSError: a file cannot be read.
    """
    files = RunFiles(folder)
    if files.info.state != "done":
        raise RunError(f"{folder}: its state is {files.info.state!r}: must be 'done'")
    return measured_run(case, files, config_of(files), steps=steps)


def measured_run(case: Case, files: RunFiles, config: RunConfig, *, steps: bool) -> FinishedRun:
    """The finished run of which configuration and ``run.json`` were read already.

    Raises:
        NotMeasuredError, RunError, OSError: as of `read_run`.
    """
    evaluation = files.path / "evaluation"
    summary = _read_summary(files, config)

    def read() -> list[Record]:
        return read_records(evaluation, policy=config.train.method, steps=steps)

    return FinishedRun(case, files.path, config, files.info, summary, read)


def read_metrics(run: FinishedRun, *names: str) -> list[tuple[Any, ...]]:
    """What a run's training logged under some names, in the order in which it did.

    Raises:
        RunError: its ``metrics.jsonl`` is missing, as with an archived run, empty or damaged.
    """
    return _of_lines(run, lambda line: tuple(line[name] for name in names))


def read_rescues(run: FinishedRun) -> list[tuple[int, float | None]]:
    """Env-steps, and rescues as `logged_rescues` counts them, of each line that a run logged.

    Raises:
        RunError: as of `read_metrics`.
    """
    return _of_lines(run, lambda line: (line["env_steps"], logged_rescues(run.config, line)))


def _of_lines(run: FinishedRun, of: Callable[[Mapping[str, Any]], Found]) -> list[Found]:
    path = run.folder / METRICS
    try:
        data = RunFiles(run.folder).read(path.name, MOST_METRICS_BYTES)
        found = [of(line) for line in logged_lines(data)]
    except AlteredFileError:
        raise
    except (RunError, ValueError, KeyError, TypeError) as error:
        raise RunError(f"{path}: not the metrics of a run") from error
    if not found:
        raise RunError(f"{path}: holds no line")
    return found


@dataclass(frozen=True)
class OfMethod:
    """What runs of one situation and method show.

    Attributes:
        situation: of the worlds.
        method: of training, or a scripted policy.
        seeds: of the runs; a scripted policy has those of the runs in whose worlds it was played.
    """

    situation: str
    method: str
    seeds: tuple[int, ...]


def by_method(runs: Sequence[FinishedRun]) -> dict[tuple[str, str], list[FinishedRun]]:
    """Runs by worlds and method, in the order these first appear; by seed within.

    Raises:
        RunError: there are none, or worlds, method and seed come twice.
    """
    if not runs:
        raise RunError("a study needs at least one run")
    groups: dict[tuple[str, str], list[FinishedRun]] = {}
    for run in sorted(runs, key=lambda run: run.seed):
        groups.setdefault((run.case.worlds, run.method), []).append(run)
    for group in groups.values():
        for first, second in pairwise(group):
            if first.seed == second.seed:
                raise RunError(
                    f"{first.folder} and {second.folder}: both are {first.case.worlds}, "
                    f"{first.method}, seed {first.seed}; must be one run of each seed"
                )
    order = dict.fromkeys((run.case.worlds, run.method) for run in runs)
    return {key: groups[key] for key in order}


def refuse_unlike(runs: Sequence[FinishedRun]) -> None:
    """Refuse runs that cannot be compared.

    Raises:
        RunError: a run's label is not what its configuration says; runs of the same worlds and
            method were trained or measured differently, other than by their seed; or runs of the
            same worlds and seed were measured in different worlds, so that they are no pairs.
    """
    seen: dict[tuple[str, str], tuple[Path, dict[str, Any]]] = {}
    measured: dict[tuple[str, int], tuple[Path, int]] = {}
    for run in runs:
        for name, label in (("method", run.method), ("seed", run.seed)):
            if getattr(run.config.train, name) != label:
                raise RunError(
                    f"{run.folder}: train.{name} = {getattr(run.config.train, name)!r}, "
                    f"but it is listed as {label!r}"
                )
        what, worlds = comparable(run.config), run.config.evaluate.seed
        first = measured.setdefault((run.case.worlds, run.seed), (run.folder, worlds))
        if worlds != first[1]:
            raise RunError(
                f"{run.folder} and {first[0]}: are of one seed, and evaluate.seed is {worlds} and "
                f"{first[1]}: must be the same worlds"
            )
        other, known = seen.setdefault((run.case.worlds, run.method), (run.folder, what))
        if differing := [name for name in what if what[name] != known.get(name)]:
            raise RunError(
                f"{run.folder} and {other}: are listed as the same but for the seed, and differ "
                f"in {', '.join(differing)}"
            )


def comparable(config: RunConfig) -> dict[str, dict[str, Any]]:
    """The values, by section and key, that runs share which differ by their seeds alone."""
    what = config.in_use()
    for free in ("seed", "threads", "device", "compile", "log_every_env_steps"):
        what["train"].pop(free)
    what["evaluate"].pop("seed")
    return what


def refuse_without_steps(runs: Sequence[FinishedRun]) -> None:
    """Refuse runs whose first episodes are not recorded step by step.

    Raises:
        RunError: there is one, such as an archived run.
    """
    for run in runs:
        if not run.recorded.steps:
            raise RunError(
                f"{run.folder / 'evaluation'}: holds no episodes of {run.method} recorded step by "
                "step"
            )


def named_from(folder: Path, base: Path) -> str:
    """How a report in ``base`` names a run folder: from there, or from its pool, where it lies."""
    if folder.is_relative_to(base):
        return folder.relative_to(base).as_posix()
    pooled = folder.parent == base.parent / "runs"
    return f"runs/{folder.name}" if pooled else folder.as_posix()


def check_summary(path: Path, found: dict[str, Any], config: RunConfig) -> dict[str, Any]:
    """A summary, if it is that of a run with this configuration.

    Args:
        path: named in errors.
        found: the document.
        config: the run's configuration.

    Raises:
        NotMeasuredError: it is not a whole summary.
        RunError: the run was measured otherwise, or by another version.
    """
    try:
        if found["schema_version"] != SCHEMA_VERSION:
            version = found["schema_version"]
            raise RunError(f"{path}: schema_version = {version!r}: must be {SCHEMA_VERSION}")
        _refuse_other_measures(path, found, config)
        for part in (found, found["long"]):
            _refuse_impossible(part, config.scenario)
    except (ValueError, KeyError, TypeError) as error:
        raise NotMeasuredError(f"{path}: not a whole evaluation") from error
    return found


def _read_summary(files: RunFiles, config: RunConfig) -> dict[str, Any]:
    evaluation = files.path / "evaluation"
    path = evaluation / "summary.json"
    for name in (path.name, *RECORD_FILES):
        if not os.path.lexists(evaluation / name):
            raise NotMeasuredError(f"{evaluation / name}: missing")
    for name in RECORD_FILES:
        data = _read(files, name, MOST_FILE_BYTES)
        try:
            refuse_damaged(data, evaluation / name)
        except RunError as error:
            raise NotMeasuredError(str(error)) from error
    try:
        found = parse_json(_read(files, path.name, MOST_JSON_BYTES))
    except ValueError as error:
        raise NotMeasuredError(f"{path}: not a whole evaluation") from error
    return check_summary(path, found, config)


def _read(files: RunFiles, name: str, most_bytes: int) -> bytes:
    """A file of the evaluation; one that was altered counts as not measured."""
    try:
        return files.read(f"evaluation/{name}", most_bytes)
    except AlteredFileError as error:
        raise NotMeasuredError(str(error)) from error


def scores_in(summary: Mapping[str, Any]) -> tuple[Scores, Scores]:
    """Scores of a summary's document at the standard and at the second length of episodes."""
    return _scores(summary), _scores(summary["long"])


def _scores(part: Mapping[str, Any]) -> Scores:
    return Scores(
        int(part["episode_steps"]),
        float(part["rescues_per_episode"]["mean"]),
        None if part["score"] is None else float(part["score"]["mean"]),
    )


def _refuse_impossible(part: dict[str, Any], scenario: Scenario) -> None:
    """Refuse means that no play gives.

    Raises:
        ValueError: a mean is out of range, or its interval does not hold it.
    """
    scores = _scores(part)
    most = scenario.num_victims * scores.episode_steps
    estimates = {"rescues_per_episode": part["rescues_per_episode"], **part["scripted"]}
    for name, estimate in estimates.items():
        low, mean, high = (float(estimate[key]) for key in ("low", "mean", "high"))
        if not 0.0 <= low <= mean <= high <= most:
            raise ValueError(f"{name} = {mean}: must be in 0..={most}, and in its interval")
    if scores.score is not None and not math.isfinite(scores.score):
        raise ValueError(f"score = {scores.score}: must be finite")


def _refuse_other_measures(path: Path, found: dict[str, Any], config: RunConfig) -> None:
    settings, scenario = config.evaluate, config.scenario
    expected = {
        "method": (found["method"], config.train.method),
        "situation": (found["situation"], scenario.situation),
        "seed": (found["seed"], settings.seed),
        "episodes": (found["episodes"], settings.episodes),
        "episode_steps": (found["episode_steps"], scenario.episode_steps),
        "score_episodes": (
            found["score_episodes"],
            max(settings.score_episodes, settings.episodes),
        ),
        "long.episodes": (found["long"]["episodes"], settings.long_episodes),
        "long.episode_steps": (found["long"]["episode_steps"], settings.long_episode_steps),
    }
    for key, (value, wanted) in expected.items():
        if value != wanted:
            raise RunError(f"{path}: {key} = {value!r}, its configuration says {wanted!r}")
