"""Scripted policies: written by hand from the true state of the worlds; they learn nothing."""

from innerattn.scripted.dispatch import SCRIPTED, scripted_policy
from innerattn.scripted.policy import Policy, View

__all__ = ["SCRIPTED", "Policy", "View", "scripted_policy"]
