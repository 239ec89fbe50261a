"""Trainings in the browser while they go on, on this machine alone."""
