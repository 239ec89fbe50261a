"""The networks of a learner: which kinds a configuration asks for, with fresh parameters."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from innerattn.config.run import NetworkConfig
from innerattn.learn.types import Team
from innerattn.nn import (
    Actor,
    Critic,
    EntityColumns,
    InnerAttention,
    JointCritic,
    UniformAttention,
    share_by_kind,
)

_ATTENTIONS: dict[str, type[InnerAttention] | type[UniformAttention]] = {
    "inner": InnerAttention,
    "uniform": UniformAttention,
}


def draw_networks(
    team: Team,
    network: NetworkConfig,
    generator: torch.Generator,
    critic_outputs: int | None,
    entities: EntityColumns | None,
    kinds: Sequence[str] | None = None,
) -> tuple[Actor, Critic | JointCritic]:
    """Actors and critics with initial parameters, float32 on the CPU.

    Args:
        team: Sizes of the team.
        network: Sizes and kind of the networks.
        generator: Source of the parameters, on the CPU.
        critic_outputs: Values that the critic gives for each robot; None: one for each action.
        entities: To whom the columns of an observation belong; heeded only where `network.encoder`
            is "entities". The critic without attention takes observations as they are.
        kinds: Kind of each robot, R words; heeded only where `network.parameter_sharing` is "kind".
            The critic without attention stays each robot's own: its input is the same for all.

    Raises:
        ValueError: `network.encoder` is "entities" and the columns are not those of an observation,
            or `network.parameter_sharing` is "kind" and ``kinds`` are not those of the team.
    """
    if network.encoder == "flat":
        entities = None
    elif entities is None or entities.width != team.obs_width:
        raise ValueError(
            f"entities = {entities}: network.encoder = 'entities' needs the "
            f"{team.obs_width} columns of an observation"
        )
    shared = network.parameter_sharing == "kind"
    if shared and (kinds is None or len(kinds) != team.num_robots):
        raise ValueError(
            f"kinds = {kinds}: network.parameter_sharing = 'kind' needs those of "
            f"{team.num_robots} robots"
        )
    width = network.hidden_width
    attention = None
    if network.attention != "none":
        attention = _ATTENTIONS[network.attention](width, network.attention_heads, generator)
    actor = Actor(*team, width, generator, entities)
    critic: Critic | JointCritic
    if attention is None:
        outputs = critic_outputs or team.num_actions
        critic = JointCritic(team.num_robots, team.obs_width, outputs, width, generator)
    else:
        critic = Critic(*team, attention, generator, critic_outputs, entities)
    if shared and kinds is not None:
        share_by_kind(actor, kinds)
        if attention is not None:
            share_by_kind(critic, kinds)
    return actor, critic
