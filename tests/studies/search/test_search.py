"""A search in its folder: who is trained, what is found, and what is lost where workers die."""

import json
import math
import re
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from tiny_study import SEARCHED

from innerattn.cli.main import main
from innerattn.errors import ConfigError, RunError
from innerattn.experiments.side_by_side import Run
from innerattn.report.study.write import write_study
from innerattn.report.watch.study import study_pages
from innerattn.studies.folder import StudyFolder, begin_study, open_study
from innerattn.studies.plan import plan_study
from innerattn.studies.results import Result, read_results
from innerattn.studies.search.race import Standing
from innerattn.studies.search.state import Searching, Watched
from innerattn.studies.search.trials import add_values, read_values
from innerattn.studies.study import study_in
from innerattn.studies.work import work


def invented(one: Result, measure: str, length: str) -> float:
    """A score that is best at a learning rate of 0.01, and differs little between seeds."""
    assert (measure, length) == ("score", "standard")
    config = one.run.config
    return 1.0 - abs(math.log10(config.ppo.learning_rate) + 2.0) + 0.001 * config.train.seed


@pytest.fixture
def begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StudyFolder:
    """A search whose runs are trained, with scores that are invented."""
    monkeypatch.setattr(Result, "value", invented)
    return begun_in(tmp_path)


def begun_in(folder: Path, text: str = SEARCHED, name: str = "searched") -> StudyFolder:
    file = folder / f"{name}.toml"
    file.write_text(text)
    return begin_study(file, folder / name)


def what_is_known(standings: list[Standing]) -> list[object]:
    return [(one.trial.name, dict(one.trial.values), one.scores, one.state) for one in standings]


@pytest.mark.long
def test_a_search_races_chooses_and_confirms(begun: StudyFolder) -> None:
    trained: list[tuple[object, int]] = []
    work(
        begun.ledger(),
        Searching(begun),
        ended=lambda one: trained.append((one.run.place["variant"], one.run.seed)),
    )
    found = Searching(begun).look()
    assert [one.trial.number for one in found.standings] == list(range(5))
    assert {len(one.trial.values) for one in found.standings[1:]} == {1}
    scores = {one.trial.name: sum(one.scores.values()) / len(one.scores) for one in found.standings}
    best = max(scores, key=lambda name: scores[name])
    assert found.best is not None
    assert found.best.trial.name == best != "recipe"
    states = Counter(one.state for one in found.standings)
    assert states["dropped"] > 0
    assert states["finished"] + states["dropped"] == 5
    expected = {
        (one.trial.name, seed)
        for one in found.standings
        for seed in (0, 1, 2)[: 3 if one.state == "finished" else 2]
    }
    expected |= {(name, seed) for name in ("recipe", best) for seed in (10, 11, 12)}
    assert set(trained) == expected
    assert len(trained) == len(expected), "each run once"
    assert (found.wanted, found.to_propose, Watched(begun).now().left) == ([], 0, 0)

    now = Watched(begun).now().study
    report, files = write_study(now, read_results(now))
    assert {"report.md", "report.json", "optuna.log", "search.png"} <= {one.name for one in files}
    page = files[0].read_text()
    assert f"**{best}** is the best of 4 of 4 trials" in page
    (compared,) = report.compared
    assert compared.seeds == (10, 11, 12)
    recipe_rate = begun.planned[0].config.ppo.learning_rate
    best_rate = found.best.trial.values["ppo.learning_rate"]
    expected_gain = abs(math.log10(recipe_rate) + 2.0) - abs(math.log10(float(best_rate)) + 2.0)
    assert compared.mean == pytest.approx(expected_gain)
    document = json.loads((begun.path / "report.json").read_text())["search"]
    assert document["best"] == best
    assert all(one["core_s"] > 0.0 for one in document["trials"])
    (command,) = re.findall(r"^innerattn train .*$", page, re.MULTILINE)
    assert f"--ppo.learning-rate {best_rate}" in command


