"""The page about runs: what it tells, what it refuses, and how it looks in a browser."""

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PHONE, WIDE, opened_browser, until, visit
from made_run import made_run
from playwright.sync_api import Browser

from innerattn.cli.main import main
from innerattn.errors import RunError
from innerattn.experiments.run import FinishedRun
from innerattn.report.runs.page import read_robustness, read_runs, runs_page
from innerattn.stats import Estimate
from innerattn.stats.text import format_estimate

# Texts of plots that reach out of their picture.
OUTSIDE = """[...document.querySelectorAll(".picture text")].filter((text) => {
  const box = text.closest("svg").getBoundingClientRect(), own = text.getBoundingClientRect();
  return own.left < box.left - 1 || own.right > box.right + 1 || own.bottom > box.bottom + 1;
}).map((text) => text.textContent).join()"""
INTERVAL = {"mean": 0.5, "low": 0.25, "high": 0.75}
ROBUSTNESS: dict[str, Any] = {
    "schema_version": 1,
    "episodes": 9,
    "episode_steps": 50,
    "seed": 7,
    "severities": [0.25, 1.0],
    "policies": [
        {
            "policy": name,
            "by_kind": {"motor_gain": INTERVAL, "blackout": None, "all": INTERVAL},
            "rescues_per_episode": INTERVAL,
        }
        for name in ("mine </script>", "greedy")
    ],
}


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as found:
        yield found


@pytest.fixture(scope="module")
def mixed(runs: list[FinishedRun]) -> list[FinishedRun]:
    return [run for run in runs if run.situation == "mixed"]


@pytest.fixture(scope="module")
def page(mixed: list[FinishedRun]) -> str:
    return runs_page(mixed, ROBUSTNESS)


def text_of(page: str) -> str:
    without = re.sub(r"<(script|style)\b.*?</\1>|srcdoc=\".*?\"", "", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub("<[^>]*>", " ", without))


def plots_of(page: str) -> list[dict[str, Any]]:
    (found,) = re.findall(r'id="plots">(.*?)</script>', page)
    return list(json.loads(found))


def test_scores_are_those_of_the_evaluations(page: str, mixed: list[FinishedRun]) -> None:
    text = text_of(page)
    for run in mixed:
        row = [
            format_estimate(Estimate.from_json(part[name]) if part[name] else None)
            for part in (run.summary, run.summary["long"])
            for name in ("rescues_per_episode", "score")
        ]
        assert f"{run.folder.name} (seed {run.seed}) {' '.join(row)}" in text
    values = [
        run.summary["rescues_per_episode"]["mean"] for run in mixed if run.method == "td-inner"
    ]
    assert f"mean of 3 runs {np.mean(values):.2f} [" in text


def test_it_tells_what_was_trained(page: str, mixed: list[FinishedRun]) -> None:
    text = text_of(page)
    for run in mixed:
        assert run.config_sha256[:12] in text
        assert f"python {run.info.versions['python']}" in text
    assert "hidden_width = 8" in text
    assert "Table II" in text
    assert "undecided" in text


def test_plots_hold_the_courses_of_the_runs(page: str) -> None:
    plots = {plot["title"]: plot for plot in plots_of(page)}
    assert list(plots) == [
        "Rescues per episode of training: mixed",
        "Attention entropy: td-inner, mixed",
        "Attention around handoffs: td-inner, mixed",
        "Retention under faults",
    ]
    curve = plots["Rescues per episode of training: mixed"]
    assert curve["levels"].keys() == {"hungarian", "greedy"}
    assert [line["name"] for line in curve["lines"]] == ["td-inner", "td-uniform"]
    assert len(curve["lines"][0]["low"]) == len(curve["lines"][0]["x"])  # a band over three runs
    entropy = plots["Attention entropy: td-inner, mixed"]["lines"]
    looks = [(line["name"], line["colour"], line["dash"]) for line in entropy]
    assert looks == [  # as in the replay: a colour for a kind, a dash for a twin
        ("food_0", "kind-0", 0),
        ("food_1", "kind-0", 1),
        ("navigation_0", "kind-1", 0),
        ("medical_0", "kind-2", 0),
    ]
    retention = plots["Retention under faults"]
    assert retention["rows"] == ["motor gain", "blackout", "all kinds"]
    first = retention["lines"][0]
    assert (first["x"], first["low"], first["y"], first["high"]) == (
        [0, 2],
        [0.25, 0.25],
        [0.5, 0.5],
        [0.75, 0.75],
    )


def test_scripts_have_the_scores_that_the_terminal_shows(
    page: str, mixed: list[FinishedRun]
) -> None:
    text = text_of(page)
    scripted = min(mixed, key=lambda run: run.seed).summary["scripted"]
    least, greedy, most = (scripted[name]["mean"] for name in ("random", "greedy", "hungarian"))
    shown = format_estimate(Estimate.from_json(scripted["greedy"]))
    assert f" greedy {shown} {(greedy - least) / (most - least):.2f} " in text
    assert re.search(r" hungarian \S+ \[\S+ \S+ 1\.00 ", text)


def test_it_opens_with_the_scores_the_best_first(page: str) -> None:
    (line,) = re.findall(r'<p class="verdict">(.*?)</p>', page)
    head = "Score (0 plays like random, 1 like hungarian): "
    assert line.startswith(head)
    found = [
        (float(score), name)
        for name, score in re.findall(r"(td-\w+) on mixed mean of \d runs ([\d.]+) \[", line)
    ]
    assert {name for _, name in found} == {"td-inner", "td-uniform"}
    assert found == sorted(found, reverse=True)


