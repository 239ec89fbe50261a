"""A trained run as a policy: who sees what, where somebody reaches into the worlds."""

from contextlib import closing

import numpy as np

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate.trained import load_trained
from innerattn.policies import PolicyInput


def test_where_each_sees_a_blind_robot_is_blind_alone() -> None:
    """No fault of the scenario says that a sense may fail."""
    scenario = Scenario.preset("mixed")
    shared, own = (load_trained("zoo:any", scenario, each_sees=one)[1] for one in (False, True))
    with closing(BatchEnv(scenario, 64, seed=2, num_threads=1)) as env:
        obs = env.reset()
    seen = own.act(PolicyInput(obs))
    assert (seen == shared.act(PolicyInput(obs))).mean() > 0.99
    blind = obs.copy()
    blind[:, 0] = 0.0
    found = own.act(PolicyInput(blind))
    np.testing.assert_array_equal(found[:, 1:], seen[:, 1:])
    assert (found[:, 0] != seen[:, 0]).any()
    assert (shared.act(PolicyInput(blind))[:, 1:] != seen[:, 1:]).any()
