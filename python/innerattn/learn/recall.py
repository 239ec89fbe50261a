"""What robots remembered in the control steps of a rollout, step by step or by sequences."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from innerattn.learn.resume import State, take, take_within
from innerattn.learn.types import Transitions
from innerattn.nn.symmetry import NUM_ELEMENTS, between

_LAST = NUM_ELEMENTS - 1


class Recall(NamedTuple):
    """What robots remember where n sequences of L steps begin, and how these go on.

    Rows are sequences: all first steps, then all second ones.

    Attributes:
        remembered: (R, n, M), of actors and critics.
        begins: (L, n) bool, steps of the sequences at which an episode begins; None: one step, at
            which none does.
        turns: (R, L n) int64, elements that turn the frame of the step before, or at the first step
            the world, into that of each step; None: nothing turns.
    """

    remembered: Tensor
    begins: Tensor | None = None
    turns: Tensor | None = None

    def steps(self, chosen: slice) -> Recall:
        """Some sequences of one step."""
        turns = None if self.turns is None else self.turns[:, chosen]
        return Recall(self.remembered[:, chosen], None, turns)

    def rows_of(self, sequences: Tensor) -> Tensor:
        """The rows (L k,) of sequences (k,), in the order of rows."""
        assert self.begins is not None  # sequences of several steps
        length, count = self.begins.shape
        firsts = torch.arange(length, device=sequences.device) * count
        return (firsts.unsqueeze(1) + sequences).flatten()

    def take(self, sequences: Tensor) -> Recall:
        """Some sequences, by their indices (k,) int64."""
        assert self.begins is not None  # sequences of several steps
        turns = self.turns
        if turns is not None:
            turns = turns.index_select(1, self.rows_of(sequences))
        begins = self.begins.index_select(1, sequences)
        return Recall(self.remembered.index_select(1, sequences), begins, turns)

    def resume_state(self) -> dict[str, Tensor]:
        """All that there is, by name; see `Resumable`."""
        assert self.begins is not None  # sequences of several steps
        state = {"remembered": self.remembered, "begins": self.begins.to(torch.uint8)}
        return state if self.turns is None else state | {"turns": self.turns.to(torch.uint8)}

    @classmethod
    def taken_from(cls, state: State, shape: tuple[int, int], width: int, like: Tensor) -> Recall:
        """What `resume_state` gave.

        Args:
            state: By name.
            shape: R, L n.
            width: M.
            like: Has the dtype and the device.

        Raises:
            ValueError: As in `take`.
        """
        robots, rows = shape
        begins = take_within(state, "begins", torch.uint8, 0, 1, None, None)
        if begins.numel() != rows:
            raise ValueError(f"'begins' has {begins.numel()} steps: must have {rows}")
        turns = None
        if "turns" in state:
            turns = take_within(state, "turns", torch.uint8, 0, _LAST, robots, rows).long()
            turns = turns.to(like.device)
        remembered = take(state, "remembered", like.dtype, robots, begins.shape[1], width)
        return cls(remembered.to(like.device), begins.bool().to(like.device), turns)


class RecalledSteps:
    """What robots remembered in T control steps of E worlds, which is filled in place."""

    def __init__(self, shape: tuple[int, int, int, int], like: Tensor) -> None:
        """Reserve the memory for a shape (R, T, E, M); ``like`` has the dtype and the device."""
        self._remembered = like.new_empty(shape)
        self._elements = like.new_empty(shape[:3], dtype=torch.int64)
        self._after: list[Recall] = []

    def clear(self) -> None:
        """Hold no step."""
        self._after = []

    def add(
        self, step: int, memories: tuple[Tensor, Tensor], batch: Transitions, cut: Tensor
    ) -> None:
        """Take one control step.

        Args:
            step: Its number in the rollout.
            memories: (R, E, M) what robots remembered before the step, and after it.
            batch: The E transitions.
            cut: (E,) bool, worlds whose next step is not of this episode and rollout.
        """
        before, after = memories
        self._remembered[:, step].copy_(before)
        self._elements[:, step].copy_(_of_all(batch.elements, batch))
        turns = _of_all(batch.next_elements, batch).to(cut.device)
        self._after.append(Recall(after[:, cut], None, turns[:, cut]))

    def before(self) -> Recall:
        """What robots remembered before each step, (R, T E, M)."""
        return Recall(self._remembered.flatten(1, 2), None, self._elements.flatten(1, 2))

    def after(self) -> Recall:
        """What they remembered after the n cut steps, (R, n, M)."""
        remembered, _, turns = zip(*self._after, strict=True)
        return Recall(torch.cat(remembered, dim=1), None, torch.cat(turns, dim=1))

    def resume_state(self, held: int) -> dict[str, Tensor]:
        """The first ``held`` steps; see `Resumable`."""
        after = self.after()
        assert after.turns is not None  # as `add` kept them
        return {
            "remembered": self._remembered[:, :held],
            "elements": self._elements[:, :held].to(torch.uint8),
            "after": after.remembered,
            "after_elements": after.turns.to(torch.uint8),
        }

    def load_resume_state(self, state: State, held: int, cut: int) -> None:
        """Go on from a state of ``held`` steps, of which ``cut`` are cut; see `Resumable`."""
        robots, _, envs, width = self._remembered.shape
        dtype, device = self._remembered.dtype, self._remembered.device
        self._remembered[:, :held] = take(state, "remembered", dtype, robots, held, envs, width)
        self._elements[:, :held] = take_within(
            state, "elements", torch.uint8, 0, _LAST, robots, held, envs
        )
        after = take(state, "after", dtype, robots, cut, width)
        turns = take_within(state, "after_elements", torch.uint8, 0, _LAST, robots, cut)
        self._after = [Recall(after.to(device), None, turns.long().to(device))]


def sequences_of(recall: Recall, ended: Tensor, length: int) -> tuple[Tensor, Recall]:
    """T control steps of E worlds as T / L * E sequences of L steps.

    Args:
        recall: What robots remembered before each step; turns are elements of the steps' frames.
        ended: (T, E) bool, steps after which an episode ended.
        length: L, which divides T.

    Returns:
        The rows (T E,) in the order of sequences, and what robots remember there.
    """
    steps, envs = ended.shape

    def by_step(rows: Tensor) -> Tensor:
        """(L, S) of rows (T E,)."""
        return rows.view(-1, length, envs).transpose(0, 1).flatten(1)

    order = by_step(torch.arange(steps * envs, device=ended.device))
    begins = by_step(torch.cat([torch.zeros_like(ended[:1]), ended[:-1]]).flatten())
    begins[0] = False  # what is remembered there is what is remembered after a beginning
    turns = None
    if recall.turns is not None and bool(recall.turns.any()):
        elements = recall.turns[:, order]  # (R, L, S)
        first, later = elements[:, :1], between(elements[:, :-1], elements[:, 1:])
        turns = torch.cat([first, later], dim=1).flatten(1)
    return order.flatten(), Recall(recall.remembered[:, order[0]], begins, turns)


def _of_all(elements: Tensor | None, batch: Transitions) -> Tensor:
    """(R, E) elements; nothing turns where there are none."""
    if elements is None:
        return torch.zeros(batch.obs.shape[1::-1], dtype=torch.int64)
    return elements.t()
