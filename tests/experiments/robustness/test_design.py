"""Which runs meet which faults."""

from collections import Counter

from small_study import planned_of

from innerattn.envs.batch import FAULT_KINDS
from innerattn.experiments.plan import METHODS, Case
from innerattn.experiments.robustness.design import TEAMS, groups


def test_the_runs_of_the_study() -> None:
    planned = planned_of("robustness", METHODS, ("mixed",), 2)
    parts = Counter((one.case.worlds, one.case.variant) for one in planned)
    own = {("mixed", ""): 8, ("mixed-faults", ""): 2, ("mixed-faults", "masked"): 2}
    assert parts == own | {(name, "team"): 1 for name in TEAMS}
    assert len({one.key for one in planned}) == len(planned)
    by_case = {one.case: one.config for one in planned}
    for case, config in by_case.items():
        assert config.network.mask_unavailable == (case.variant == "masked")
        assert bool(config.scenario.faults) == (case.worlds == "mixed-faults")
        short = by_case[Case("mixed", "td-inner", 0)].train.env_steps
        assert (config.train.env_steps < short) == (case.variant == "team")
    teams = [by_case[Case(name, "td-inner", 0, "team")] for name in TEAMS]
    assert [team.scenario.num_robots for team in teams] == [3, 4, 6, 8, 16]


def test_groups_meet_the_same_faults_in_the_same_worlds() -> None:
    planned = planned_of("robustness", METHODS, ("mixed", "double"), 2)
    found = groups([one.case for one in planned])
    assert len({group.name for group in found}) == len(found) == 4 + 2 + 5
    worlds = {one.case: one.config.evaluate.seed for one in planned}
    for group in found:
        assert len({worlds[case] for case in group.cases}) == 1
        teams = group.part == "teams"
        assert group.kinds == (("unavailable",) if teams else FAULT_KINDS)
        assert group.episodes == (200 if teams else 100)
    assert {case for group in found for case in group.cases} == worlds.keys()
    (first,) = [group for group in found if group.name == "mixed-s1"]
    assert [case.method for case in first.cases] == list(METHODS)
    (faulty,) = [group for group in found if group.name == "trained-with-faults-s1"]
    assert faulty.cases == (
        Case("mixed-faults", "td-inner", 1),
        Case("mixed-faults", "td-inner", 1, "masked"),
        Case("mixed", "td-inner", 1),
    )


def test_without_the_trained_method_or_mixed_there_is_deployment_alone() -> None:
    for methods, situation in ((("ppo-inner",), "mixed"), (METHODS, "double")):
        planned = planned_of("robustness", methods, (situation,))
        assert [one.case for one in planned] == [Case(situation, m, 0) for m in methods]
        (group,) = groups([one.case for one in planned])
        assert group.part == "deployment"