@pytest.mark.long
def test_the_same_search_finds_the_same_after_a_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Result, "value", invented)
    whole, cut = (begun_in(tmp_path, name=name) for name in ("whole", "cut"))
    work(whole.ledger(), Searching(whole))
    do, tries = Run.do, 0

    def stopped(self: Run, report: Callable[[float], None]) -> object:
        nonlocal tries
        tries += 1
        if tries in (2, 9):
            raise KeyboardInterrupt
        return do(self, report)

    monkeypatch.setattr(Run, "do", stopped)
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            work(cut.ledger(), Searching(cut))
    work(cut.ledger(), Searching(cut))
    found = [list(Searching(study).look().standings) for study in (whole, cut)]
    assert what_is_known(found[0]) == what_is_known(found[1])


def test_a_number_is_one_workers(begun: StudyFolder) -> None:
    barrier, made = threading.Barrier(8), []

    def propose(value: float) -> None:
        barrier.wait()
        if add_values(begun, 1, {"ppo.learning_rate": value}):
            made.append(value)

    threads = [threading.Thread(target=propose, args=(0.001 * (n + 1),)) for n in range(8)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert read_values(begun) == {1: {"ppo.learning_rate": made[0]}}
    assert len(made) == 1
    assert [one.name for one in (begun.path / "search").iterdir()] == ["trial-1.json"]


@pytest.mark.long
def test_a_trial_that_fails_or_cannot_be_run_stops_no_other(
    begun: StudyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    add_values(begun, 1, {"ppo.learning_rate": 0.01, "network.attention": "uniform"})
    add_values(begun, 2, {"ppo.learning_rate": 0.01})
    do = Run.do

    def broken(self: Run, report: Callable[[float], None]) -> object:
        if self.config.ppo.learning_rate == 0.01:
            raise RunError("no such luck")
        return do(self, report)

    monkeypatch.setattr(Run, "do", broken)
    work(begun.ledger(), Searching(begun))
    found = Searching(begun).look()
    assert [one.state for one in found.standings[1:3]] == ["failed", "failed"]
    assert "network.attention" in str(found.standings[1].trial.refused)
    assert not found.wanted
    assert found.best is not None
    now = Watched(begun).now().study
    _, files = write_study(now, read_results(now))
    page = files[0].read_text()
    assert "trial-1 cannot be run: " in page
    assert "no such luck" in page


@pytest.mark.long
def test_a_trial_of_another_space_stays_in_the_race(begun: StudyFolder) -> None:
    add_values(begun, 1, {"ppo.learning_rate": 0.01})
    file = begun.path.parent / "searched.toml"
    file.write_text(SEARCHED.replace("trials = 4", "trials = 2") + "ppo.epochs = [1, 2]\n")
    changed = begin_study(file, begun.path)
    assert len(changed.rules) == 2
    work(changed.ledger(), Searching(changed))
    found = Searching(changed).look()
    assert [sorted(one.trial.values) for one in found.standings] == [
        [],
        ["ppo.learning_rate"],
        ["ppo.epochs", "ppo.learning_rate"],
    ]
    assert found.standings[1].state == "finished"


@pytest.mark.long
def test_a_number_that_is_missing_is_left_out(begun: StudyFolder) -> None:
    for number in (1, 3):
        add_values(begun, number, {"ppo.learning_rate": 0.001 * number})
    work(begun.ledger(), Searching(begun))
    numbers = [one.trial.number for one in Searching(begun).look().standings]
    assert numbers == [0, 1, 3, 4, 5]


def test_very_many_trials_are_refused_at_once(begun: StudyFolder) -> None:
    folder = begun.path / "search"
    folder.mkdir()
    for number in range(1, 1_002):
        (folder / f"trial-{number}.json").write_text('{"values": {"ppo.learning_rate": 0.1}}')
    with pytest.raises(RunError, match="too many trials: must be at most 1,000"):
        Searching(begun).look()


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"values": 3}', '{"values": {"ppo.gamma": [1]}}', "{" * 2_000]
)
def test_a_damaged_trial_is_named(text: str, begun: StudyFolder) -> None:
    (begun.path / "search").mkdir()
    (begun.path / "search/trial-1.json").write_text(text)
    (begun.path / "search/.trial-2.json.0123").write_text("a part")
    with pytest.raises(RunError, match=r"trial-1\.json: holds no trial of a search"):
        Searching(begun).look()


