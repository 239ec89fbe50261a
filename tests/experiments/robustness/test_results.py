"""What faults cost over seeds, against plain arithmetic on the documents."""

import json
from statistics import mean
from typing import Any

import pytest
from made_faults import made_document
from scipy import stats
from small_study import planned_of

from innerattn.config import Scenario
from innerattn.experiments.plan import METHODS
from innerattn.experiments.robustness.design import groups
from innerattn.experiments.robustness.results import Measured, Robustness, over_groups
from innerattn.stats import Estimate

pytestmark = pytest.mark.long

SEEN = ("heading_bias", "motor_gain")
SCRIPTS = ("greedy", "hungarian", "oracle")
Documents = dict[str, dict[str, Any]]


def made(seeds: range) -> tuple[Documents, list[Measured]]:
    planned = planned_of("robustness", METHODS, ("mixed",), len(seeds))
    documents, found = {}, []
    for number, group in enumerate(groups([one.case for one in planned])):
        name = group.cases[0].worlds if group.part == "teams" else "mixed"
        methods = [case.method for case in group.cases]
        document = made_document(methods, Scenario.preset(name), group.kinds, number)
        documents[group.name] = json.loads(json.dumps(document))
        found.append(Measured(group, documents[group.name]))
    return documents, found


@pytest.fixture(scope="module")
def study() -> tuple[Documents, Robustness]:
    documents, found = made(range(3))
    return documents, over_groups(found, SEEN)


def assert_over_seeds(found: Estimate | None, values: list[float]) -> None:
    interval = stats.ttest_1samp(values, 0.0).confidence_interval()
    assert found is not None
    expected = (mean(values), interval.low, interval.high)
    assert (found.mean, found.low, found.high) == pytest.approx(expected)
    assert found.runs == len(values)


def test_retention_of_every_policy(study: tuple[Documents, Robustness]) -> None:
    documents, found = study
    (deployment,) = found.deployments
    assert [one.name for one in deployment.policies] == [*METHODS, *SCRIPTS]
    for index, policy in enumerate(deployment.policies):
        own = [documents[f"mixed-s{seed}"]["policies"][index] for seed in range(3)]
        for kind in (*deployment.kinds, "all"):
            assert_over_seeds(policy.retention[kind], [x["by_kind"][kind]["mean"] for x in own])
            with_fault = [x["rescues_with_fault"][kind]["mean"] for x in own]
            assert_over_seeds(policy.rescues_with_fault[kind], with_fault)
        assert_over_seeds(policy.rescues, [x["rescues_per_episode"]["mean"] for x in own])
        for kind, part in policy.after_onset.items():
            each = [x["after_onset"][kind] for x in own]
            assert_over_seeds(part.early, [x["early"]["mean"] for x in each])
            assert_over_seeds(part.late, [x["late"]["mean"] for x in each])
            assert_over_seeds(part.change, [x["late_minus_early"]["mean"] for x in each])


def test_attentions_are_compared_seed_by_seed(study: tuple[Documents, Robustness]) -> None:
    documents, found = study
    (deployment,) = found.deployments
    assert list(deployment.differences) == ["td", "ppo"]
    for place, estimates in zip((0, 2), deployment.differences.values(), strict=True):
        for kind, estimate in estimates.items():
            values = [
                [one["by_kind"][kind]["mean"] for one in documents[f"mixed-s{seed}"]["policies"]]
                for seed in range(3)
            ]
            assert_over_seeds(estimate, [row[place] - row[place + 1] for row in values])


def test_a_single_seed_has_intervals_over_its_worlds() -> None:
    documents, found = made(range(1))
    (deployment,) = over_groups(found, SEEN).deployments
    expected = documents["mixed-s0"]["policies"][0]["by_kind"]["blackout"]
    estimate = deployment.policies[0].retention["blackout"]
    assert estimate is not None
    assert estimate.to_json() == expected
    assert deployment.differences["td"]["blackout"] is not None
    assert not deployment.differences["td"]["blackout"].bounded


