"""Unseen teams in a study: met once by each policy for any team, shown in tables and contrasts."""

import shutil
from pathlib import Path

import pytest

from innerattn.config import RunConfig, Scenario
from innerattn.errors import ConfigError, RunError
from innerattn.evaluate import trained, unseen_teams
from innerattn.policies import Policy, scripted_policy
from innerattn.report.study.write import write_study
from innerattn.studies.afterwards import measured, to_measure
from innerattn.studies.folder import StudyFolder, begin_study, open_study
from innerattn.studies.plan import plan_study
from innerattn.studies.results import read_results
from innerattn.studies.study import study_in
from innerattn.studies.work import work

SMALL = """
[grid]
scenarios = ["double"]
methods = ["team-inner", "team-uniform", "ppo-inner"]
budgets = ["quick"]
seeds = "0..2"

[[variants]]
name = "tiny"
train.num_envs = 8
train.env_steps = 160
train.log_every_env_steps = 80
train.checkpoint_every_env_steps = 80
train.compile = "off"
network.hidden_width = 16
network.attention_heads = 2
ppo.rollout_steps = 5
team.teams = 4
team.rollout_steps = 5
team.hidden_width = 8
team.key_width = 4
evaluate.episodes = 2
evaluate.score_episodes = 2
evaluate.long_episodes = 2
evaluate.long_episode_steps = 30

[[contrasts]]
name = "attention"
a = { method = "team-inner" }
b = { method = "team-uniform" }
measure = "unseen_teams"
margin = 0.1

[unseen_teams]
episodes = 2
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("teams")
    (folder / "teams.toml").write_text(SMALL)
    study = begin_study(folder / "teams.toml", folder / "study")
    work(study.ledger(), study.to_do)
    assert {*study.states().values()} == {"done"}, read_results(study).left_out
    return folder


@pytest.fixture
def done(finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StudyFolder:
    """A finished study; instead of its teams, scripts act in the first teams of each group."""

    def scripted(folder: Path, worlds: Scenario) -> tuple[RunConfig, Policy]:
        name = "hungarian" if "inner" in folder.name else "random"
        return RunConfig(), scripted_policy(name, worlds, 20_261)

    all_teams = unseen_teams.unseen_teams()
    few = tuple(all_teams[number] for number in (0, 8, 16, 20))
    monkeypatch.setattr(unseen_teams, "unseen_teams", lambda *_: few)
    monkeypatch.setattr(unseen_teams, "_scripted", unseen_teams._scripted.__wrapped__)
    monkeypatch.setattr(trained, "load_trained", scripted)
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    return open_study(tmp_path / "study")


@pytest.mark.long
def test_each_policy_for_any_team_meets_them_once(done: StudyFolder) -> None:
    of_teams = {one.key for one in done.planned if one.place["method"] != "ppo-inner"}
    _, files = write_study(done, read_results(done))
    assert "6 of these have not met the unseen teams" in files[0].read_text()
    jobs = to_measure(done)
    assert {job.run.key for job in jobs} == of_teams
    for job in jobs:
        job.do(lambda _: None)
    assert to_measure(done) == []
    for run in done.planned:
        found = measured(done, run)
        if run.key not in of_teams:
            assert found == {}
            continue
        score = pytest.approx(1.0 if run.place["method"] == "team-inner" else 0.0)
        parts = ("_worst", "_mixtures", "_sizes", "_bodies", "_changes")
        assert found == {f"unseen_teams{part}": score for part in ("", *parts)}
    report, files = write_study(done, read_results(done))
    (compared,) = report.compared
    assert compared.mean == pytest.approx(1.0)
    assert len(compared.seeds) == 3
    page = files[0].read_text()
    assert "unseen teams | unseen teams, worst | unseen teams, mixtures" in page
    assert "have not met" not in page


@pytest.mark.long
def test_a_damaged_file_is_named(done: StudyFolder) -> None:
    job = to_measure(done)[0]
    job.do(lambda _: None)
    job.path.write_text("{}")
    with pytest.raises(RunError, match="not a measurement in unseen teams; remove it"):
        measured(done, job.run)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[unseen_teams]", "unseen_teams: must stand beside a method for any team"),
        ("[unseen_teams]\nepisodes = 1", "unseen_teams.episodes"),
        (
            "[grid]\nmethods = ['team-inner']\n[[tables]]\ntitle = 'a'\n"
            "measures = ['unseen_teams_worst']",
            "it needs [unseen_teams]",
        ),
        (
            "[grid]\nmethods = ['team-inner']\n[unseen_teams]\n[[tables]]\ntitle = 'a'\n"
            "measures = ['unseen_teams, long']",
            "has no value of long episodes",
        ),
        (
            "[unseen_teams]\n[search]\nppo.epochs = [1, 2]",
            "search: must stand without unseen_teams",
        ),
    ],
)
def test_bad_files_are_refused_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        plan_study(study_in(text.encode(), "study.toml"), tmp_path.joinpath)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
