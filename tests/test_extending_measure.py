"""The page on adding a measure: its code runs as it stands, and the measure appears everywhere."""

import re
import sys
import types
from collections.abc import Iterator
from pathlib import Path

import pytest

from innerattn.config import EvaluateConfig, Scenario
from innerattn.errors import ConfigError
from innerattn.evaluate import evaluate_policy, scripted_policy
from innerattn.experiments.paper.competence import competence_units
from innerattn.measures import MEASURES, measure_of
from innerattn.stats.estimate import as_json
from innerattn.studies.plan import plan_study
from innerattn.studies.study import study_in

PAGE = Path(__file__).parents[1] / "docs" / "extending" / "measure.md"


def run(code: str, module: types.ModuleType) -> None:
    exec(compile(code, str(PAGE), "exec"), module.__dict__)


@pytest.fixture
def blocks(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[types.ModuleType, str, str]]:
    """The page's module, its registration, which is taken back afterwards, and its test."""
    measure, registration, test = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.S)
    own = types.ModuleType("innerattn.measures.travel")
    monkeypatch.setitem(sys.modules, own.__name__, own)
    run(measure, own)
    known = dict(MEASURES)
    yield own, registration, test
    MEASURES.clear()
    MEASURES.update(known)


@pytest.fixture
def travel(blocks: tuple[types.ModuleType, str, str]) -> types.ModuleType:
    """The page's module, registered."""
    own, registration, _ = blocks
    run(registration, types.ModuleType("program"))
    return own


def test_the_test_of_the_page_passes(blocks: tuple[types.ModuleType, str, str]) -> None:
    tests = types.ModuleType("test_travel")
    run(blocks[2], tests)
    names = [name for name in vars(tests) if name.startswith("test_")]
    assert names == ["test_travel_against_a_plain_loop"]
    for name in names:
        getattr(tests, name)()


def test_the_measure_is_stored_and_shown(travel: types.ModuleType) -> None:
    scenario = Scenario.preset("single")
    settings = EvaluateConfig(
        episodes=6, score_episodes=8, long_episodes=2, long_episode_steps=30, seed=5
    )
    evaluation = evaluate_policy(scripted_policy("greedy", scenario), scenario, settings)
    document = evaluation.summary.to_json()
    name = travel.TRAVEL_PER_RESCUE.name
    for policy in ("greedy", "random", "hungarian"):
        assert name in document["measures"][policy]
        assert name in document["long"]["measures"][policy]
    recorded = evaluation.records[0]
    assert recorded.policy == "greedy"
    assert document["measures"]["greedy"][name] == as_json(measure_of(name, recorded))
    assert document["measures"]["hungarian"][name]["mean"] > 0.0
    assert competence_units()[name] == "m"


def test_a_study_asks_for_the_measure(request: pytest.FixtureRequest) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.S)
    study = study_in(text.encode(), "travel.toml")
    with pytest.raises(ConfigError, match="measure = 'travel_per_rescue_m': must be one of score"):
        plan_study(study, Path)
    request.getfixturevalue("travel")
    assert len(plan_study(study, Path)) == 10