@pytest.mark.long
def test_scenarios_and_settings_of_every_kind_stand_side_by_side(
    runs: list[FinishedRun], tmp_path: Path
) -> None:
    """Three situations or settings, two of which have one method, seed and situation."""
    wide = made_run(
        tmp_path / "wide", "mixed", "td-inner", 0, keys={"scenario.arena_half_width_m": 3.0}
    )
    slow = made_run(tmp_path / "slow", "mixed", "ppo-inner", 0, keys={"ppo.gamma": 0.9})
    fast = made_run(tmp_path / "fast", "mixed", "ppo-inner", 0)
    named = [
        run.folder.rename(run.folder.parent / name)
        for run, name in ((wide, "wide"), (slow, "slow"), (fast, "fast"))
    ]
    every = read_runs([*(run.folder for run in runs), *named])
    page = runs_page(every)
    assert len(page) < 1_500_000
    (line,) = re.findall(r"<h1>(.*?)</h1>", page)
    assert line == (
        "td-inner on mixed as in mixed-td-inner-s2, td-uniform on mixed as in mixed-td-inner-s2, "
        "ppo-inner on single, td-inner on mixed as in wide, "
        "ppo-inner on mixed as in slow, ppo-inner on mixed as in fast"
    )
    titles = [plot["title"] for plot in plots_of(page)]
    assert "Rescues per episode of training: single" in titles
    assert "Rescues per episode of training: mixed as in wide" in titles
    assert "; and 2 more" in page
    assert "Shown, since a replay holds up to 4 runs of the same worlds: " in page


def test_runs_in_other_worlds_show_the_first_alone(page: str) -> None:
    assert "a replay holds up to 4 runs of the same worlds: mixed-td-inner-s" in page
    assert page.count("<iframe") == 1


def test_a_run_without_attention_or_shared_tasks(tmp_path: Path, tiny: list[str]) -> None:
    run, config = tmp_path / "lone", tmp_path / "lone.toml"
    config.write_text(
        '[scenario]\nrobots = [{ name = "a", kind = "k", abilities = ["food"], '
        "max_speed_mps = 1.0, mass_kg = 1.0 }]\n"
        'tasks = [{ name = "t", needs = ["food"] }]\n'
    )
    options = ["--config", str(config), "--method", "mappo", "--run-dir", str(run), *tiny]
    assert main(["train", *options]) == 0
    text = text_of(runs_page(read_runs([run])))
    assert "These runs have no learnt attention." in text
    assert "t is shared by 1 robots" in text or "t is shared by 0 robots" in text


def test_the_command(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, measured = tmp_path / "r.html", tmp_path / "robustness.json"
    measured.write_text(json.dumps(ROBUSTNESS))
    options = [str(run_dir), "-o", str(out), "--robustness", str(measured)]
    assert main(["report", *options]) == 0
    assert re.fullmatch(r"\S+r\.html: 1 run, \d\.\d MB\n", capsys.readouterr().out)
    assert "mine &lt;/script&gt;" in out.read_text("utf-8")
    bare = tmp_path / "bare"
    shutil.copytree(run_dir, bare, ignore=shutil.ignore_patterns("evaluation"))
    (tmp_path / "none.json").write_text("[]")
    cases = [
        (2, [], "RUN: at least one run is needed"),
        (1, ["nobody"], "nobody: no such run folder"),
        (1, [str(bare)], "summary.json: missing"),
        (1, [str(run_dir), str(run_dir)], "must be one run of each seed"),
        (2, [str(run_dir), "-o", "x.pdf"], "-o x.pdf: must end in .html"),
        (1, [str(run_dir), "--robustness", str(tmp_path / "none.json")], "not a document of"),
    ]
    for code, arguments, message in cases:
        more = [] if "-o" in arguments else ["-o", str(tmp_path / "no.html")]
        assert main(["report", *arguments, *more]) == code, arguments
        captured = capsys.readouterr().err
        assert message in captured
        assert captured.count("\n") == 1


def test_what_is_missing_is_named(mixed: list[FinishedRun], tmp_path: Path) -> None:
    with pytest.raises(RunError, match="not a document of innerattn robustness"):
        runs_page(mixed[:1], {"policies": [{}]})
    with pytest.raises(RunError, match=r"nothing\.json: missing, or not"):
        read_robustness(tmp_path / "nothing.json")


@pytest.mark.long
@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_everybody_can_read_it(
    browser: Browser, tmp_path: Path, page: str, size: tuple[int, int], theme: str
) -> None:
    path = tmp_path / "report.html"
    path.write_text(page, "utf-8")
    with visit(browser, path, size, theme) as seen:
        until(seen.page, "document.documentElement.dataset.drawn === 'true'")
        assert seen.page.locator(".plot .picture").count() == 4
        assert not seen.page.evaluate(OUTSIDE)
        replay = seen.page.frame_locator("iframe")
        replay.get_by_role("button", name="Next event").click()
        assert replay.locator("canvas").count() == 2  # td-inner and td-uniform of one seed
        assert not seen.serious_faults()
        assert seen.page.evaluate("document.documentElement.scrollWidth") <= size[0]
