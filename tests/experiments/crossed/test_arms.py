"""The arms of the crossed design are what they say."""

from itertools import product

from small_study import planned_of

from innerattn.experiments.crossed.arms import ARMS, Arm, arm_of

METHODS = ("td-inner", "td-uniform")


def test_all_combinations_are_planned_and_are_what_they_say() -> None:
    runs = planned_of("crossed", METHODS, ("single", "mixed"), 2, "quick")
    assert len({one.key for one in runs}) == len(runs) == 2 * 2 * 9
    found = set()
    for one in runs:
        config, arm = one.config, arm_of(one.case)
        assert config.scenario.situation == one.case.worlds
        assert (config.train.method, config.train.seed) == (one.case.method, one.case.seed)
        assert config.network.attention == one.case.method.removeprefix("td-")
        assert config.scenario.rescue_credit == arm.credit
        if arm.penalty is not None:
            assert config.td.attention_logit_penalty == arm.penalty
        assert config.network.parameter_sharing == ("kind" if arm.shared else "none")
        found.add((one.case.worlds, one.case.seed, arm))
    assert found == set(product(("single", "mixed"), range(2), ARMS))
    assert [arm for arm in ARMS if arm.shared] == [Arm("team", 0.0, shared=True)]
    inner = {(arm.credit, arm.penalty) for arm in ARMS if arm.method == "td-inner"}
    assert inner == set(product(("helpers", "team"), (0.0, 1e-4, 1e-3)))
    alone = planned_of("crossed", ("td-uniform",), ("single",))
    assert [one.case.variant for one in alone] == ["helpers", "team"]
