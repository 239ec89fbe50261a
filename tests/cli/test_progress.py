"""The bar on a terminal, plain lines elsewhere."""

import io
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from innerattn.cli.progress import (
    Evaluating,
    MeasuringRobustness,
    SeveralMeasurements,
    SeveralRuns,
    Training,
)
from innerattn.config import RunConfig, Scenario, load_run_config
from innerattn.evaluate.training_score import (
    ScriptedRescues,
    scripted_rescues,
    training_rescues,
)
from innerattn.experiments.side_by_side import Run
from innerattn.train import Progress


def progress(seconds: float, env_steps: int, rescues: float | None = 1.5) -> Progress:
    return Progress(
        env_steps=env_steps,
        total_env_steps=1000,
        updates=env_steps // 10,
        seconds=seconds,
        metrics={"rescues_per_episode": rescues},
    )


def shown(*, terminal: bool, steps: list[Progress]) -> str:
    """What is shown where the clock is the progress's own."""
    out = io.StringIO()
    console = Console(file=out, force_terminal=terminal, width=80, color_system=None)
    seconds = iter([0.0, *(step.seconds for step in steps)])
    with Training(console, clock=lambda: next(seconds)) as show:
        for step in steps:
            show(step)
    return out.getvalue()


def test_a_terminal_that_draws_no_bar_has_plain_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    steps = [progress(float(second), 40 * second) for second in range(1, 26)]
    assert shown(terminal=True, steps=steps) == shown(terminal=False, steps=steps) != ""


def test_plain_lines_every_ten_seconds() -> None:
    steps = [progress(float(second), 40 * second) for second in range(1, 26)]
    assert shown(terminal=False, steps=steps).splitlines() == [
        "training  40% | 0:15 left | 1.50 rescues/episode | 40 env-steps/s | 4.0 updates/s",
        "training  80% | 0:05 left | 1.50 rescues/episode | 40 env-steps/s | 4.0 updates/s",
    ]


def test_the_rest_is_not_told_from_the_slow_start() -> None:
    steps = [progress(20.0, 50), progress(40.0, 100)]
    lines = shown(terminal=False, steps=steps).splitlines()
    assert [line.split(" | ")[1] for line in lines] == ["-:-- left", "6:00 left"]


def test_a_run_that_goes_on_keeps_its_pace() -> None:
    out = io.StringIO()
    seconds = iter([1000.0, 1015.0])
    with Training(Console(file=out, width=80), clock=lambda: next(seconds)) as show:
        show(progress(60.0, 400))  # 45 s of them before this process
    assert out.getvalue().startswith("training  40% | 1:30 left | ")


def test_a_last_batch_may_pass_the_end() -> None:
    (line,) = shown(terminal=False, steps=[progress(100.0, 1010, None)]).splitlines()
    assert line.startswith("training 100% | 0:00 left | no episode yet")


def test_rescues_stay_where_no_episode_ended_since() -> None:
    steps = [progress(10.0, 400, 2.5), progress(20.0, 800, None)]
    lines = shown(terminal=False, steps=steps).splitlines()
    assert [line.split(" | ")[2] for line in lines] == ["2.50 rescues/episode"] * 2


def test_terminal_shows_a_bar() -> None:
    text = shown(terminal=True, steps=[progress(90.0, 500)])
    assert "━" in text
    assert "50%" in text
    assert "1:30 left" in text
    assert "0.6 updates/s" in text  # the whole line fits


def test_the_loss_is_shown_once_it_is_known() -> None:
    known = replace(
        progress(10.0, 400), metrics={"rescues_per_episode": 1.5, "losses": {"critic_loss": 0.0123}}
    )
    (line,) = shown(terminal=False, steps=[known]).splitlines()
    assert line.endswith("1.50 rescues/episode | 40 env-steps/s | loss 0.0123")
    assert "loss 0.0123" in shown(terminal=True, steps=[known])  # the whole line fits


def test_the_score_is_between_scripts_which_are_played_once() -> None:
    played = []

    def scripts() -> ScriptedRescues:
        played.append(True)
        return ScriptedRescues(random=0.5, best=2.5)

    console = Console(file=(out := io.StringIO()), width=120)
    seconds = iter([0.0, 10.0, 20.0, 30.0])
    with Training(console, lambda: next(seconds), scripts) as show:
        show(progress(10.0, 400, None))
        assert not played  # there is nothing to score yet
        show(progress(20.0, 800))
        show(progress(30.0, 900, 2.5))
    assert [line.split(" | ")[2] for line in out.getvalue().splitlines()] == [
        "no episode yet",
        "1.50 rescues/episode, score 0.50",
        "2.50 rescues/episode, score 1.00",
    ]
    assert len(played) == 1


