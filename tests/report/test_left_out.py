"""Runs that a report leaves out are named in as few lines as tell them all."""

from pathlib import Path

from innerattn.experiments.plan import plan
from innerattn.experiments.scan import RunStatus, State
from innerattn.report.left_out import left_out

OUT = Path("study")


def found(seeds: int, states: dict[tuple[str, str, int], State]) -> list[RunStatus]:
    """Runs of two methods in two situations, finished where no state is given."""
    planned = plan(["td-inner", "mappo"], ["single", "mixed"], range(seeds), "quick", OUT)
    assert len(planned) == 4 * seeds
    return [
        RunStatus(one, states.get((one.case.situation, one.case.method, one.case.seed), "finished"))
        for one in planned
    ]


def test_nothing_is_said_where_nothing_is_left_out() -> None:
    assert left_out(found(2, {})) == []


def test_a_run_is_named_with_its_method_and_seed() -> None:
    assert left_out(found(2, {("mixed", "mappo", 1): "other_configuration"})) == [
        "mixed mappo seed 1: other configuration"
    ]


def test_seeds_of_a_method_share_a_line() -> None:
    states: dict[tuple[str, str, int], State] = {
        ("mixed", "mappo", seed): "missing" for seed in (1, 2, 3)
    }
    states["single", "mappo", 0] = "missing"
    assert left_out(found(4, states)) == [
        "single mappo seed 0: missing",
        "mixed mappo seeds 1 to 3: missing",
    ]


def test_all_methods_of_a_situation_share_a_line_where_they_lack_the_same_seeds() -> None:
    states: dict[tuple[str, str, int], State] = {
        ("mixed", method, seed): "missing" for method in ("td-inner", "mappo") for seed in (0, 2)
    }
    assert left_out(found(3, states)) == ["mixed, seeds 0, 2: missing (4 runs)"]
    states["mixed", "mappo", 2] = "failed"
    assert left_out(found(3, states)) == [
        "mixed td-inner seeds 0, 2: missing",
        "mixed mappo seed 0: missing",
        "mixed mappo seed 2: failed",
    ]
