"""The tables say what the summary holds, and nothing about what it does not hold."""

import io
from dataclasses import replace

from rich.console import Console

from innerattn.config import Scenario, Task
from innerattn.evaluate import Estimate, Performance, Summary
from innerattn.experiments.score_means import seed_scores
from innerattn.measures.measure import Value
from innerattn.report.tables.evaluation import print_seeds, print_summary

SCORE = Estimate(0.5, 0.4, 0.61)


def figures(steps: int, *, score: Estimate | None = SCORE) -> Performance:
    means = {"random": 1.0, "greedy": 2.5, "hungarian": 5.0}
    return Performance(
        episodes=1000,
        episode_steps=steps,
        rescues_per_episode=Estimate(3.0, 2.9, 3.12),
        score=score,
        scripted={name: Estimate(mean, mean - 0.1, mean + 0.1) for name, mean in means.items()},
    )


def summary(
    method: str = "td-inner",
    *,
    standard: Performance | None = None,
    cooperation: dict[str, dict[str, int]] | None = None,
    entropy: dict[str, list[float]] | None = None,
) -> Summary:
    return Summary(
        policy="some-run",
        method=method,
        situation="mixed",
        seed=0,
        episodes=80,
        standard=standard or figures(25),
        long=figures(100),
        cooperation=cooperation or {"task_1": {}, "task_2": {}},
        cooperation_rates={},
        attention_entropy=entropy or {},
        attention_entropy_share={
            name: [n / 2.0 for n in row] for name, row in (entropy or {}).items()
        },
    )


def printed(found: Summary, scenario: Scenario | None = None) -> list[list[str]]:
    """Cells by line."""
    out = io.StringIO()
    console = Console(file=out, width=80, markup=False)
    print_summary(console, found, scenario or Scenario())
    return cells(out.getvalue())


def printed_seeds(found: dict[int, Summary | None]) -> list[list[str]]:
    """Cells by line."""
    out = io.StringIO()
    print_seeds(Console(file=out, width=80, markup=False), seed_scores(found))
    return cells(out.getvalue())


def cells(text: str) -> list[list[str]]:
    lines = text.splitlines()
    return [[cell.strip() for cell in line.split("  ") if cell.strip()] for line in lines]


def test_one_row_per_policy() -> None:
    rows = {row[0]: row[1:] for row in printed(summary()) if row}
    assert rows["policy"] == ["25 steps", "score", "100 steps", "score"]
    assert rows["random"] == ["1.00 ± 0.10", "0.00"] * 2
    assert rows["greedy"] == ["2.50 ± 0.10", "0.38"] * 2
    assert rows["hungarian"] == ["5.00 ± 0.10", "1.00"] * 2
    assert rows["td-inner (trained)"] == ["3.00 ± 0.11", "0.50 ± 0.10"] * 2
    assert rows["episodes"] == ["1,000", "1,000"]


def test_victims_rescued_in_time_have_a_table_where_there_are_deadlines() -> None:
    plain = Scenario()
    late = plain.tasks[0].model_copy(update={"deadline_s": 1.0})
    timed = plain.model_copy(update={"tasks": (late, *plain.tasks[1:])})
    shares: dict[str, Value] = {"in_time": Estimate(0.8, 0.7, 0.92), "lost": 250}
    none: dict[str, Value] = {"in_time": None, "lost": 0}
    of_policy = {"random": none, "greedy": shares, "hungarian": shares, "td-inner": shares}
    lengths = {
        name: replace(figures(steps), measures=of_policy)
        for name, steps in (("standard", 25), ("long", 100))
    }
    found = replace(summary(), **lengths)
    rows = {row[0]: row[1:] for row in printed(found, timed) if row}
    assert rows["td-inner"] == ["0.80 ± 0.11", "0.25"] * 2
    assert rows["random"] == ["-", "0.00"] * 2
    assert "td-inner" not in {row[0] for row in printed(found) if row}


def test_victims_turned_away_have_a_table_where_they_arrive() -> None:
    plain = Scenario()
    arriving = tuple(one.model_copy(update={"arrival_rate_hz": 2.0}) for one in plain.tasks)
    busy = plain.model_copy(update={"situation": "poisson", "tasks": arriving})
    counts = {"random": 1250, "greedy": 500, "hungarian": 250, "td-inner": 0}
    of_policy = {name: {"turned_away": count} for name, count in counts.items()}
    lengths = {
        name: replace(figures(steps), measures=of_policy)
        for name, steps in (("standard", 25), ("long", 100))
    }
    rows = {row[0]: row[1:] for row in printed(replace(summary(), **lengths), busy) if row}
    assert rows["random"] == ["1.25"] * 2
    assert rows["td-inner"] == ["0.00"] * 2


def test_ends_of_all_have_a_table_where_episodes_end_with_them() -> None:
    listed = Scenario().replace(situation="listed", end_when_done=True)
    share, none = Estimate(0.75, 0.6, 0.9), Estimate(0.0, 0.0, 0.1)
    some: dict[str, Value] = {
        "makespan_s": Estimate(12.5, 12.0, 13.0),
        "done": share,
        "turned_away": 0,
    }
    never: dict[str, Value] = {"makespan_s": None, "done": none, "turned_away": 0}
    of_policy: dict[str, dict[str, Value]] = {
        "random": never,
        **dict.fromkeys(("greedy", "hungarian", "td-inner"), some),
    }
    lengths = {
        name: replace(figures(steps), measures=of_policy)
        for name, steps in (("standard", 25), ("long", 100))
    }
    rows = {row[0]: row[1:] for row in printed(replace(summary(), **lengths), listed) if row}
    assert rows["td-inner"] == ["12.50 ± 0.50", "0.75"] * 2
    assert rows["random"] == ["-", "0.00"] * 2


