"""The methods and situations in which learnt attention is compared."""

LEARNT = "ppo-inner"
METHODS = (LEARNT, "ppo-uniform", "mappo", "ppo-frozen", "ppo-oracle")
"""Learnt attention, what it is compared with, and the two ends of the scale."""
SITUATIONS = ("mixed", "mixed-8", "mixed-16")
"""Worlds with 4, 8 and 16 robots."""
