"""Policies that need no learner: what a policy sees and gives, scripts, and exported teams."""

from innerattn.policies.exported import Decision, Exported
from innerattn.policies.policy import Policy, PolicyInput, WorldState
from innerattn.policies.scripted.dispatch import SCRIPTED, scripted_policy

__all__ = [
    "SCRIPTED",
    "Decision",
    "Exported",
    "Policy",
    "PolicyInput",
    "WorldState",
    "scripted_policy",
]
