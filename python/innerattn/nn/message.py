"""Messages: what each robot says to its teammates, learnt together with its policy.

Each robot makes K numbers of its own observation, and pools those of the teammates that it hears.
The network behind takes the observation and what was heard side by side. Gradients go from those
who hear to those who say. This module knows neither episodes nor losses.

Observations may come in frames (see `innerattn.nn.symmetry`), one for each robot. Half of a message
is vectors, which turn from the sender's frame into that of the robot that hears it.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.actor import Actor
from innerattn.nn.encoder import EntityColumns, observation_encoder
from innerattn.nn.linear import PerRobotLinear
from innerattn.nn.memory import RememberingActor, turned_memory
from innerattn.nn.pooling import equal_weights, largest
from innerattn.nn.symmetry import between

_YES = 0.5


@dataclass(frozen=True)
class Hearing:
    """How observations say whom a robot hears. Teammates are all other robots, in their order.

    Attributes:
        sends: Column that is above 0.5 in the observation of a robot that says something.
        heard: For each teammate, the column that is above 0.5 where it is heard; none: all are.
        places: For each teammate, the columns x and y of its place, relative to the robot.
        seen: For each teammate, the column that is above 0.5 where its place is known; none: all
            are known.
        delay: Control steps from saying to hearing.
    """

    sends: int
    heard: tuple[int, ...]
    places: tuple[tuple[int, int], ...]
    seen: tuple[int, ...] = ()
    delay: int = 0


def row_width(obs_width: int, delay: int) -> int:
    """Columns of a row of an actor with messages, for observations of D columns."""
    return (obs_width + 1) * (2 if delay else 1)


def with_element(obs: Tensor, element: Tensor | None) -> Tensor:
    """Observations (R, B, D) with the elements that turned them behind them, (R, B, D + 1).

    These are the rows of an actor with messages, where messages arrive at once. Where they arrive
    later, what robots saw when they said what arrives now follows in the same form.

    Args:
        obs: (R, B, D).
        element: (R, B) int64, elements that turned the world into the frames of ``obs``; None:
            none did.
    """
    if element is None:
        return functional.pad(obs, (0, 1))
    return torch.cat([obs, element.unsqueeze(2).to(obs.dtype)], dim=2)


class Messages(nn.Module):
    """What each robot says, and what it hears of its teammates.

    With e = phi(W_e o) of an observation o, robot j says m_j = tanh(W_m e_j). Robot i hears m_ij,
    which is m_j turned into its frame, of those robots j that its observation names. It pools them:

        attention: sum_j alpha_ij m_ij, alpha_i = softmax over j of (W_q e_i) . m_ij / sqrt(K)
        mean:      their mean
        max:       the largest of them, number by number
        nearest:   that of the nearest robot, or the mean of several that are equally near

    Robots whose place it does not see are farther than others. Who hears nobody has zeros.

    Attributes:
        width: K, numbers of a message, each in -1 to 1.
        obs_width: D.
    """

    def __init__(
        self,
        num_robots: int,
        obs_width: int,
        hidden_width: int,
        width: int,
        pooling: str,
        hearing: Hearing,
        generator: torch.Generator,
        *,
        turns: bool,
        entities: EntityColumns | None = None,
        entity_pooling: str = "attention",
    ) -> None:
        """Draw the parameters.

        Args:
            num_robots: R.
            obs_width: D.
            hidden_width: Width of the encodings e.
            width: K.
            pooling: "attention", "mean", "max" or "nearest".
            hearing: How observations say whom a robot hears.
            generator: Source of the initial parameters, on the CPU.
            turns: Whether observations come in frames that may differ between robots or steps.
            entities: Columns of the entities to encode separately; None: encode the whole row.
            entity_pooling: How `EntityEncoder` sums up entities.
        """
        super().__init__()
        self.width, self._hearing, self._turns = width, hearing, turns
        self.obs_width = obs_width
        self.encoder = observation_encoder(
            num_robots, obs_width, hidden_width, generator, entities, pooling=entity_pooling
        )
        self.output = PerRobotLinear(num_robots, hidden_width, width, generator)
        self.query, self._pooling = None, pooling
        if pooling == "attention":
            self.query = PerRobotLinear(num_robots, hidden_width, width, generator)
        robots = torch.arange(num_robots)
        # Which of its teammates robot i knows robot j as; itself as one behind the last.
        place = torch.where(robots < robots.unsqueeze(1), robots, robots - 1)
        self._place: Tensor
        self.register_buffer("_place", place.fill_diagonal_(num_robots - 1), persistent=False)

    def forward(self, rows: Tensor) -> Tensor:
        """Map rows (R, B, ...), as `with_element` says, to what robots hear (R, B, K)."""
        width = self.obs_width
        obs, element = rows[..., :width], rows[..., width]
        said, frame = obs, element
        if self._hearing.delay:
            said, frame = rows[..., width + 1 : -1], rows[..., -1]
        encoded = functional.leaky_relu(self.encoder(said))
        messages = self.output(encoded).tanh().to(rows.dtype)
        arriving = messages.expand(len(obs), *messages.shape)  # (R, R, B, K), by who hears
        if self._turns:
            arriving = _turned_for(arriving, frame.long(), element.long())
        hears = self._hears(obs, said)
        if self._pooling == "max":
            return largest(arriving, hears.unsqueeze(3), dim=1)
        if self._pooling == "attention":
            if self._hearing.delay:
                encoded = functional.leaky_relu(self.encoder(obs))
            weights = self._attention(encoded, arriving, hears)
        else:
            if self._pooling == "nearest":
                hears = _nearest(hears, self._distances(obs))
            weights = equal_weights(hears, 1, rows.dtype)
        pooled: Tensor = (weights.unsqueeze(3) * arriving).sum(dim=1)
        return pooled

    def _attention(self, encoded: Tensor, messages: Tensor, hears: Tensor) -> Tensor:
        """(R, R, B) weights of messages (R, R, B, K), from encodings (R, B, W) of who hears."""
        assert self.query is not None  # the pooling is "attention"
        asked = self.query(encoded).to(messages.dtype).unsqueeze(1)
        scores = (asked * messages).sum(dim=3) * self.width**-0.5
        # The lowest finite number instead of -inf avoids NaN where nobody is heard.
        scores = scores.masked_fill(~hears, torch.finfo(scores.dtype).min)
        weights: Tensor = scores.softmax(dim=1) * hears
        return weights

    def _hears(self, obs: Tensor, said: Tensor) -> Tensor:
        """(R, R, B) bool: whether robot i hears what robot j said."""
        sends = said[..., self._hearing.sends] > _YES
        if self._hearing.heard:
            heard = self._by_robot(obs[..., list(self._hearing.heard)]) > _YES
        else:
            itself = torch.eye(len(obs), dtype=torch.bool, device=obs.device)
            heard = ~itself.unsqueeze(2)
        return heard & sends

    def _distances(self, obs: Tensor) -> Tensor:
        """(R, R, B) squares of distances of teammates; infinite where these are not seen."""
        x, y = (obs[..., [place[axis] for place in self._hearing.places]] for axis in (0, 1))
        squares = x.square() + y.square()
        if self._hearing.seen:
            unseen = obs[..., list(self._hearing.seen)] <= _YES
            squares = squares.masked_fill(unseen, torch.inf)
        return self._by_robot(squares)

    def _by_robot(self, columns: Tensor) -> Tensor:
        """(R, R, B) numbers of robots, 0 of itself, from those of its teammates (R, B, R - 1)."""
        robots, batch, _ = columns.shape
        with_itself = functional.pad(columns, (0, 1))
        place: Tensor = self._place.unsqueeze(1).expand(robots, batch, robots)
        return with_itself.gather(2, place).transpose(1, 2)


def _turned_for(messages: Tensor, sender: Tensor, receiver: Tensor) -> Tensor:
    """Messages (R, R, B, K) in the frames of those who hear them, from elements (R, B) of both."""
    elements = between(sender.unsqueeze(0), receiver.unsqueeze(1))
    turned = turned_memory(messages.flatten(0, 1), elements.flatten(0, 1))
    return turned.view(messages.shape)


def _nearest(hears: Tensor, distances: Tensor) -> Tensor:
    """(R, R, B) bool: those of the robots that are heard that have the least distance."""
    distances = distances.masked_fill(~hears, torch.inf)
    return hears & (distances == distances.amin(dim=1, keepdim=True))


class ListeningActor(nn.Module):
    """The policies of all robots, which take what they hear beside their observations.

    Attributes:
        messages: What robots say and hear.
        network: Takes observations (R, B, D + K), what is heard last.
        num_robots: R.
    """

    def __init__(self, messages: Messages, network: Actor | RememberingActor) -> None:
        """Let policies for observations of D + K columns hear messages of K numbers."""
        super().__init__()
        self.messages, self.network = messages, network
        self.num_robots = network.num_robots

    def forward(self, rows: Tensor, *recall: Tensor | None) -> Tensor:
        """Map rows (R, B, ...), as `with_element` says, to action logits (R, A, B).

        ``recall`` is what `RememberingActor.forward` takes beside observations.
        """
        logits: Tensor = self.network(self._inputs(rows), *recall)
        return logits

    def act(
        self, rows: Tensor, past: Tensor, element: Tensor | None = None
    ) -> tuple[Tensor, Tensor]:
        """One step of policies with a memory; see `RememberingActor.act`."""
        assert isinstance(self.network, RememberingActor)  # as the caller knows
        return self.network.act(self._inputs(rows), past, element)

    def _inputs(self, rows: Tensor) -> Tensor:
        """Observations (R, B, D + K) with what robots hear beside them."""
        obs = rows[..., : self.messages.obs_width]
        return torch.cat([obs, self.messages(rows)], dim=2)
