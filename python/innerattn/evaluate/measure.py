"""A whole evaluation: which policies run in which worlds, and what is kept of it.

What the results are is computed in `summary`, from the records alone.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from innerattn.config import EvaluateConfig, Scenario, refuse_late_faults
from innerattn.config.files import write_whole
from innerattn.errors import RunError
from innerattn.evaluate.play import run_episodes
from innerattn.measures.registry import needed_fields
from innerattn.measures.summary import Summary, summarise
from innerattn.policies import SCRIPTS, Policy, scripted_policy, scripts_of
from innerattn.records.parquet import write_records
from innerattn.records.record import FIELDS, Record
from innerattn.records.run_files import amend
from innerattn.shown import Shown

ProgressCall = Callable[[int, int], None]
"""Called with the episodes done and the episodes to do."""


@dataclass(frozen=True)
class Evaluation(Shown):
    """The results of an evaluation and the records they come from."""

    summary: Summary
    records: tuple[Record, ...]

    def write(self, folder: str | Path) -> None:
        """Write ``summary.json`` and the records into ``folder``, which is made if needed.

        In a run that is sealed, they take their place in its manifest.

        Raises:
            OSError: the files cannot be written.
            RunError: ``folder`` is a link, or the run's manifest is damaged.
        """
        if Path(folder).is_symlink():
            raise RunError(f"{folder}: is a link; nothing is written through it")
        write_records(self.records, Path(folder))
        text = json.dumps(self.summary.to_json(), indent=1, allow_nan=False)
        write_whole(Path(folder) / "summary.json", f"{text}\n".encode())
        amend(Path(folder).parent, Path(folder).name)


def evaluate_policy(
    policy: Policy,
    scenario: Scenario,
    settings: EvaluateConfig,
    *,
    label: str | None = None,
    warm_start: str = "none",
    num_threads: int | None = None,
    progress: ProgressCall | None = None,
) -> Evaluation:
    """Measure a policy against the scripted ones, all in the same worlds.

    The first `settings.episodes` of the policy's scored episodes are recorded step by step. Steps
    of scripted policies are measured and not kept.

    Args:
        policy: what is measured.
        scenario: the worlds.
        settings: how many episodes, how long, and the seed.
        label: what the policy was asked for as; none: its name.
        warm_start: the scripted policy that its training began by imitating, or "none".
        num_threads: threads that step the worlds; none: all cores.
        progress: called each time some episodes are done.

    Raises:
        ConfigError: a fault begins too late for one of the two lengths.
        ValueError: the policy has the name of a scripted one, and is another.
    """
    refuse_late_faults(scenario, settings)
    if policy.name in SCRIPTS:
        script = type(scripted_policy(policy.name, scenario))
        if type(policy) is not script:
            raise ValueError(
                f"policy.name = {policy.name!r}: is that of {script.__name__}, a script; a "
                f"{type(policy).__name__} needs another"
            )
    names = dict.fromkeys((policy.name, *scripts_of(scenario)))
    scored = max(settings.score_episodes, settings.episodes)
    total = (scored + settings.long_episodes) * len(names)
    done = 0

    def count(episodes: int) -> None:
        nonlocal done
        done += episodes
        if progress is not None:
            progress(done, total)

    def run(
        chosen: Policy, worlds: Scenario, episodes: int, first: int, record: tuple[str, ...]
    ) -> Record:
        played = run_episodes(
            chosen,
            worlds,
            episodes,
            settings.seed,
            first_episode=first,
            record=record,
            num_threads=num_threads,
            progress=count,
        )
        return played if worlds is scenario else replace(played, length="long")

    long_worlds = scenario.replace(episode_steps=settings.long_episode_steps)
    recorded = run(policy, scenario, settings.episodes, 0, FIELDS)
    standard, long = {policy.name: [recorded]}, {}
    if scored > settings.episodes:
        rest = run(policy, scenario, scored - settings.episodes, settings.episodes, ())
        standard[policy.name].append(rest)
    for name in names:
        chosen = policy if name == policy.name else scripted_policy(name, scenario, settings.seed)
        if chosen is not policy:
            standard[name] = [run(chosen, scenario, scored, 0, needed_fields(scenario))]
        long[name] = [run(chosen, long_worlds, settings.long_episodes, 0, ())]
    summary = summarise(label or policy.name, recorded, standard, long, warm_start)
    parts = [record for group in (standard, long) for all_ in group.values() for record in all_]
    kept = [part if part is recorded else replace(part, steps={}) for part in parts]
    return Evaluation(summary, tuple(kept))


def evaluate_run(
    run: str | Path,
    *,
    scenario: Scenario | None = None,
    settings: EvaluateConfig | None = None,
    progress: ProgressCall | None = None,
) -> Evaluation:
    """Measure a run's policy.

    Args:
        run: the run folder; nothing is written into it.
        scenario: the worlds; none: those of training.
        settings: how to measure; none: as the run's configuration says.
        progress: called each time some episodes are done.

    Raises:
        RunError: there is no readable run at ``run``, or its policy does not fit ``scenario``.
        ConfigError: its configuration is not valid.
    """
    from innerattn.evaluate.trained import load_trained  # with torch, which scripts do without
    from innerattn.train.build import thread_count, torch_threads

    greedy = settings.greedy_actions if settings else None
    config, policy = load_trained(run, scenario, greedy=greedy)
    with torch_threads(thread_count(config)):
        return evaluate_policy(
            policy,
            scenario or config.scenario,
            settings or config.evaluate,
            label=Path(run).resolve().name,
            warm_start=config.train.warm_start,
            num_threads=config.train.threads,
            progress=progress,
        )
