"""Estimates with their uncertainty: intervals, tests, clusters. It knows no robot and no file."""

from innerattn.stats.estimate import Estimate

__all__ = ["Estimate"]
