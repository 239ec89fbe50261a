"""What is shown of planners and instances in a terminal."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from innerattn.report.table import Table, columns, plain_table
from innerattn.report.tables.text import number

if TYPE_CHECKING:
    from innerattn.config.instances import Instance
    from innerattn.evaluate.instances import InstanceResults
    from innerattn.policies.scripted.planner import Schedule

_NOTE = "ratio: mean makespan divided by the mean that was published with the instances"


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
    notes = () if published is None else (_NOTE,)
    return plain_table(columns(["policy"], heads), [row], notes=notes)


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
