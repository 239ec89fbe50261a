"""What a report says of runs that were planned and are not in it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from innerattn.experiments.scan import RunStatus
from innerattn.stats.text import format_seeds


def left_out(found: Sequence[RunStatus]) -> list[str]:
    """One line where a situation lacks the same seeds of all methods, else one for each method.

    Args:
        found: what there is of each planned run.
    """
    planned = defaultdict(set)
    seeds = defaultdict(list)
    for one in found:
        case = one.planned.case
        planned[case.situation].add(case.trained)
        if one.state != "finished":
            seeds[case.situation, one.reason, case.trained].append(case.seed)
    alike = defaultdict(list)
    for (situation, reason, trained), those in seeds.items():
        alike[situation, reason, tuple(those)].append(trained)
    lines = []
    for (situation, reason, same), methods in alike.items():
        which = f"seed{'s' * (len(same) > 1)} {format_seeds(same)}: {reason}"
        if len(methods) == len(planned[situation]) > 1:
            lines.append(f"{situation}, {which} ({len(methods) * len(same)} runs)")
        else:
            lines += [f"{situation} {method} {which}" for method in methods]
    return lines
