"""Studies as files: what they plan, and what is refused before the first run."""

import datetime
import shutil
from pathlib import Path

import pytest

from innerattn.config import Scenario, load_run_config
from innerattn.errors import ConfigError, RunError
from innerattn.experiments.plan import of_seed
from innerattn.studies.folder import begin_study, open_study
from innerattn.studies.plan import PlannedRun, plan_study
from innerattn.studies.study import study_in

SHARING = """
question = "Does parameter sharing matter?"

[grid]
scenarios = ["mixed", "flood.toml"]
methods = ["ppo-inner", "mappo"]
budgets = ["quick"]
seeds = "0..2"
ppo.learning_rate = [0.001, 0.002]

[[variants]]
name = "own"

[[variants]]
name = "shared"
network.parameter_sharing = "kind"

[[contrasts]]
name = "sharing"
a = { variant = "shared", ppo.learning_rate = 0.001 }
b = { variant = "own", ppo.learning_rate = 0.001 }
margin = 0.03
"""


def planned(text: str, folder: Path) -> list[PlannedRun]:
    return plan_study(study_in(text.encode(), "study.toml"), folder.joinpath)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "flood.toml").write_text("episode_steps = 30\n")
    return tmp_path


def test_each_combination_is_a_run(folder: Path) -> None:
    runs = planned(SHARING, folder)
    assert len(runs) == 2 * 2 * 2 * 2 * 3
    assert [run.seed for run in runs] == [seed for seed in range(3) for _ in range(16)]
    assert len({run.key for run in runs}) == len(runs)
    first, last = runs[0], runs[-1]
    assert first.place == {
        "scenario": "mixed",
        "method": "ppo-inner",
        "budget": "quick",
        "variant": "own",
        "ppo.learning_rate": 0.001,
    }
    assert last.place["scenario"] == "flood"
    assert last.config.scenario == Scenario.from_toml(folder / "flood.toml")
    assert last.config.network.parameter_sharing == "kind"
    assert last.config.ppo.learning_rate == 0.002
    assert (last.config.train.seed, last.config.evaluate.seed) == (2, 12_347)
    assert str(first) == "mixed ppo-inner own 0.001, seed 0"


def test_defaults_are_one_preset_one_method_three_seeds(tmp_path: Path) -> None:
    runs = planned("", tmp_path)
    assert [(run.seed, dict(run.place)) for run in runs] == [
        (seed, {"scenario": "mixed", "method": "ppo-inner", "budget": "fast"}) for seed in range(3)
    ]


GRID = "[grid]\nbudgets = ['quick']\n"
TWO = GRID + "methods = ['td-inner', 'td-uniform']\n"
ASKED = TWO + "[[contrasts]]\nname = 'x'\nmargin = 0.1\n"


