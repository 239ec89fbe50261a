"""Worlds with spare robots in which one policy acts."""

from functools import partial

from innerattn.config import Scenario
from innerattn.evaluate.interactive import InteractiveWorld, endless
from innerattn.evaluate.spares import with_spares
from innerattn.policies import SCRIPTS, Policy, scripted_policy
from innerattn.policies.scripted.crew import CrewPolicy

SEED = 12_345


def spared_world(own: Scenario, each: int, *names: str) -> InteractiveWorld:
    """A world with so many spare robots of each kind; policies are scripts or run folders."""
    worlds = endless(with_spares(own, each))
    policies: dict[str, Policy] = {}
    for name in names:
        if name in SCRIPTS:
            make = partial(scripted_policy, name, seed=SEED)
            policies[name] = CrewPolicy(make, worlds, own.num_robots) if each else make(worlds)
        else:
            from innerattn.evaluate.trained import load_trained

            policies[name.removeprefix("zoo:")] = load_trained(name, worlds, each_sees=True)[1]
    return InteractiveWorld(worlds, policies, SEED, own.num_robots)
