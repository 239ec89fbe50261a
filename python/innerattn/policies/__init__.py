"""Policies that need no learner: what a policy sees and gives, scripts, and exported teams."""

from innerattn.policies.exported import Decision, Exported
from innerattn.policies.policy import Policy, PolicyInput, RememberingPolicy, WorldState
from innerattn.policies.scripted.dispatch import (
    SCRIPTED,
    SCRIPTS,
    best_script,
    scripted_policy,
    scripts_of,
)

__all__ = [
    "SCRIPTED",
    "SCRIPTS",
    "Decision",
    "Exported",
    "Policy",
    "PolicyInput",
    "RememberingPolicy",
    "WorldState",
    "best_script",
    "scripted_policy",
    "scripts_of",
]
