"""Attention in the actor in a study: measured once, shown in tables and a figure, and compared."""

import json
from pathlib import Path

import numpy as np
import pytest
from attending_script import AttendingScript

from innerattn.config import RunConfig, Scenario
from innerattn.errors import ConfigError, RunError
from innerattn.evaluate import trained
from innerattn.evaluate.faults.attended import play_failures
from innerattn.measures.sharing.handoff import all_handoffs, rescues_nobody, with_control
from innerattn.report.plots.leads import draw_leads
from innerattn.report.study.page import contrasts_tables
from innerattn.stats.comparison import contrast, holm
from innerattn.studies.actor_attention import OFFSETS, RunAttention, handoff_leads, lead_curves
from innerattn.studies.afterwards import measured
from innerattn.studies.folder import StudyFolder, begin_study
from innerattn.studies.plan import plan_study
from innerattn.studies.results import Result, compare
from innerattn.studies.study import study_in

ATTENDING = """
[grid]
scenarios = ["double", "mixed"]
methods = ["ppo-uniform"]
budgets = ["fast"]
seeds = "0..3"

[[variants]]
name = "attention"
network.encoder = "entities"

[[variants]]
name = "flat"

[actor_attention]
episodes = 6

[[contrasts]]
name = "before"
a = { variant = "attention" }
b = { variant = "attention" }
measure = "actor_lead_before"
measure_b = "actor_lead_before_bystander"
margin = 0.05
"""


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StudyFolder:
    """A study whose runs need not be there: a script acts instead of them."""

    def script(_: Path, worlds: Scenario) -> tuple[RunConfig, AttendingScript]:
        return RunConfig(), AttendingScript(worlds)

    monkeypatch.setattr(trained, "load_trained", script)
    (tmp_path / "attending.toml").write_text(ATTENDING)
    return begin_study(tmp_path / "attending.toml", tmp_path / "study")


def test_a_run_is_measured_once_and_only_if_its_actors_attend(study: StudyFolder) -> None:
    of = {run.key: RunAttention.of(study, run) for run in study.planned}
    assert [run.key for run in study.planned if of[run.key] is not None] == [
        run.key for run in study.planned if run.place["variant"] == "attention"
    ]
    run = study.planned[0]
    assert measured(study, run) == {}
    shares: list[float] = []
    of[run.key].do(shares.append)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    found = measured(study, run)

    worlds = run.config.scenario.replace(episode_steps=50)
    record, failures = play_failures(
        AttendingScript(worlds), worlds, 25, 6, run.config.evaluate.seed
    )
    assert failures is not None
    assert found["actor_retained_most_attended"] == failures.retained_most()
    assert found["actor_retained_least_attended"] == failures.retained_least()
    assert found["actor_retained_nearest"] == failures.retained_nearest()
    assert found["actor_attends_nearest"] == failures.attends_nearest()
    assert found["actor_retained_helper"] == failures.retained_helper()
    assert found["actor_retained_other"] == failures.retained_other()
    assert found["actor_attends_helper"] == failures.attends_helper()
    events = all_handoffs(record)
    events = events[rescues_nobody(record, with_control(record, events))]
    assert found["actor_handoffs"] == len(events) > 3
    before: dict[str, list[float]] = {"": [], "_bystander": []}
    for event in events:
        for who, robot in (("", event["robot"]), ("_bystander", 1 - event["robot"])):
            steps = range(max(event["start"], event["first"] - 2), event["first"] + 1)
            heads = record.steps["actor_attention"][event["episode"], list(steps), :, robot]
            leads = heads[..., event["after"]].astype(float) - heads[..., event["before"]]
            before[who].append(float(leads.mean()))
    for who, each in before.items():
        assert found[f"actor_lead_before{who}"] == pytest.approx(np.mean(each))