def test_the_line_with_score_and_loss_fits_a_terminal() -> None:
    metrics = {"rescues_per_episode": 13.75, "losses": {"critic_loss": 0.0123}}
    console = Console(file=(out := io.StringIO()), force_terminal=True, width=80, color_system=None)
    seconds = iter([0.0, 10.0])
    known = replace(progress(10.0, 400), metrics=metrics, env_steps=400_000)
    with Training(console, lambda: next(seconds), lambda: ScriptedRescues(0.0, 14.0)) as show:
        show(known)
    assert "13.75 rescues/episode, score 0.98 | 40,000 env-steps/s | loss 0.0123" in out.getvalue()


def test_scripts_are_played_as_long_as_training_episodes() -> None:
    config = load_run_config(overrides={"train.episode_steps": 50, "train.threads": 1})
    longer = scripted_rescues(config)
    shorter = scripted_rescues(RunConfig())
    assert longer.random < 0.1 < 1.5 * shorter.best < longer.best


def test_a_training_is_scored_by_planner_where_plans_are_asked_for() -> None:
    timed = [task.replace(deadline_s=1.5) for task in Scenario().tasks]
    longer = {"train.episode_steps": 50, "train.threads": 1}
    config = load_run_config(
        overrides={**longer, "scenario.tasks": [t.model_dump() for t in timed]}
    )
    scripts = {name: training_rescues(config, name, 100, 1) for name in ("hungarian", "planner")}
    assert scripted_rescues(config).best == scripts["planner"] != scripts["hungarian"]


def test_no_score_where_hungarian_is_no_better_than_random() -> None:
    assert ScriptedRescues(0.0, 0.0).score(1.0) is None


def test_quiet_training_plays_no_scripts() -> None:
    def scripts() -> ScriptedRescues:
        raise AssertionError("nobody reads the score")

    seconds = iter([0.0, 10.0])
    with Training(Console(quiet=True), lambda: next(seconds), scripts) as show:
        show(progress(10.0, 400))


def test_imitation_is_a_stage_of_its_own() -> None:
    imitating = replace(
        progress(15.0, 250),
        stage="imitating",
        metrics={"rescues_per_episode": None, "losses": {"agreement": 0.82}},
    )
    training = replace(progress(10.0, 500), updates=20)
    out = io.StringIO()
    seconds = iter([0.0, 15.0, 15.0, 45.0, 45.0])
    with Training(Console(file=out, width=120), clock=lambda: next(seconds)) as show:
        show(imitating)
        show(training)
    assert out.getvalue().splitlines() == [
        "imitating  25% | 0:45 left | no episode yet | 17 env-steps/s | 82% as the script",
        "training  50% | 0:10 left | 1.50 rescues/episode | 50 env-steps/s | 2.0 updates/s",
    ]


def test_evaluation_counts_episodes() -> None:
    out = io.StringIO()
    seconds = iter([0.0, 5.0, 10.0])
    with Evaluating(Console(file=out, width=120), clock=lambda: next(seconds)) as show:
        show(10, 2000)
        show(500, 2000)
    assert out.getvalue() == "evaluating  25% | 0:30 left | 500 of 2,000 episodes\n"


def test_each_stage_of_robustness_and_each_run_has_a_pace_of_its_own() -> None:
    out = io.StringIO()
    now = [0.0]
    with MeasuringRobustness(Console(file=out, width=120), clock=lambda: now[0]) as show:
        now[0] = 30.0
        show("evaluating", 1_000, 4_000)
        now[0] = 100.0
        show("evaluating", 4_000, 4_000)
        for run in (0.0, 40.0):
            now[0] = 120.0 + run
            show("checking bounds", 1, 2)
            now[0] = 140.0 + run
            show("checking bounds", 2, 2)
        now[0] = 190.0
        show("watching attention", 1, 37)
    assert out.getvalue().splitlines() == [
        "evaluating  25% | 1:30 left | 1,000 of 4,000 episodes",
        "evaluating 100% | 0:00 left | 4,000 of 4,000 episodes",
        "checking bounds  50% | 0:20 left | 1 of 2 kinds and sizes of changes",
        "checking bounds 100% | 0:00 left | 2 of 2 kinds and sizes of changes",
        "checking bounds  50% | 0:20 left | 1 of 2 kinds and sizes of changes",
        "checking bounds 100% | 0:00 left | 2 of 2 kinds and sizes of changes",
        "watching attention   3% | 6:00 left | 1 of 37 plays of all worlds",
    ]


