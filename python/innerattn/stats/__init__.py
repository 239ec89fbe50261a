"""Estimates with their uncertainty: intervals, tests, clusters. It knows no robot and no file."""
