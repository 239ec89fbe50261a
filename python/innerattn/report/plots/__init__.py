"""Plots: drawn from what was measured; they measure nothing."""
