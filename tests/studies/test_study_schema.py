"""The schema of a study's file, and the file that `innerattn new study` writes."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from jsonschema import Draft202012Validator
from tiny_study import TINY

from innerattn.cli.main import main
from innerattn.studies.new_study import new_study
from innerattn.studies.plan import plan_study
from innerattn.studies.schema import COPY, study_schema_text
from innerattn.studies.shown import Report, ReportPage, StudyTable
from innerattn.studies.space import Search
from innerattn.studies.study import (
    ActorAttention,
    Faults,
    Study,
    StudyContrast,
    UnseenTeams,
    study_in,
)


@pytest.fixture(scope="module")
def validator() -> Draft202012Validator:
    schema = json.loads(COPY.read_text("utf-8"))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def test_the_copy_is_what_the_models_give() -> None:
    assert COPY.read_text("utf-8") == study_schema_text(), "make schemas writes it"


@pytest.mark.parametrize(
    "text",
    [
        TINY,
        new_study("mine", "mine.toml"),
        "[grid]\nppo.learning_rate = [0.001]\ntrain.schedule.gamma = [{first = 0.9, last = 0.99}]",
        "[grid]\nseeds = [1, 2]",
        "[search]\nppo.gamma = {low = 0.9, high = 0.99}\nnetwork.encoder = ['flat', 'entities']",
        "[faults]\nkinds = ['blackout']",
        "[grid]\nmethods = ['team-max']\n[unseen_teams]\nepisodes = 10",
    ],
)
def test_studies_are_valid(text: str, validator: Draft202012Validator) -> None:
    validator.validate(tomllib.loads(text))


@pytest.mark.parametrize(
    "document",
    [
        {"grids": {}},
        {"grid": {"ppo": {"learning_rate": 0.001}}},
        {"grid": {"ppo": {"learning_rat": [0.001]}}},
        {"grid": {"ppo": {"learning_rate": []}}},
        {"grid": {"sead": [1]}},
        {"variants": [{"name": "a b"}]},
        {"variants": [{"name": "a", "ppo": {"gama": 0.9}}]},
        {"contrasts": [{"name": "a", "a": {}, "b": {"method": "mappo"}, "margin": 0.1}]},
        {"contrasts": [{"name": "a", "margin": -1.0}]},
        {"search": {"ppo": {"gama": {"low": 0.9, "high": 0.99}}}},
        {"search": {"ppo": {"gamma": 0.9}}},
        {"search": {"ppo": {"gamma": {"low": 0.9}}}},
        {"search": {"network": {"encoder": {"low": 0.9, "high": 0.99}}}},
        {"faults": {"episodes": 1}},
    ],
)
def test_what_is_wrong_is_refused(document: dict[str, Any], validator: Any) -> None:
    assert not validator.is_valid(document)


def test_the_new_file_is_a_study_and_names_every_key(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    validator: Draft202012Validator,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "study", "sharing"]) == 0
    out = capsys.readouterr().out
    assert "innerattn study run sharing.toml" in out
    text = Path("sharing.toml").read_text()
    study = study_in(text.encode(), "sharing.toml")
    assert len(plan_study(study, Path)) == 10
    given = tomllib.loads(re.sub(r"^#(?=\S)", "", text, flags=re.MULTILINE))
    assert given.keys() == Study.model_fields.keys()
    assert given["contrasts"][0].keys() == StudyContrast.model_fields.keys()
    assert given["tables"][0].keys() == StudyTable.model_fields.keys()
    assert given["faults"].keys() == Faults.model_fields.keys()
    assert given["unseen_teams"].keys() == UnseenTeams.model_fields.keys()
    assert given["actor_attention"].keys() == ActorAttention.model_fields.keys()
    assert given["report"].keys() == Report.model_fields.keys()
    assert given["report"]["pages"][0].keys() <= ReportPage.model_fields.keys()
    assert given["search"].keys() == Search.model_fields.keys() | {"ppo"}
    assert validator.is_valid(given)
    del given["search"]  # it stands without the other parts
    del given["unseen_teams"], given["actor_attention"]  # its runs are for one team, and plain
    examples = study_in(tomli_w.dumps(given).encode(), "all.toml")
    assert len(plan_study(examples, Path)) == 20
    assert main(["new", "study", "sharing"]) == 1
    assert "is there already; nothing was written" in capsys.readouterr().err


def test_info_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "--schema", "study"]) == 0
    assert capsys.readouterr().out == study_schema_text()
