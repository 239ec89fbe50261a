"""The networks of the learners: per-robot actors, critics with and without attention.

Tensors have robots first, (R, B, ...), so that every layer is one batched product over the robots.
It knows nothing of environments, losses or files.
"""

from innerattn.nn.actor import Actor, action_noise, sample_actions
from innerattn.nn.attention import (
    Attended,
    InnerAttention,
    TeammateAttention,
    UniformAttention,
)
from innerattn.nn.critic import Critic, CriticOutput
from innerattn.nn.encoder import EntityColumns, EntityEncoder
from innerattn.nn.joint_critic import JointCritic
from innerattn.nn.linear import PerRobotLinear
from innerattn.nn.sharing import share_by_kind

__all__ = [
    "Actor",
    "Attended",
    "Critic",
    "CriticOutput",
    "EntityColumns",
    "EntityEncoder",
    "InnerAttention",
    "JointCritic",
    "PerRobotLinear",
    "TeammateAttention",
    "UniformAttention",
    "action_noise",
    "sample_actions",
    "share_by_kind",
]
