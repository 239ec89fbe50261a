"""Scripted policies: written by hand from the true state of the worlds; they learn nothing."""
