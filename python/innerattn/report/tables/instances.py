"""What is shown of instances, and of those who were measured on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from innerattn.report.table import Row, Section, Table, columns, markdown, plain_table
from innerattn.report.tables.text import number, percent

if TYPE_CHECKING:
    from innerattn.config.instances import Instance, WorldInstance
    from innerattn.evaluate.instance_worlds import WorldResults
    from innerattn.evaluate.instances import InstanceResults
    from innerattn.policies.scripted.planner import Schedule

_NOTE = "ratio: mean makespan divided by the mean that was published with the instances"

_SCORE_NOTE = (
    "score: 1 is as good as the best script. It compares makespans; where victims have deadlines, "
    "it compares rescues"
)


def results_table(results: InstanceResults) -> Table:
    """Mean makespan, the published one beside it, and what it took."""
    published = results.published_mean_makespan
    row = [
        results.policy,
        f"{len(results.solved):,}",
        number(results.mean_makespan),
        number(published),
        ratio_text(results),
        f"{results.mean_seconds:.3f}",
    ]
    heads = ["instances", "makespan", "published", "ratio", "seconds each"]
    notes = [] if published is None else [_NOTE]
    if results.engine is not None:
        notes.append(f"schedules were played by robots with bodies (engine {results.engine})")
    if late := sum(not one.is_done for one in results.solved):
        notes.append(f"in {late} instances robots were not back in time; the time limit counts")
    return plain_table(columns(["policy"], heads), [row], notes=tuple(notes))


def results_line(results: InstanceResults) -> str:
    """The same in one line."""
    ratio = "" if results.ratio is None else f", {ratio_text(results)} of the published mean"
    count = len(results.solved)
    noun = "instance" if count == 1 else "instances"
    return f"mean makespan {number(results.mean_makespan)}{ratio}, {count} {noun}"


def ratio_text(results: InstanceResults) -> str:
    """The ratio to the published mean with three decimals; - where there is none."""
    return number(None) if results.ratio is None else f"{results.ratio:.3f}"


def schedule_line(instance: Instance, schedule: Schedule) -> str:
    """The makespan of one schedule, and what was published where something was."""
    published = instance.makespan_milp_600s
    line = f"makespan {number(schedule.makespan)}"
    if published is None:
        return line
    return f"{line}, published {number(published)}, ratio {schedule.makespan / published:.3f}"


def instance_words(instance: Instance, schedule: Schedule) -> str:
    """A few lines about an instance and a schedule for it."""
    having = Counter(skill for robot in instance.robots for skill in set(robot.skills))
    skills = ", ".join(f"{skill} ({having[skill]})" for skill in sorted(having))
    needs = [len(task.skills) for task in instance.tasks]
    work = sum(task.duration * len(task.skills) for task in instance.tasks)
    rows = {
        "instance": instance.name,
        "robots": f"{len(instance.robots)}, speed {instance.speed:g}",
        "skills": f"{skills} (robots that have it)",
        "tasks": f"{len(needs)}, each for {min(needs)} to {max(needs)} robots, "
        f"{work / len(instance.robots):.2f} of work for each robot",
        "published": f"makespan {number(instance.makespan_milp_600s)}, "
        f"lower bound {number(instance.lower_bound_milp)}",
        "planner": f"makespan {number(schedule.makespan)}",
    }
    return "\n".join(f"{name:<11}{value}" for name, value in rows.items())


def worlds_table(results: WorldResults) -> Table:
    """What a policy reached in the worlds of each feature, and in all."""
    heads = ["worlds", "played", "rescued", "makespan [s]", "score"]
    rows = [_worlds_row(name, results.of(name)) for name in results.features]
    rows.append(_worlds_row("all", results))
    notes = [_SCORE_NOTE]
    if reasons := [one.refusal for one in results.worlds if one.refusal]:
        notes.append(
            f"{len(reasons)} worlds were not played and do not count; the first because: "
            f"{reasons[0]}"
        )
    return plain_table(columns(["feature"], heads), rows, notes=tuple(notes))


def worlds_line(results: WorldResults) -> str:
    """The same in one line."""
    played, of = len(results.played), len(results.worlds)
    worlds = f"{of} worlds" if played == of else f"{played} of {of} worlds"
    return (
        f"score {number(results.score)}, {percent(results.rescued_share)} rescued, "
        f"mean makespan {number(results.mean_makespan_s)} s, {worlds}"
    )


def worlds_markdown(results: Sequence[WorldResults]) -> str:
    """Scores of several policies on the same worlds, a row for each feature."""
    rows = [
        Row((name, *(_score_cell(one.of(name)) for one in results))) for name in results[0].features
    ]
    rows.append(Row(("all", *map(_score_cell, results)), strong=True))
    names = [one.policy for one in results]
    return markdown(Table(columns(["feature"], names), (Section(tuple(rows)),)))


def world_line(world: WorldInstance) -> str:
    """What a world is, and what its reference reached, in one line."""
    found = world.reference
    return (
        f"{world.name}: {world.scenario.num_robots} robots, {world.victims} victims; "
        f"{found.policy} rescued {found.rescued} in {found.makespan_s:.1f} s"
    )


def _worlds_row(name: str, results: WorldResults) -> list[str]:
    return [
        name,
        f"{len(results.worlds):,}",
        f"{len(results.played):,}",
        percent(results.rescued_share),
        number(results.mean_makespan_s),
        number(results.score),
    ]


def _score_cell(results: WorldResults) -> str:
    """Score and, in brackets, the share of victims that were rescued."""
    if not results.played:
        return "–"
    return f"{number(results.score)} ({percent(results.rescued_share)})"
