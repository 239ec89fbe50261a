"""A policy for one team as numbers that a page computes with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from innerattn.errors import RunError
from innerattn.policies.exported.network import layer_shapes
from innerattn.policies.plain_team import LOG_STD, PUSHES, PlainTeam
from innerattn.report.page.weights import Weights

_LOOKING = ("inner", "frozen")
"""Attentions whose weights depend on what robots see."""
Shapes = dict[str, tuple[int, ...]]


def one_team_document(team: PlainTeam, run: str | Path) -> tuple[dict[str, Any], Weights]:
    """What the page's `Team` takes, as JSON, and its weights.

    Args:
        team: what the run folder holds.
        run: its name, for messages.

    Raises:
        RunError: its weights are not those of such a policy.
    """
    network, weights = team.config.network, Weights()
    has_critic = any(name.startswith("critic.state_encoder.") for name in team.tensors)
    attention = network.attention if has_critic else "none"
    for name, shape in _shapes(team, looks=attention in _LOOKING).items():
        found = team.tensors.get(name)
        if found is None or found.shape != shape:
            has = "none" if found is None else f"shape {found.shape}"
            raise RunError(
                f"{run}: a page cannot play it: its weights: {name} has {has}, must have {shape}"
            )
        weights.add(name, found)
    entities = team.network.entities
    return {
        "width": len(team.columns),
        "actions": len(PUSHES),
        "continuous": team.continuous,
        "logStd": asdict(LOG_STD) if team.continuous else None,
        "rows": list(team.groups),
        "greedy": team.config.evaluate.greedy_actions,
        "able": list(team.able),
        "entities": None if entities is None else asdict(entities),
        "pooling": network.pooling,
        "hearing": _hearing(team) if network.message_width else None,
        "heads": network.attention_heads if attention in (*_LOOKING, "uniform") else 0,
        "uniform": attention == "uniform",
        "available": team.columns.index("own.available") if network.mask_unavailable else -1,
        "frame": _tables(team),
    }, weights


def _shapes(team: PlainTeam, looks: bool) -> Shapes:
    """Names and shapes of the arrays that a page needs.

    Args:
        team: whose.
        looks: whether the weights of its critic's attention are computed, too.
    """
    network = team.config.network
    width, hidden, robots = len(team.columns), network.hidden_width, max(team.groups) + 1
    heard, remembered = network.message_width, network.memory_width

    def linear(name: str, inputs: int, outputs: int) -> Shapes:
        shape = (robots, outputs, inputs)
        return {f"{name}.weight": shape, f"{name}.bias": shape[:2]}

    def encoder(name: str, more: int) -> Shapes:
        found: Shapes = {}
        for layer, (outputs, inputs) in _encoder_layers(team, more):
            found |= linear(f"{name}{layer}", inputs, outputs)
        return found

    def memory(name: str, inputs: int) -> Shapes:
        if not remembered:
            return {}
        read = linear(f"{name}.of_input", inputs, 3 * remembered)
        return read | linear(f"{name}.of_past", remembered, 3 * remembered)

    found = encoder("actor.first", heard + remembered)
    found |= linear("actor.second", hidden, hidden)
    found |= linear("actor.output", hidden, team.outputs)
    found |= memory("actor.memory", width + heard)
    if heard:
        found |= encoder("actor.messages.encoder", 0)
        found |= linear("actor.messages.output", hidden, heard)
        if network.message_pooling == "attention":
            found |= linear("actor.messages.query", hidden, heard)
    if looks:
        found |= encoder("critic.state_encoder", remembered)
        taken = 2 if team.continuous else len(PUSHES)
        found |= encoder("critic.action_encoder", remembered + taken)
        found |= memory("critic.memory", width)
        found |= {f"critic.attention.{one}": (hidden, hidden) for one in ("query", "key")}
    return found


def _encoder_layers(team: PlainTeam, more: int) -> Iterator[tuple[str, tuple[int, int]]]:
    """Ends of the names and shapes of an encoder's layers, with so many columns behind a row."""
    network, first = team.network, "first"
    if network.entities is not None:  # they belong to the robot itself
        own = network.entities.own + more
        network = replace(network, entities=replace(network.entities, own=own))
    for name, shape in layer_shapes(network, len(team.columns) + more, 1).items():
        if name.startswith(first):
            yield name.removeprefix(first), shape


def _hearing(team: PlainTeam) -> dict[str, Any]:
    """How rows say whom a robot hears, as `innerattn.train.columns.hearing` does."""
    place = {name: column for column, name in enumerate(team.columns)}
    mates = range(team.config.scenario.num_robots - 1)

    def columns(quantity: str) -> list[int]:
        names = (f"teammate_{mate}.{quantity}" for mate in mates)
        return [place[name] for name in names if name in place]

    seen, heard = columns("seen"), columns("heard")
    axes = (columns(f"relative_position.{axis}") for axis in "xy")
    return {
        "sends": place["own.available"],
        "heard": heard or ([] if seen else columns("available")),
        "places": [list(one) for one in zip(*axes, strict=True)],
        "seen": seen,
        "delay": team.config.scenario.message_delay_steps,
        "pooling": team.config.network.message_pooling,
    }


def _tables(team: PlainTeam) -> dict[str, Any] | None:
    """The tables of the frames that robots see and act in; None where they see the world as it is.

    ``names`` and ``mirrors`` are by robot: what each output of a policy is called in a frame, and
    its sign there.
    """
    drives: Sequence[str] = [robot.drive for robot in team.config.scenario.robots]
    frames = [team.frame_of(drive) for drive in drives]
    first = frames[0]
    if first is None:
        return None
    known = [frame for frame in frames if frame is not None]
    names = [one.outputs if one.forward is None else one.forward for one in known]
    return {
        "signs": first.signs.astype(int).tolist(),
        "order": first.order.tolist(),
        "x": first.x.tolist(),
        "y": first.y.tolist(),
        "names": [one.tolist() for one in names],
        "mirrors": [one.mirrors.tolist() for one in known] if team.continuous else None,
    }
