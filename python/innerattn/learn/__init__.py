"""Learners: they act, store transitions and improve. They know no environment and no file."""

from innerattn.learn.ppo import PPO
from innerattn.learn.replay import Replay
from innerattn.learn.td import TD
from innerattn.learn.types import Learner, Team, Transitions

__all__ = ["PPO", "TD", "Learner", "Replay", "Team", "Transitions"]
