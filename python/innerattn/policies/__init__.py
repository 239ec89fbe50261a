"""Policies that need no learner: what a policy sees and gives, and scripts."""

from innerattn.policies.policy import Policy, PolicyInput, WorldState
from innerattn.policies.scripted.dispatch import SCRIPTED, scripted_policy

__all__ = ["SCRIPTED", "Policy", "PolicyInput", "WorldState", "scripted_policy"]