def test_a_warm_start_is_named() -> None:
    warm = replace(summary(), warm_start="greedy")
    text = " ".join(cell for row in printed(warm) for cell in row)
    assert "td-inner was warm-started from greedy" in text
    assert "warm" not in " ".join(cell for row in printed(summary()) for cell in row)


def test_a_scripted_policy_has_one_row() -> None:
    names = [row[0] for row in printed(summary("greedy")) if row]
    assert names.count("greedy") == 1
    assert "greedy (trained)" not in names


def test_a_score_without_meaning_is_a_dash() -> None:
    rows = {row[0]: row[1:] for row in printed(summary(standard=figures(25, score=None))) if row}
    assert [row[1] for row in (rows["random"], rows["hungarian"], rows["td-inner (trained)"])] == [
        "-"
    ] * 3


def test_cooperation_has_counts_and_shares() -> None:
    counts = {"task_1": {"food_0": 30, "food_1": 10}, "task_2": {"food_0": 0, "food_1": 0}}
    rows = {row[0]: row[1:] for row in printed(summary(cooperation=counts)) if row}
    assert rows["task"] == ["food_0", "food_1"]
    assert rows["task_1 (food + medicine)"] == ["30 (75%)", "10 (25%)"]
    assert rows["task_2 (food + information)"] == ["0", "0"]


def test_cooperation_in_many_tasks_is_their_sum() -> None:
    tasks = [Task(name=f"site_{k}", needs=("food", "medicine")) for k in range(5)]
    counts = {one.name: {"food_0": 10, "food_1": 30} for one in tasks}
    found = printed(summary(cooperation=counts), Scenario().replace(tasks=tasks))
    rows = {row[0]: row[1:] for row in found if row}
    assert rows["task"] == ["food_0", "food_1"]
    assert rows["all 5 tasks"] == ["50 (25%)", "150 (75%)"]


def test_attention_has_nats_and_shares() -> None:
    entropy = {"food_0": [1.0, 0.5], "food_1": [0.25, 0.0]}
    rows = {row[0]: row[1:] for row in printed(summary(entropy=entropy)) if row}
    assert rows["robot"] == ["head 1", "head 2"]
    assert rows["food_0"] == ["1.00 (50%)", "0.50 (25%)"]
    assert rows["food_1"] == ["0.25 (12%)", "0.00 (0%)"]
    assert any("ln 3 = 1.10" in " ".join(row) for row in printed(summary(entropy=entropy)))


def test_large_teams_and_many_heads_are_told_in_full() -> None:
    worlds = Scenario.preset("mixed-16")
    food = [robot.name for robot in worlds.robots if robot.kind == "food"]
    counts = {"task_1": dict.fromkeys(food, 1234) | {"medical_3": 7}, "task_2": {}}
    entropy = {robot.name: [2.25] * 9 for robot in worlds.robots}
    out = io.StringIO()
    found = summary(cooperation=counts, entropy=entropy)
    print_summary(Console(file=out, width=80, markup=False), found, worlds)
    assert "…" not in out.getvalue()
    rows = cells(out.getvalue())
    assert ["robot", "task_1 (food + medicine)", "task_2 (food + information)"] in rows
    assert ["food_7", "1,234 (12%)"] in rows
    heads = [row[1:] for row in rows if row[:1] == ["robot"] and row[1].startswith("head")]
    assert heads == [[f"head {n}" for n in some] for some in ((1, 2, 3, 4), (5, 6, 7, 8), (9,))]
    assert sum(row[:2] == ["navigation_3", "2.25 (112%)"] for row in rows) == 3


def test_what_was_not_measured_is_not_mentioned() -> None:
    text = " ".join(cell for row in printed(summary()) for cell in row).lower()
    assert "helped" not in text
    assert "attention" not in text


def of_seed(rescues: float, score: float | None) -> Summary:
    """Figures whose own intervals over episodes are narrow."""
    found = figures(25, score=None if score is None else Estimate(score, score, score))
    return summary(standard=replace(found, rescues_per_episode=Estimate(rescues, rescues, rescues)))


def test_seeds_have_a_row_each_and_a_mean() -> None:
    found = printed_seeds({4: of_seed(1.0, 0.1), 2: of_seed(2.0, 0.2), 7: of_seed(3.0, 0.3)})
    rows = {row[0]: row[1:] for row in found if row}
    assert rows["seed"] == ["25 steps", "score", "100 steps", "score"]
    assert rows["4"] == ["1.00", "0.10", "3.00", "0.50"]
    assert [row[0] for row in found if row and row[0] in "247"] == ["4", "2", "7"]
    # The 97.5 % quantile of Student's t with 2 degrees of freedom is 4.303; 4.303 / sqrt(3) = 2.48.
    assert rows["mean of 3"] == ["2.00 ± 2.48", "0.20 ± 0.25", "3.00 ± 0.00", "0.50 ± 0.00"]


def test_seeds_that_failed_or_have_no_score() -> None:
    found = printed_seeds({0: of_seed(1.0, 0.1), 1: None, 2: of_seed(2.0, None)})
    rows = {row[0]: row[1:] for row in found if row}
    assert rows["1"] == ["failed"]
    assert rows["2"] == ["2.00", "-", "3.00", "0.50"]
    assert rows["mean of 2"][:2] == ["1.50 ± 6.35", "-"]
    assert not any("mean of" in row for row in map(str, printed_seeds({3: of_seed(1.0, 0.1)})))
    assert printed_seeds({3: None}) == []
