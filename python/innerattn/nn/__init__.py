"""The networks of the learners: actors, and critics with and without attention.

Robots are the first dimension of tensors, (R, B, ...), so that every layer is one batched matrix
product. Networks know no environment, no loss and no file.
"""

from innerattn.nn.actions import Actions, DiscreteActions, SquashedActions
from innerattn.nn.actor import Actor, MaskedActor, action_noise, sample_actions
from innerattn.nn.attention import (
    Attended,
    FrozenAttention,
    InnerAttention,
    MaxAttention,
    NoAttention,
    TeammateAttention,
    UniformAttention,
)
from innerattn.nn.critic import Critic, CriticOutput, VectorCritic
from innerattn.nn.encoder import EntityColumns, EntityEncoder, batch_last_in_memory
from innerattn.nn.joint_critic import CentralCritic, JointCritic
from innerattn.nn.linear import PerRobotLinear, swap_robots
from innerattn.nn.memory import Memory, Remembering, RememberingActor, RememberingCritic
from innerattn.nn.message import Hearing, ListeningActor, Messages
from innerattn.nn.partner import OracleAttention, PartnerColumns
from innerattn.nn.sharing import is_shared_by_kind, robots_of_each_kind, share_by_kind
from innerattn.nn.symmetry import NUM_ELEMENTS, SquareSymmetry, VectorColumns

__all__ = [
    "NUM_ELEMENTS",
    "Actions",
    "Actor",
    "Attended",
    "CentralCritic",
    "Critic",
    "CriticOutput",
    "DiscreteActions",
    "EntityColumns",
    "EntityEncoder",
    "FrozenAttention",
    "Hearing",
    "InnerAttention",
    "JointCritic",
    "ListeningActor",
    "MaskedActor",
    "MaxAttention",
    "Memory",
    "Messages",
    "NoAttention",
    "OracleAttention",
    "PartnerColumns",
    "PerRobotLinear",
    "Remembering",
    "RememberingActor",
    "RememberingCritic",
    "SquareSymmetry",
    "SquashedActions",
    "TeammateAttention",
    "UniformAttention",
    "VectorColumns",
    "VectorCritic",
    "action_noise",
    "batch_last_in_memory",
    "is_shared_by_kind",
    "robots_of_each_kind",
    "sample_actions",
    "share_by_kind",
    "swap_robots",
]