def test_curves_are_means_over_runs_of_means_over_handoffs(study: StudyFolder) -> None:
    runs = [run for run in study.planned if run.place["scenario"] == "double"]
    assert lead_curves(study, runs) is None
    for run in runs[:2]:
        job = RunAttention.of(study, run)
        if job is not None:
            job.do(lambda _: None)
    curves = lead_curves(study, runs)
    assert curves is not None
    assert curves.runs == 1
    worlds = runs[0].config.scenario.replace(episode_steps=50)
    record, _ = play_failures(AttendingScript(worlds), worlds, 25, 6, 12345)
    for who, curve in (("robot", curves.robot), ("bystander", curves.bystander)):
        each = handoff_leads(record)[who]
        assert curves.handoffs == len(each)
        for place in range(len(OFFSETS)):
            own = [lead for lead in each[:, place] if not np.isnan(lead)]
            assert curve.mean[place] == pytest.approx(np.mean(own))
    (panel,) = draw_leads({"double": curves}).axes
    assert panel.get_title().startswith("double\n1 run")
    np.testing.assert_allclose(panel.lines[0].get_ydata(), curves.robot.mean)


def test_two_measures_of_the_same_runs_are_compared(study: StudyFolder) -> None:
    rng = np.random.default_rng(4)
    results = [
        Result(run, {}, None, {"actor_lead_before": x, "actor_lead_before_bystander": y})
        for run, (x, y) in zip(study.planned, rng.normal(size=(16, 2)).tolist(), strict=True)
    ]
    found = compare(study.study, study.planned, results)
    assert [one.a["scenario"] for one in found] == ["double", "mixed"]
    plain = []
    for one in found:
        own = [r.measured for r in results if r.run.place == one.a]
        pairs = [(r["actor_lead_before"], r["actor_lead_before_bystander"]) for r in own]
        plain.append(contrast(pairs, (1.0, -1.0), 0.05))
        assert one.mean == pytest.approx(np.mean([x - y for x, y in pairs]))
        assert one.seeds == (0, 1, 2, 3)
    np.testing.assert_allclose([one.holm_p for one in found], holm([one.p for one in plain]))
    text = contrasts_tables(found)
    assert "**Difference of two measures**; within 0.05 is alike." in text
    assert "| before | lead before - lead before bystander (mixed) | 0 to 3 |" in text


def test_a_damaged_file_is_named(study: StudyFolder) -> None:
    job = RunAttention.of(study, study.planned[0])
    assert job is not None
    job.do(lambda _: None)
    document = json.loads(job.path.read_text())
    document["leads"]["robot"] = [0.0]
    job.path.write_text(json.dumps(document))
    with pytest.raises(RunError, match="not a measurement of attention in the actor; remove it"):
        lead_curves(study, [job.run])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[actor_attention]", "actor_attention: must stand beside network.encoder = 'entities'"),
        ("[actor_attention]\nepisodes = 1", "actor_attention.episodes"),
        (
            "[[tables]]\ntitle = 'a'\nmeasures = ['actor_lead_before']",
            "it needs [actor_attention]",
        ),
        (
            "[grid]\nseeds = [0, 1]\nmethods = ['ppo-inner']\nnetwork.encoder = ['entities']\n"
            "[actor_attention]\n[[tables]]\ntitle = 'a'\nmeasures = ['actor_handoffs, long']",
            "has no value of long episodes",
        ),
        (
            "[[contrasts]]\nname = 'a'\na = { method = 'ppo-inner' }\n"
            "b = { method = 'ppo-inner' }\nmeasure_b = 'score'\nmargin = 0.1",
            "contrasts.measure_b = 'score': must be another measure",
        ),
        (
            "[[contrasts]]\nname = 'a'\na = { method = 'ppo-inner' }\n"
            "b = { method = 'ppo-inner' }\nmeasure_b = 'scores'\nmargin = 0.1",
            "measure_b = 'scores': must be one of score",
        ),
        (
            "[actor_attention]\n[search]\nppo.epochs = [1, 2]",
            "search: must stand without actor_attention",
        ),
    ],
)
def test_bad_files_are_refused_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        plan_study(study_in(text.encode(), "study.toml"), tmp_path.joinpath)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
