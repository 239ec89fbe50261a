"""A policy for any team as one graph, which ONNX can hold: from a robot's view to its action.

It is `innerattn.policies.exported.pair_network`, for any numbers of robots, victims and abilities.
"""

from __future__ import annotations

import copy

import torch
from torch import Tensor, nn

from innerattn.nn.teams import TeamActor
from innerattn.nn.teams.pooling import InnerPooling, MaxPooling, Pooling, UniformPooling
from innerattn.nn.teams.relations import NEAREST, PAIR_WIDTH
from innerattn.policies.exported.pair_network import ACTION_NAMES
from innerattn.train.export.view_pairs import COLUMN_ORDER, Relate, View

_ROUNDS = ("", "_again")
"""Suffixes of the poolings' names in the first and the second round."""
_SHARPNESS, _LARGEST_LOGIT, _NEVER = 10.0, 20.0, -1e9
_ALMOST_NOTHING, _SHIFT = 1e-6, 6.907755279
"""What `InnerPooling` adds to a sum of weights, and the logarithm of 1000. Both are 1000 times as
large as there, because an exporter takes a sum with 1e-9 for a sum with 0 and leaves it out."""


class _Asking(nn.Module):
    """Queries and keys of two poolings at once: q . k = (W_q x + b) . W_k y = (A x + a) . y."""

    def __init__(self, pools: tuple[Pooling, Pooling]) -> None:
        super().__init__()
        matrices, biases = [], []
        for pool in pools:
            assert isinstance(pool, InnerPooling)  # as those of one policy are alike
            keys = pool.key.weight.detach() * pool.key_width**-0.5
            matrices.append(pool.query.weight.detach().t() @ keys)
            biases.append(pool.query.bias.detach()[None] @ keys)
        self.matrices, self.biases = (nn.Buffer(torch.stack(one)) for one in (matrices, biases))

    def forward(self, asking: Tensor) -> Tensor:
        """Map pairs (NEAREST, Q, H) to what is multiplied with others, (NEAREST, 2, Q, H)."""
        found: Tensor = asking[:, None] @ self.matrices + self.biases
        return found


class ViewForm(nn.Module):
    """One robot's policy from its view to the actions of the world."""

    def __init__(self, actor: TeamActor) -> None:
        """Take the layers of a policy, with pairs in the order of `COLUMN_ORDER`."""
        super().__init__()
        self.relate, self.actor = Relate(), copy.deepcopy(actor)
        order = torch.tensor([*COLUMN_ORDER])
        with torch.no_grad():
            for layer in (self.actor.first, self.actor.fourth):
                layer.weight[:, :PAIR_WIDTH] = layer.weight[:, order]
        if isinstance(self.actor.rivals, InnerPooling):
            self.asking = nn.ModuleList([_Asking(self._pools(one)) for one in _ROUNDS])
        self.names = nn.Buffer(torch.tensor(ACTION_NAMES))

    def forward(self, *view: Tensor) -> tuple[Tensor, Tensor]:
        """Map a `View` to log-probabilities (5,) and probabilities (5,) of the world's actions."""
        seen, net = self.relate(View(*view)), self.actor
        rows = net.first(seen.columns).relu() * seen.there
        most = rows.amax(0, keepdim=True).expand_as(rows)
        rows = net.second(torch.cat([rows, most], 2)).relu() * seen.there

        # From here on the robot's own victims count, first for all robots there.
        at, there = rows.index_select(0, seen.at), seen.there.index_select(0, seen.at)
        pooled = self._pooled(0, at, at, seen.masks, seen.times)
        most = rows.amax(0, keepdim=True).expand_as(at)
        at = net.third(torch.cat([at, *pooled, most], 2)).relu() * there
        mine = at[:, :1]
        pooled = self._pooled(1, mine, at, seen.masks[:, :, :1], seen.times)
        own = mine.amax(0)  # (1, H)
        pairs = seen.columns[:, 0].index_select(0, seen.at)
        parts = [pairs, seen.turning, *(one[:, 0] for one in (mine, *pooled))]
        parts.append(own.expand(NEAREST, -1))
        out = net.out(net.fifth(net.fourth(torch.cat(parts, 1)).relu()).relu())
        home = net.home_out(net.home(torch.cat([seen.home, own], 1)).relu())

        proposed = torch.cat([out, home]) * _SHARPNESS
        weights = torch.where(_with_home(seen.helps), proposed[:, :1], _NEVER).log_softmax(0)
        choices = proposed[:, 1:].log_softmax(1).gather(1, self.names.index_select(0, seen.frames))
        logits = (choices + weights).logsumexp(0)
        return logits, logits.softmax(0)

    def _pools(self, suffix: str) -> tuple[Pooling, Pooling]:
        """How a pair sums up rivals and partners in a round."""
        found = (getattr(self.actor, f"{who}{suffix}") for who in ("rivals", "partners"))
        rivals, partners = found
        return rivals, partners

    def _pooled(
        self, number: int, asking: Tensor, at: Tensor, masks: Tensor, times: Tensor
    ) -> tuple[Tensor, Tensor]:
        """What pairs make of rivals and of partners at their victims, (NEAREST, Q, H) each.

        Args:
            number: of the round.
            asking: (NEAREST, Q, H) the pairs.
            at: (NEAREST, R, H) all pairs at these victims; zeros where there is none.
            masks: (NEAREST, 2, Q, R) whom they look at.
            times: (NEAREST, 1, R) arrival times.
        """
        first = self.actor.rivals
        if isinstance(first, InnerPooling):
            logits = self.asking[number](asking) @ at.transpose(1, 2)[:, None]
            weights = (logits.clamp_max(_LARGEST_LOGIT) + _SHIFT).exp() * masks
            found = (weights / (weights.sum(3, keepdim=True) + _ALMOST_NOTHING)) @ at[:, None]
        elif isinstance(first, UniformPooling):
            found = (masks / masks.sum(3, keepdim=True).clamp_min(1.0)) @ at[:, None]
        elif isinstance(first, MaxPooling):  # what is pooled is at least 0
            found = (at[:, None, None] * masks[..., None]).amax(3)
        else:
            soonest = torch.where(masks > 0.0, times[:, None], torch.inf)
            first_one = soonest.argmin(3)[..., None].expand(-1, -1, -1, at.shape[2])
            everybody = at[:, None].expand(-1, 2, -1, -1)
            found = everybody.gather(2, first_one) * masks.amax(3, keepdim=True)
        return found[:, 0], found[:, 1]


def _with_home(helps: Tensor) -> Tensor:
    """The way home is always there."""
    return torch.cat([helps, torch.ones_like(helps[:1])])
