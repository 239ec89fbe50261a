"""The networks of the learners: per-robot actors and critics with attention over teammates.

Tensors have robots first, (R, B, ...), so that every layer is one batched product over the robots.
It knows nothing of environments, losses or files.
"""

from innerattn.nn.actor import Actor, action_noise, sample_actions
from innerattn.nn.attention import Attended, InnerAttention, UniformAttention
from innerattn.nn.critic import Critic, CriticOutput
from innerattn.nn.linear import PerRobotLinear

__all__ = [
    "Actor",
    "Attended",
    "Critic",
    "CriticOutput",
    "InnerAttention",
    "PerRobotLinear",
    "UniformAttention",
    "action_noise",
    "sample_actions",
]