def test_bounds_are_those_of_critics_with_inner_attention(
    study: tuple[Documents, Robustness],
) -> None:
    documents, found = study
    bounds = found.deployments[0].bounds
    assert bounds is not None
    each = [x for seed in range(3) for x in documents[f"mixed-s{seed}"]["bounds"].values()]
    inner = [one for one in each if one["attention"] == "inner"]
    assert (bounds.runs, bounds.critics) == (len(each), len(inner)) == (12, 6)
    checks = [c for one in inner for level in one["levels"] for c in level["checks"].values()]
    assert bounds.checks == sum(check["checks"] for check in checks)
    assert bounds.violations == sum(check["violations"] for check in checks)
    assert [level.direction for level in bounds.levels] == ["random"] * 2 + ["gradient"] * 2
    for index, level in enumerate(bounds.levels):
        same = [one["levels"][index] for one in inner]
        logit = [one["checks"]["logit"] for one in same]
        assert level.logit[0] == pytest.approx(mean(x["median_tightness"] for x in logit))
        assert level.logit[1] == max(x["largest_tightness"] for x in logit)
        weight = [one["checks"]["weight"] for one in same]
        assert level.weight[0] == pytest.approx(mean(x["median_change"] for x in weight))
        assert level.weight[1] == max(x["largest_change"] for x in weight)
        values = [one["teammates"] for one in same]
        assert level.values[0] == pytest.approx(mean(x["median"] for x in values))
        assert level.values[1] == max(x["largest"] for x in values)
        assert level.actor_flips == pytest.approx(mean(one["actor_flips"] for one in same))


def test_shifts_of_attention(study: tuple[Documents, Robustness]) -> None:
    documents, found = study
    (deployment,) = found.deployments
    assert list(deployment.attention) == ["td-inner", "ppo-inner"]
    for method, shifts in deployment.attention.items():
        name = f"run{METHODS.index(method)}-{method}"
        for index, kind in enumerate(deployment.kinds):
            own = [
                documents[f"mixed-s{seed}"]["attention"][name]["kinds"][index] for seed in range(3)
            ]
            assert [one["kind"] for one in own] == [kind] * 3
            assert_over_seeds(shifts[kind].effect, [x["effect"]["mean"]["mean"] for x in own])
            assert_over_seeds(shifts[kind].auc, [x["auc"]["mean"]["mean"] for x in own])
            each = [robot["effect"]["mean"]["mean"] for x in own for robot in x["robots"]]
            assert shifts[kind].by_robot == (min(each), max(each))


def test_training_with_faults_is_compared_with_training_without(
    study: tuple[Documents, Robustness],
) -> None:
    documents, found = study
    training = found.training
    assert training is not None
    assert training.kinds[: training.seen] == ("motor_gain", "heading_bias")
    assert sorted(training.kinds) == sorted(found.deployments[0].kinds)
    for kind in (*training.kinds, "all"):
        rows = [
            [
                one["by_kind"][kind]["mean"]
                for one in documents[f"trained-with-faults-s{seed}"]["policies"][:3]
            ]
            for seed in range(3)
        ]
        for place, policy in enumerate(training.policies):
            assert_over_seeds(policy.retention[kind], [row[place] for row in rows])
        assert_over_seeds(training.gain[kind], [row[0] - row[2] for row in rows])
        assert_over_seeds(training.mask[kind], [row[1] - row[0] for row in rows])


def test_teams_lose_one_robot_at_a_time(study: tuple[Documents, Robustness]) -> None:
    documents, found = study
    assert len(found.teams) == 5 * 3
    for team in found.teams:
        assert team.policy != "greedy"
        document = documents[f"team-{team.name}"]
        (policy,) = [x for x in document["policies"] if x["method"] == team.policy]
        assert list(team.robots) == document["robots"]
        for kind, value in team.retention.items():
            lost = [
                cell["retention"]["mean"]
                for cell in policy["cells"]
                if cell["robot"].startswith(kind)
                and (cell["severity"], cell["onset"]) == (1.0, "start")
            ]
            assert value == pytest.approx(mean(lost))


def test_without_rescues_there_is_no_retention() -> None:
    documents, found = made(range(1))
    document = documents["team-mixed"]
    for cell in document["policies"][0]["cells"]:
        cell["retention"] = None
    (place,) = [i for i, one in enumerate(found) if one.group.name == "team-mixed"]
    found[place] = Measured(found[place].group, document)
    teams = {(one.name, one.policy): one for one in over_groups(found, SEEN).teams}
    assert set(teams["mixed", "td-inner"].retention.values()) == {None}
    assert None not in teams["mixed", "hungarian"].retention.values()