def test_measurements_are_called_so() -> None:
    out = io.StringIO()
    now = [0.0]
    jobs = [Run(RunConfig(), Path(f"run-s{seed}")) for seed in range(2)]
    with SeveralMeasurements(Console(file=out, width=120), clock=lambda: now[0]) as show:
        jobs[0].state, jobs[0].share = "running", 0.5
        now[0] = 10.0
        show(jobs)
    (line,) = out.getvalue().splitlines()
    assert line == "measuring  25% | -:-- left | 0 of 2 measurements done, 1 running"


def test_several_runs_share_one_display() -> None:
    out = io.StringIO()
    now = [0.0]
    runs = [Run(RunConfig(), Path(f"run-s{seed}")) for seed in range(5)]
    with SeveralRuns(Console(file=out, width=120), clock=lambda: now[0]) as show:

        def pass_time(seconds: float, shares: list[float]) -> None:
            now[0] += seconds
            for run, share in zip(runs, shares, strict=False):
                run.share, run.state = share, "done" if share == 1.0 else "running"
            show(runs)

        pass_time(10.0, [0.0, 0.0])  # still starting
        pass_time(0.0, [0.1, 0.1])
        # Half of two runs in 40 s of both: the five go three rounds of 80 s, and 40 s are over.
        pass_time(40.0, [0.5, 0.5])
        pass_time(40.0, [1.0, 1.0, 0.0, 0.0])
        runs[2].state = "failed"
        pass_time(80.0, [1.0, 1.0])
        pass_time(0.0, [1.0, 1.0])
    assert out.getvalue().splitlines() == [
        "training   0% | -:-- left | 0 of 5 runs done, 2 running",
        "training  20% | 3:20 left | 0 of 5 runs done, 2 running",
        "training  40% | 2:40 left | 2 of 5 runs done, 2 running",
        "training  60% | 1:20 left | 2 of 5 runs done, 1 running, 1 failed",
    ]


def test_hours_are_told_once_the_pace_is_known() -> None:
    out = io.StringIO()
    now = [0.0]
    runs = [Run(RunConfig(), Path(f"run-s{seed}")) for seed in range(4)]
    with SeveralRuns(Console(file=out, width=120), clock=lambda: now[0]) as show:
        for share in (0.001, 0.02, 0.03, 0.5):
            runs[0].state, runs[0].share = "running", share
            runs[1].state, runs[1].share = "running", share
            show(runs)
            now[0] += 1800.0
            show(runs)
    lefts = [line.split(" | ")[1] for line in out.getvalue().splitlines()]
    # Half of two runs in two hours of both: four hours each, and another round of four.
    assert lefts == ["-:-- left", "-:-- left", "98:30:00 left", "6:00:00 left"]


def test_runs_one_after_the_other_leave_a_place_free_between_them() -> None:
    out = io.StringIO()
    now = [0.0]
    runs = [Run(RunConfig(), Path(f"run-s{seed}")) for seed in range(3)]
    with SeveralRuns(Console(file=out, width=120), clock=lambda: now[0]) as show:
        runs[0].state, runs[0].share = "running", 0.1
        show(runs)
        now[0] += 45.0
        runs[0].state, runs[0].share = "done", 1.0
        show(runs)
    (line,) = out.getvalue().splitlines()
    assert line == "training  33% | 1:30 left | 1 of 3 runs done, 0 running"


def test_measuring_alone_is_a_small_part_of_a_run() -> None:
    out = io.StringIO()
    now = [0.0]
    runs = [Run(RunConfig(), Path(f"run-s{seed}"), trained=seed < 2) for seed in range(3)]
    with SeveralRuns(Console(file=out, width=120), clock=lambda: now[0]) as show:
        for share in (0.5, 1.0):
            runs[0].state, runs[0].share = "running", share
            show(runs)
            now[0] += 10.1
        # 20.2 s for a twentieth: as long for the other, then 404 s for the one to be trained.
        runs[0].state = "done"
        show(runs)
    (line,) = out.getvalue().splitlines()[-1:]
    assert line == "training   5% | 7:04 left | 1 of 3 runs done, 0 running"
