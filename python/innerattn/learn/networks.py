"""The networks that a configuration asks for, with initial parameters."""

from __future__ import annotations

from collections.abc import Callable
from pkgutil import resolve_name
from typing import Any

import torch
from torch import nn

from innerattn.config import NetworkConfig
from innerattn.config.registry import attentions
from innerattn.learn.types import Team
from innerattn.nn import (
    Actor,
    CentralCritic,
    Critic,
    EntityColumns,
    Hearing,
    JointCritic,
    ListeningActor,
    MaskedActor,
    Memory,
    Messages,
    OracleAttention,
    PartnerColumns,
    RememberingActor,
    RememberingCritic,
    TeammateAttention,
    VectorCritic,
    share_by_kind,
    swap_robots,
)

AnyActor = Actor | RememberingActor | ListeningActor
"""The policies of all robots, with or without a memory and messages."""
DrawNetworks = Callable[[Team, NetworkConfig, torch.Generator], tuple[AnyActor, nn.Module]]
"""Makes an actor and a critic, which gives a `CriticOutput` as `Critic.forward` does."""


def draw_networks(
    team: Team,
    network: NetworkConfig,
    generator: torch.Generator,
    critic_outputs: int | None = None,
) -> tuple[AnyActor, nn.Module]:
    """Actors and critics with initial parameters, float32 on the CPU.

    They have a memory, and actors have messages, if that is asked for.

    A critic without attention takes whole observations and shares nothing between robots: its input
    is the same for all.

    Args:
        team: What is known of the team.
        network: Sizes and kind of the networks.
        generator: Source of the parameters, on the CPU.
        critic_outputs: Values that the critic gives for each robot; None: one for each action, of
            which there must be a number.

    Raises:
        ValueError: `network.encoder` is "entities" and `team.entities` are not the columns of an
            observation, or lack the places that `network.pooling` = "nearest" needs, or
            `network.parameter_sharing` is "kind" and `team.kinds` are not those of
            the team, or `network.attention` is "oracle" and `team.partners` is missing, or
            `network.message_width` is not 0 and `team.hearing` is missing, or
            `network.mask_actions` is set and `team.able` is missing.
    """
    entities = _entities(team) if network.encoder == "entities" else None
    kinds = _kinds(team) if network.parameter_sharing == "kind" else None
    robots, obs_width, num_actions, *_ = team
    width, remembered, heard = network.hidden_width, network.memory_width, network.message_width
    pooling = network.pooling
    sizes = robots, obs_width, team.actions.outputs, width
    actor: AnyActor
    if network.attention == "none":
        actor = _actor(team, network, *sizes, generator, entities, heard + remembered, pooling)
        outputs = critic_outputs or num_actions
        joint = CentralCritic if network.joint_critic == "central" else JointCritic
        critic: nn.Module = joint(robots, obs_width + remembered, outputs, width, generator)
    else:
        kind: type[TeammateAttention] = resolve_name(attentions()[network.attention])
        attention = kind(width, network.attention_heads, generator)
        if isinstance(attention, OracleAttention):
            attention.partners = _partners(team)
        actor = _actor(team, network, *sizes, generator, entities, heard + remembered, pooling)
        form = VectorCritic if team.action_width else Critic
        inputs = team.action_width or num_actions
        critic = form(
            robots,
            obs_width,
            inputs,
            attention,
            generator,
            critic_outputs,
            entities,
            remembered,
            pooling,
        )
        if kinds is not None:
            share_by_kind(critic, kinds)
    if kinds is not None:
        share_by_kind(actor, kinds)
    if remembered:
        read = obs_width + heard, obs_width  # actors remember what they heard, too
        memories = [Memory(robots, seen, remembered, generator) for seen in read]
        if kinds is not None:
            for memory in memories:
                share_by_kind(memory, kinds)
        actor = RememberingActor(memories[0], actor)
        critic = RememberingCritic(memories[1], critic)
    if heard:
        messages = Messages(
            robots,
            obs_width,
            width,
            heard,
            network.message_pooling,
            _hearing(team),
            generator,
            turns=network.symmetry != "none",
            entities=entities,
            entity_pooling=pooling,
        )
        if kinds is not None:
            share_by_kind(messages, kinds)
        actor = ListeningActor(messages, actor)
    if team.swapped is not None:
        for net in (actor, critic):
            swap_robots(net, *team.swapped)
    return actor, critic


def _actor(team: Team, network: NetworkConfig, *given: Any) -> Actor:
    """The policies of all robots; ``given`` are the arguments of `Actor`."""
    if not network.mask_actions:
        return Actor(*given)
    if not team.able:
        raise ValueError("able = (): network.mask_actions needs the columns that tell who can act")
    actor = MaskedActor(*given)
    actor.able = team.able
    return actor


def _entities(team: Team) -> EntityColumns:
    if team.entities is None or team.entities.width != team.obs_width:
        raise ValueError(
            f"entities = {team.entities}: network.encoder = 'entities' needs the "
            f"{team.obs_width} columns of an observation"
        )
    return team.entities


def _partners(team: Team) -> PartnerColumns:
    if team.partners is None:
        raise ValueError(
            "partners = None: network.attention = 'oracle' needs the columns that tell who can help"
        )
    return team.partners


def _hearing(team: Team) -> Hearing:
    if team.hearing is None:
        raise ValueError(
            "hearing = None: network.message_width needs the columns that tell whom a robot hears"
        )
    return team.hearing


def _kinds(team: Team) -> tuple[str, ...]:
    if team.kinds is None or len(team.kinds) != team.num_robots:
        raise ValueError(
            f"kinds = {team.kinds}: network.parameter_sharing = 'kind' needs those of "
            f"{team.num_robots} robots"
        )
    return team.kinds
