"""The networks of a learner: which kinds a configuration asks for, with fresh parameters."""

from __future__ import annotations

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
) -> tuple[Actor, Critic | JointCritic]:
    """Actors and critics with initial parameters, float32 on the CPU.

    Args:
        team: Sizes of the team.
        network: Sizes and kind of the networks.
        generator: Source of the parameters, on the CPU.
        critic_outputs: Values that the critic gives for each robot; None: one for each action.
        entities: To whom the columns of an observation belong; heeded only where `network.encoder`
            is "entities". The critic without attention takes observations as they are.

    Raises:
        ValueError: `network.encoder` is "entities" and the columns are not those of an observation.
    """
    if network.encoder == "flat":
        entities = None
    elif entities is None or entities.width != team.obs_width:
        raise ValueError(
            f"entities = {entities}: network.encoder = 'entities' needs the "
            f"{team.obs_width} columns of an observation"
        )
    width = network.hidden_width
    attention = None
    if network.attention != "none":
        attention = _ATTENTIONS[network.attention](width, network.attention_heads, generator)
    actor = Actor(*team, width, generator, entities)
    if attention is not None:
        return actor, Critic(*team, attention, generator, critic_outputs, entities)
    outputs = critic_outputs or team.num_actions
    return actor, JointCritic(team.num_robots, team.obs_width, outputs, width, generator)