@pytest.mark.long
def test_the_commands_show_a_search(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With two workers, and real scores of untrained teams: nothing beats the recipe."""
    file, out = tmp_path / "searched.toml", tmp_path / "out"
    file.write_text(SEARCHED.replace("trials = 4", "trials = 2").replace("0..2", "0..1"))
    assert main(["study", "run", str(file), "--out", str(out), "--workers", "2"]) == 0
    printed = capsys.readouterr().out
    assert "0 runs, 0 done, 0 failed, at most 12 to do by 2 workers" in printed
    assert "trial-2" in printed
    assert main(["study", "status", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "waiting, 0 failed" in printed
    assert "recipe" in printed
    assert "trial" in printed
    study = open_study(out)
    found = Searching(study).look()
    assert [one.trial.number for one in found.standings] == [0, 1, 2]
    assert not found.wanted
    assert {one.name.partition(".")[2] for one in (out / "claims").iterdir()} == {"1", "1.beat"}
    shown = json.loads(study_pages(study)["state"]().text)
    assert (shown["search"], shown["runs"], shown["left"]) == (True, 6, None)
    assert [row[0] for row in shown["rows"]] == ["recipe", "trial-1", "trial-2"]
    assert shown["verdicts"][0].startswith("No trial of 2 is better than the recipe: score ")
    assert main(["study", "run", str(out)]) == 0
    assert "at most 0 to do" in capsys.readouterr().out


ONE = "[grid]\nbudgets = ['quick']\n[search]\n"
RATE = "ppo.learning_rate = { low = 0.001, high = 0.01 }\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ONE, "search: must name a key of a run"),
        (ONE + "trials = 0\n" + RATE, "search.trials"),
        (ONE + "lucky = 3\n" + RATE, "search.lucky: unknown key"),
        (ONE + "ppo.learning_rat = [0.1, 0.2]", "did you mean learning_rate?"),
        (ONE + "ppo.learning_rate = 0.1", "must be a list of two values or more"),
        (ONE + "ppo.learning_rate = [0.1]", "must be a list of two values or more"),
        (ONE + "ppo.learning_rate = [0.1, 0.1]", "a value stands twice"),
        (ONE + "ppo.learning_rate = [[1], [2]]", "must be a text, a number, true or false"),
        (ONE + "ppo.gamma = { low = 0.99, high = 0.9 }", "must be above low = 0.99"),
        (ONE + "ppo.gamma = { low = 0.9 }", "search.ppo.gamma"),
        (ONE + "ppo.gamma = { low = 0, high = 0.9, log = true }", "above 0 where log = true"),
        (ONE + "ppo.gamma = { low = 0.9, high = 1.5 }", "search.ppo.gamma = 1.5: ppo.gamma"),
        (ONE + "network.encoder = ['flat', 'fat']", "search.network.encoder = 'fat'"),
        (ONE + "train.seed = [1, 2]", "search.train.seed: is set by grid.seeds"),
        (ONE + "train.method = ['mappo', 'td-inner']", "is set by grid.methods"),
        (ONE + "scenario.episode_steps = [20, 30]", "must not change what is measured"),
        (ONE + "evaluate.episodes = [20, 30]", "must not change what is measured"),
        (ONE + "measure = 'scor'\n" + RATE, "search.measure = 'scor': must be one of score"),
        (ONE + "confirm = '0..2'\n" + RATE, "search.confirm: 0: must be no seed of the grid"),
        (ONE + "confirm = 'x'\n" + RATE, "search.confirm = 'x': must be a range"),
        (ONE.replace("[search]", "seeds = [0]\n[search]") + RATE, "must be two seeds or more"),
        (ONE.replace("[search]", "methods = ['mappo', 'td-inner']\n[search]") + RATE, "one recipe"),
        (ONE.replace("[search]", "ppo.gamma = [0.9, 0.99]\n[search]") + RATE, "several values"),
        (ONE.replace("[search]", "ppo.learning_rate = [0.1]\n[search]") + RATE, "by the grid, too"),
        (ONE + RATE + "[[variants]]\nname = 'a'", "search: must stand without variants"),
        (ONE + RATE + "[[curves]]\ntitle = 'a'", "search: must stand without curves"),
        (
            ONE.replace("[search]", "seeds = '0..499'\n[search]\ntrials = 900\nconfirm = [5000]")
            + RATE,
            "may need 450,500 runs: must be at most 10,000",
        ),
    ],
)
def test_bad_searches_are_refused_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        plan_study(study_in(text.encode(), "study.toml"), tmp_path.joinpath)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
