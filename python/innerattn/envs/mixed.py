"""`MixedBatchEnv`: worlds of several teams, of any sizes, stepped together as one batch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from sys import getrefcount
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from innerattn.config.scenario import Scenario
from innerattn.cores import usable_cores
from innerattn.envs.batch import BatchEnv, Step, whole_number
from innerattn.envs.entities import Entities, EntityLayout, joined_names
from innerattn.shown import Shown

_MOST_THREADS = 256
_MOST_KEPT = 4
"""Tables that are kept to be used again."""


class MixedStep(NamedTuple):
    """What one control step of B worlds with N robots in all gave."""

    entities: Entities
    """Of N robots: what they see now; in the next episode where one ended (autoreset)."""
    reward: NDArray[np.float32]
    """(N,): sum of the reward components."""
    terminated: NDArray[np.bool_]
    """(B,): the scenario's goal ended the episode."""
    truncated: NDArray[np.bool_]
    """(B,): time ended the episode."""
    steps: tuple[Step, ...]
    """The same of each batch, with rescues and the last observations of episodes."""


class MixedBatchEnv(Shown):
    """Worlds of several batches, each with a team and tasks of its own, stepped as one batch.

    The N robots of all worlds stand in one row: batch by batch, world by world, in the order of
    their team. Robots that a team does not have take no room there. What robots see is given by
    entity (`Entities`), since rows of unlike teams have unlike columns: tables have the columns
    of all batches, with zeros where a batch lacks one, and as many teammates and victims as
    the largest batch, with masks. Sight, communication and faults act on these as on rows.

    All that a `BatchEnv` does beside steps its `batches` do: faults, presence, snapshots. A world
    is the same as in a batch of its own, whatever the number of threads.

    Args:
        batches: one or more, all with discrete actions or all with continuous ones.
        num_threads: how many batches step at a time, 1 to 256; None: one for each core. Where it
            is above 1, let each batch step with one thread.

    Attributes:
        batches: as they were given.
        layout: names of the columns of `Entities`, and how many teammates and victims it has.
        num_envs: worlds B of all batches.
        num_robots: robots N of all worlds.
        world_of_robot: (N,) int64, in which world each robot is.
        batch_of_world: (B,) int64, of which batch each world is.
        num_threads: how many batches step at a time.

    Raises:
        TypeError: what is no `BatchEnv`.
        ValueError: no batch, one that is there twice, both kinds of actions, or a number of threads
            out of range.
    """

    def __init__(self, batches: Sequence[BatchEnv], num_threads: int | None = None) -> None:
        if num_threads is not None:
            num_threads = whole_number("num_threads", num_threads, 1, _MOST_THREADS)
        self._arrange(batches)
        most = num_threads or usable_cores()
        self.num_threads = min(most, len(self.batches))
        self._pool = ThreadPoolExecutor(self.num_threads) if self.num_threads > 1 else None

    @classmethod
    def of(
        cls,
        scenarios: Sequence[Scenario | str],
        num_envs: int,
        seed: int = 0,
        num_threads: int | None = None,
    ) -> Self:
        """The same number of worlds of each of several scenarios.

        Args:
            scenarios: each a `Scenario` or the name of a preset.
            num_envs: worlds of each.
            seed: of all worlds; world i of all has the random streams of world i of a `BatchEnv`.
            num_threads: see `MixedBatchEnv`.

        Raises:
            ConfigError, TypeError, ValueError: as of `BatchEnv` and `MixedBatchEnv`.
        """
        batches = [
            BatchEnv(scenario, num_envs, seed, num_threads=1, first_env=number * num_envs)
            for number, scenario in enumerate(scenarios)
        ]
        return cls(batches, num_threads)

    def _arrange(self, batches: Sequence[BatchEnv]) -> None:
        """Take batches, and find out where their worlds, robots and columns stand."""
        for number, batch in enumerate(batches):
            if not isinstance(batch, BatchEnv):
                raise TypeError(f"batches[{number}] = {batch!r}: must be a BatchEnv")
        if not batches:
            raise ValueError("batches = []: must hold one or more")
        if len({id(one) for one in batches}) < len(batches):
            raise ValueError("batches: one of them is there twice")
        if len({one.continuous for one in batches}) > 1:
            raise ValueError("batches: all must have discrete actions, or all continuous ones")
        layouts = [one.entity_layout for one in batches]
        self.layout = EntityLayout(
            own=joined_names([one.own for one in layouts]),
            teammate=joined_names([one.teammate for one in layouts]),
            victim=joined_names([one.victim for one in layouts]),
            teammates=max(one.teammates for one in layouts),
            victims=max(one.victims for one in layouts),
        )
        self.batches = tuple(batches)
        self.num_envs = sum(one.num_envs for one in batches)
        self.num_robots = sum(one.num_envs * one.num_robots for one in batches)
        robots = [one.num_robots for one in batches for _ in range(one.num_envs)]
        self.world_of_robot = np.repeat(np.arange(self.num_envs), robots)
        self.batch_of_world = np.repeat(np.arange(len(batches)), [one.num_envs for one in batches])
        self._layouts = layouts
        self._kept: list[Entities] = []
        self._columns = [
            tuple(
                _runs(getattr(one, who), getattr(self.layout, who))
                for who in ("own", "teammate", "victim")
            )
            for one in layouts
        ]

    def reset(self, seed: int | None = None) -> Entities:
        """Start new episodes in all worlds; see `BatchEnv.reset`.

        Raises:
            TypeError, ValueError: a seed that is not allowed; nothing has changed then.
        """
        return self._joined([one.reset(seed) for one in self.batches])

    def step(self, actions: ArrayLike) -> MixedStep:
        """Do one control step in every world.

        Args:
            actions: (N,) integers, or (N, 2) floats where actions are continuous; see
                `BatchEnv.step`.

        Raises:
            TypeError: wrong dtype, or no array at all.
            ValueError: wrong shape: nothing has moved then. Or an action out of range: batches
                without such an action have moved.
            WorldError: worlds of a batch failed; all others have done the step.
        """
        steps = self.step_batches(actions)
        return MixedStep(
            self._joined([one.obs for one in steps]),
            np.concatenate([one.reward.ravel() for one in steps]),
            np.concatenate([one.terminated for one in steps]),
            np.concatenate([one.truncated for one in steps]),
            steps,
        )

    def step_batches(self, actions: ArrayLike) -> tuple[Step, ...]:
        """The same step, with what each batch gives alone: no tables are made."""
        given = np.asarray(actions)
        wanted = (self.num_robots, 2) if self.batches[0].continuous else (self.num_robots,)
        if given.shape != wanted:
            raise ValueError(f"actions have shape {given.shape}: must have {wanted}")
        parts = [
            part.reshape(one.num_envs, one.num_robots, *wanted[1:])
            for one, part in zip(self.batches, self._by_batch(given), strict=True)
        ]
        do = map if self._pool is None else self._pool.map
        found = list(do(_step_or_error, self.batches, parts))
        errors = [one for one in found if isinstance(one, Exception)]
        if errors:
            raise errors[0]
        return tuple(one for one in found if isinstance(one, Step))

    def entities(self) -> Entities:
        """What robots see now."""
        return self._joined([one.observe() for one in self.batches])

    def final_entities(self, step: MixedStep) -> Entities:
        """What robots saw after a step and before any autoreset, as `Step.final_obs`."""
        return self._joined([one.final_obs for one in step.steps])

    def replace(self, number: int, batch: BatchEnv) -> None:
        """Put a batch in the place of another one, which is closed.

        Raises:
            TypeError, ValueError: as of `MixedBatchEnv`, or there is no such number. Nothing has
                changed then.
        """
        number = whole_number("number", number, 0, len(self.batches) - 1)
        old = self.batches[number]
        self._arrange([*self.batches[:number], batch, *self.batches[number + 1 :]])
        old.close()

    def close(self) -> None:
        """Give back memory and threads; neither it nor its batches can be used afterwards."""
        if self._pool is not None:
            self._pool.shutdown()
        for one in self.batches:
            one.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _by_batch(self, of_robots: NDArray[np.generic]) -> Iterator[NDArray[np.generic]]:
        begin = 0
        for one in self.batches:
            end = begin + one.num_envs * one.num_robots
            yield of_robots[begin:end]
            begin = end

    def _joined(self, rows: Sequence[NDArray[np.float32]]) -> Entities:
        """Tables of all robots, of observations (E, R, D) of each batch."""
        found, begin = self._tables(), 0
        for own_layout, columns, part in zip(self._layouts, self._columns, rows, strict=True):
            seen = own_layout.entities(part.reshape(-1, part.shape[-1]))
            here = slice(begin, begin + len(seen.own))
            mates, victims = slice(own_layout.teammates), slice(own_layout.victims)
            tables = (found.own[here], found.teammates[here, mates], found.victims[here, victims])
            given = seen.own, seen.teammates, seen.victims
            for table, known, runs in zip(tables, given, columns, strict=True):
                for begins, at, width in runs:
                    table[..., at : at + width] = known[..., begins : begins + width]
            found.teammate_mask[here, mates] = seen.teammate_mask
            found.victim_mask[here, victims] = seen.victim_mask
            begin = here.stop
        return Entities(*found)  # not the kept tuple, or nobody knew who still uses its arrays

    def _tables(self) -> Entities:
        """Tables of zeros, but for what was written where something will be written again.

        Tables that the caller has let go of are used again: fresh memory takes longer than the
        copies.
        """
        for one in self._kept:
            if _is_free(one):
                return one
        count, layout = self.num_robots, self.layout
        made = Entities(
            own=np.zeros((count, len(layout.own)), np.float32),
            teammates=np.zeros((count, layout.teammates, len(layout.teammate)), np.float32),
            teammate_mask=np.zeros((count, layout.teammates), np.bool_),
            victims=np.zeros((count, layout.victims, len(layout.victim)), np.float32),
            victim_mask=np.zeros((count, layout.victims), np.bool_),
        )
        if len(self._kept) == _MOST_KEPT:
            del self._kept[0]
        self._kept.append(made)
        return made


def _references(arrays: tuple[NDArray[Any], ...]) -> list[int]:
    return [getrefcount(arrays[index]) for index in range(len(arrays))]


_ALONE = _references((np.zeros(1), np.zeros(1)))[0]
"""References to an array in a tuple that nobody else has."""


def _is_free(tables: Entities) -> bool:
    """Whether nothing but the kept tuple leads to its arrays."""
    return all(one == _ALONE for one in _references(tables))


def _step_or_error(batch: BatchEnv, actions: NDArray[np.generic]) -> Step | Exception:
    """One step; an error of one batch must not keep others from theirs."""
    try:
        return batch.step(actions)
    except Exception as error:
        return error


def _runs(names: tuple[str, ...], of: tuple[str, ...]) -> list[tuple[int, int, int]]:
    """Where some names stand among others: runs of them, each (begin, begin among others, width).

    Runs are copied several times as fast as single columns.
    """
    found: list[tuple[int, int, int]] = []
    for number, name in enumerate(names):
        at = of.index(name)
        if found and at == sum(found[-1][1:]):
            begin, first, width = found[-1]
            found[-1] = (begin, first, width + 1)
        else:
            found.append((number, at, 1))
    return found