def test_a_run_is_the_one_that_its_keys_make(folder: Path) -> None:
    """Only the first seed is checked as a whole; the others are its copies."""
    text = """
[grid]
scenarios = ["mixed", "flood.toml"]
methods = ["ppo-inner", "td-uniform"]
seeds = [3, 0, 7]
[[variants]]
name = "plain"
[[variants]]
name = "same worlds"
evaluate.seed = 5
train.threads = 2
"""
    for run in planned(text.replace("same worlds", "same_worlds"), folder):
        scenario, method, same = (
            run.place["scenario"],
            run.place["method"],
            run.place["variant"] == "same_worlds",
        )
        given = {"evaluate.seed": 5, "train.threads": 2} if same else {}
        slow = load_run_config(
            "mixed",
            str(method),
            "fast",
            overrides={**of_seed(run.seed), **given},
            scenario_file=folder / "flood.toml" if scenario == "flood" else None,
        )
        assert run.config == slow
        assert run.digest == slow.digest()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[grid", "is not a TOML file"),
        ("grids = 1", "grids: unknown key, did you mean grid?"),
        ("[grid]\nmethods = []", "grid.methods"),
        ("[grid]\nmethods = ['td-iner']", "did you mean 'td-inner'?"),
        ("[grid]\nmethods = ['mappo', 'mappo']", "grid.methods: 'mappo' stands twice"),
        ("[grid]\nbudgets = ['quik']", "unknown budget preset 'quik'"),
        ("[grid]\nscenarios = ['mixt']", "must be a TOML file or one of"),
        ("[grid]\nscenarios = ['gone.toml']", "cannot read"),
        ("[grid]\nscenarios = ['flood.toml', 'other/flood.toml']", "same name"),
        ("[grid]\nseeds = '4..0'", "must be 1 to 1,000 seeds"),
        ("[grid]\nseeds = '0..1000'", "must be 1 to 1,000 seeds"),
        ("[grid]\nseeds = '0-4'", "must be a range such as '0..4'"),
        ("[grid]\nseeds = [1, 1]", "grid.seeds: 1 stands twice"),
        ("[grid]\nseeds = [0, -1]", "grid.seeds: -1: must be in 0..="),
        (f"[grid]\nseeds = [0, {2**63}]", f"grid.seeds: {2**63}: must be in 0..="),
        (
            "[grid]\nseeds = '0..999'\nmethods = ['mappo', 'td-inner']\n"
            "train.num_envs = [1, 2, 3, 4, 5, 6]",
            "grid: has 12,000 runs: must be at most 10,000",
        ),
        ("[[contrasts]]\n" * 201, "contrasts"),
        ("[grid]\nppo.gamma = 0.9", "grid.ppo.gamma = 0.9: must be a list of values"),
        ("[grid]\ngamma = [0.9]", "grid: gamma: unknown key"),
        ("[grid]\nppo.gama = [0.9]", "did you mean gamma?"),
        ("[grid]\ntrain.seed = [3]", "train.seed: is set by grid.seeds"),
        (GRID + "td.gamma = [0.9, 0.99]\nmethods = ['mappo']", "are the same run"),
        (GRID + "[[variants]]\nname = 'a'\n[[variants]]\nname = 'a'", "'a' stands twice"),
        (GRID + "[[variants]]\nname = 'a b'", "variants[0].name"),
        (ASKED + "a = {method = 'td-inner'}\nb = {method = 'mappo'}", "b.method = 'mappo'"),
        (ASKED + "a = {methods = 'td-inner'}\nb = {method = 'td-inner'}", "is no key of the grid"),
        (ASKED + "a = {method = 'td-inner'}\nb = {method = 'td-inner'}", "must be different runs"),
        (ASKED + "a = {budget = 'quick'}\nb = {method = 'td-inner'}", "leaves open"),
        (
            ASKED + "a = {method = 'td-inner'}\nb = {method = 'td-uniform'}\nmeasure = 'scor'",
            "measure = 'scor': must be one of score",
        ),
        (
            "[grid]\nscenarios = ['mixed', 'air-ground']",
            "grid (scenario = air-ground, method = ppo-inner, budget = fast): "
            "scenario.obstacles[0]: network.symmetry must be 'none' where an obstacle has a fixed",
        ),
    ],
)
def test_bad_files_are_refused_in_one_line(text: str, message: str, folder: Path) -> None:
    (folder / "other").mkdir()
    (folder / "other/flood.toml").write_text("episode_steps = 31\n")
    with pytest.raises(ConfigError) as caught:
        planned(text, folder)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_folder_keeps_a_map_that_is_a_file(folder: Path) -> None:
    office = Path(__file__).parents[2] / "examples" / "scenarios"
    for name in ("office.toml", "office.yaml", "office.png"):
        shutil.copy(office / name, folder)
    file, out = folder / "sharing.toml", folder / "studies/sharing"
    file.write_text(SHARING.replace("flood.toml", "office.toml"))
    begun = begin_study(file, out)
    for name in ("office.toml", "office.yaml", "office.png"):
        (folder / name).unlink()
    again = open_study(out)
    assert [run.key for run in again.planned] == [run.key for run in begun.planned]
    worlds = [run.config.scenario for run in again.planned if run.config.scenario.map is not None]
    assert worlds
    assert worlds[0].map == Scenario.from_toml(office / "office.toml").map


def test_the_folder_keeps_the_file_its_scenarios_and_its_rules_over_time(folder: Path) -> None:
    file, out = folder / "sharing.toml", folder / "studies/sharing"
    file.write_text(SHARING)
    times = iter(datetime.datetime(2026, 1, day, tzinfo=datetime.UTC) for day in (1, 2, 3))
    begun = begin_study(file, out, lambda: next(times))
    (folder / "flood.toml").unlink()  # the study has a copy
    again = open_study(out)
    assert [run.key for run in again.planned] == [run.key for run in begun.planned]
    (folder / "flood.toml").write_text("episode_steps = 30\n")
    file.write_text(f"# a comment\n{SHARING}")
    assert begin_study(file, out, lambda: next(times)).rules == begun.rules
    (out / "runs" / begun.planned[0].key).mkdir()
    file.write_text(SHARING.replace("margin = 0.03", "margin = 0.3"))
    changed = begin_study(file, out, lambda: next(times)).rules
    assert [(one.date, one.finished) for one in changed] == [
        ("2026-01-01T00:00:00+00:00", 0),
        ("2026-01-02T00:00:00+00:00", 1),
    ]
    assert open_study(out).rules == changed


def test_other_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="holds no study"):
        open_study(tmp_path)
    (tmp_path / "study.toml").write_text("")
    (tmp_path / "rules.json").write_text("[]")
    with pytest.raises(RunError, match="not a record of a study's rules"):
        open_study(tmp_path)


def test_a_bad_file_leaves_no_folder(tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text("[grid]\nmethods = ['nothing']")
    with pytest.raises(ConfigError, match="'nothing'"):
        begin_study(file, tmp_path / "out")
    assert not (tmp_path / "out").exists()
