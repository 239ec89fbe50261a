"""Moments of a replay that somebody chose: when, whose attention to look at, and what to see there.

A moment is a part of an address, as in ``replay.html#episode=3&step=17``, with a text.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar, Literal
from urllib.parse import urlencode

from pydantic import Field, ValidationError

from innerattn.config.files import toml_table
from innerattn.config.model import Model, config_error
from innerattn.errors import ConfigError
from innerattn.records.record import Record

Whose = Literal["critic", "actor"]
ATTENTION_OF: dict[Whose, str] = {"critic": "attention", "actor": "actor_attention"}
"""The recorded field that has the attention of each."""


class _Moment(Model):
    """A moment as a file has it."""

    place: ClassVar[str] = "moments"

    text: str = Field(min_length=1, max_length=400)
    policy: str | None = None
    episode: int
    step: int
    robot: str | None = None
    attention: Whose | None = None
    head: int | None = None
    arrows: Literal["from", "to", "all"] | None = None

    def address(self) -> str:
        """The part of an address behind ``#``."""
        named = self.model_dump(exclude={"text"}, exclude_none=True)
        return urlencode(named)


class _Moments(Model):
    moments: tuple[_Moment, ...] = Field(min_length=1, max_length=100)


def read_moments(
    path: str | Path, records: Sequence[Record], names: Sequence[str]
) -> list[dict[str, str]]:
    """Moments of a TOML file, as a page lists them.

    Args:
        path: the file: a list of tables ``[[moments]]`` with the keys text, policy (the first, if
            it is left out), episode, step (from 1 on), robot, attention ("critic" or "actor"; the
            first that was recorded), head (from 1 on; the mean), and arrows ("from" or "to" the
            robot, or "all").
        records: of the policies.
        names: what each is called.

    Returns:
        A text and an address for each.

    Raises:
        ConfigError: the file cannot be read, or a moment is not in the records.
    """
    try:
        found = _Moments.model_validate(toml_table(path)).moments
    except ValidationError as error:
        raise config_error(error, source=str(path), model=_Moments) from error
    listed = []
    for number, moment in enumerate(found):
        try:
            if moment.policy is not None and moment.policy not in names:
                known = ", ".join(names)
                raise ValueError(f"policy = {moment.policy!r}: must be one of {known}")
            policy = moment.policy or names[0]
            record = records[list(names).index(policy)]
            _refuse_what_is_not_there(moment, record)
        except ValueError as error:
            raise ConfigError(f"{path}: moments[{number}].{error}") from error
        whose = moment.attention or next(iter(_attending(record)), None)
        whole = moment.model_copy(update={"policy": policy, "attention": whose})
        listed.append({"text": moment.text, "address": whole.address()})
    return listed


def _attending(record: Record) -> list[Whose]:
    """Whose attention was recorded: the critic's, the actor's, both or none."""
    return [one for one, field in ATTENTION_OF.items() if field in record.steps]


def _refuse_what_is_not_there(moment: _Moment, record: Record) -> None:
    first, last = record.first_episode, record.first_episode + record.num_episodes - 1
    if not first <= moment.episode <= last:
        raise ValueError(f"episode = {moment.episode}: must be {first} to {last}")
    steps = int(record.lengths[moment.episode - first])
    if not 1 <= moment.step <= steps:
        raise ValueError(f"step = {moment.step}: must be 1 to {steps}")
    if moment.robot is not None and moment.robot not in record.robot_names:
        known = ", ".join(record.robot_names)
        raise ValueError(f"robot = {moment.robot!r}: must be one of {known}")
    whose = _attending(record)
    if moment.attention is not None and moment.attention not in whose:
        raise ValueError(f"attention = {moment.attention!r}: was not recorded")
    if moment.head is not None:
        if not whose:
            raise ValueError(f"head = {moment.head}: no attention was recorded")
        heads = record.steps[ATTENTION_OF[moment.attention or whose[0]]].shape[2]
        if not 1 <= moment.head <= heads:
            raise ValueError(f"head = {moment.head}: must be 1 to {heads}")
