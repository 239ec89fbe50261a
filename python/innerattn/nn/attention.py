"""Attention of each robot over its teammates: learnt, untrained, uniform, the largest, or none.

All but the last have the same parameters.

Sources: eqs. 2-4 of the paper, read as in Iqbal & Sha 2019, section 3.2. The softmax is over
teammates j != i, and the query comes from an encoding without the robot's own action.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from innerattn.nn.linear import uniform_parameter


class Attended(NamedTuple):
    """Result of an attention.

    Attributes:
        mixed: (R, B, W) x_i, the weighted values of the teammates, with heads concatenated; zeros
            for a robot that sees no teammate.
        weights: (B, H, R, R) weight of robot i (row) on teammate j. Rows sum to 1, or to 0 if the
            robot sees no teammate; the diagonal is 0.
        scores: (B, H, R, R) raw scores q_i . k_j, also of pairs that do not see each other; None
            if the attention has no scores.
        visible: (1 or B, R, R) bool, whether robot i sees teammate j.
    """

    mixed: Tensor
    weights: Tensor
    scores: Tensor | None
    visible: Tensor


def visible_teammates(num_robots: int, available: Tensor | None, device: torch.device) -> Tensor:
    """Which teammates each robot sees: all other robots that are available.

    Args:
        num_robots: R.
        available: (B, R) bool; or (B, R, R), where robot i sees robot j only if [b, i, j] is set;
            None: all are available.
        device: Where the result lies.

    Returns:
        (1 or B, R, R) bool, row i, column j.
    """
    others = ~torch.eye(num_robots, dtype=torch.bool, device=device).unsqueeze(0)
    if available is None:
        return others
    return others & (available if available.dim() == 3 else available.unsqueeze(1))


class TeammateAttention(nn.Module):
    """Base of all attentions: maps encodings of the team to one vector of teammates per robot.

    All robots share the parameters: learners divide their gradients by the number of robots.

    Attributes:
        width: W.
        heads: H.
    """

    def __init__(self, width: int, heads: int, generator: torch.Generator) -> None:
        """Check the sizes; a subclass draws its parameters.

        Args:
            width: W, width of the encodings and of the mixed values.
            heads: H, a divisor of the width.
            generator: Source of the initial parameters, on the CPU.

        Raises:
            ValueError: The width is not a multiple of the number of heads.
        """
        super().__init__()
        if width % heads:
            raise ValueError(f"width = {width}: must be a multiple of the {heads} attention heads")
        del generator
        self.width, self.heads = width, heads

    def forward(self, own: Tensor, others: Tensor, available: Tensor | None = None) -> Attended:
        """Attend to teammates.

        Args:
            own: (R, B, W) state-only encodings, the source of queries.
            others: (R, B, W) state-action encodings, the source of keys and values.
            available: (B, R) bool; no robot attends to an unavailable one. None: all are available.
        """
        raise NotImplementedError


class MatrixAttention(TeammateAttention):
    """The parameters that all attentions of this package have.

    Attributes:
        query: (W, W), rows h*d..(h+1)*d belong to head h; likewise `key` and `value`.
        value_bias: (W,).
    """

    def __init__(self, width: int, heads: int, generator: torch.Generator) -> None:
        """Draw the parameters; arguments as in `TeammateAttention`."""
        super().__init__(width, heads, generator)
        self.query = uniform_parameter((width, width), width, generator)
        self.key = uniform_parameter((width, width), width, generator)
        self.value = uniform_parameter((width, width), width, generator)
        self.value_bias = uniform_parameter((width,), width, generator)

    def values(self, others: Tensor) -> Tensor:
        """(R, B, W) v_j of state-action encodings (R, B, W)."""
        return functional.leaky_relu_(functional.linear(others, self.value, self.value_bias))


class InnerAttention(MatrixAttention):
    """Learnt attention: alpha_ij = softmax over j != i of q_i . k_j / sqrt(d), per head.

    Attributes:
        attend: From queries, keys and values to the result; a compiled update has another form.
    """

    def __init__(self, width: int, heads: int, generator: torch.Generator) -> None:
        """Draw the parameters; arguments as in `TeammateAttention`."""
        super().__init__(width, heads, generator)
        self.attend = dot_product_attention

    def forward(self, own: Tensor, others: Tensor, available: Tensor | None = None) -> Attended:
        """Attend to teammates; arguments as in `TeammateAttention.forward`."""
        queries = functional.linear(own, self.query)
        keys = functional.linear(others, self.key)
        return self.attend(queries, keys, self.values(others), self.heads, available)


class FrozenAttention(InnerAttention):
    """A control: the formula of `InnerAttention`, with queries and keys as they were drawn.

    Weights vary with what robots see, but nothing is learnt of whom to attend to.
    """

    def __init__(self, width: int, heads: int, generator: torch.Generator) -> None:
        """Draw the parameters; arguments as in `TeammateAttention`."""
        super().__init__(width, heads, generator)
        self.query.requires_grad_(False)
        self.key.requires_grad_(False)


class UniformAttention(MatrixAttention):
    """The baseline: alpha_ij = 1/(N-1) for every teammate that robot i sees.

    It has the parameters of `InnerAttention`, but does not use or train query and key: 2 W^2 fewer
    trained parameters, 32,768 at a width of 128.

    Attributes:
        attend: From values to the result; a compiled update has another form.
    """

    def __init__(self, width: int, heads: int, generator: torch.Generator) -> None:
        """Draw the parameters; arguments as in `TeammateAttention`."""
        super().__init__(width, heads, generator)
        self.query.requires_grad_(False)
        self.key.requires_grad_(False)
        self.attend = mean_attention

    def forward(self, own: Tensor, others: Tensor, available: Tensor | None = None) -> Attended:
        """Average over teammates; arguments as in `TeammateAttention.forward`."""
        del own
        return self.attend(self.values(others), self.heads, available)


class MaxAttention(MatrixAttention):
    """A control: x_i = the largest v_j over the teammates j that robot i sees, for each feature.

    A weight is the share of a head's features in which a teammate has the largest value. It has the
    parameters of `InnerAttention`, but does not use or train query and key.
    """

    def __init__(self, width: int, heads: int, generator: torch.Generator) -> None:
        """Draw the parameters; arguments as in `TeammateAttention`."""
        super().__init__(width, heads, generator)
        self.query.requires_grad_(False)
        self.key.requires_grad_(False)

    def forward(self, own: Tensor, others: Tensor, available: Tensor | None = None) -> Attended:
        """Take the largest values; arguments as in `TeammateAttention.forward`."""
        del own
        return max_attention(self.values(others), self.heads, available)


class NoAttention(TeammateAttention):
    """A control: the value of a robot depends on what it sees itself alone, as in independent PPO.

    It has no parameters. All weights are 0, and so is x_i.
    """

    def forward(self, own: Tensor, others: Tensor, available: Tensor | None = None) -> Attended:
        """Attend to nobody; arguments as in `TeammateAttention.forward`."""
        del others, available
        robots, batch, _ = own.shape
        nobody = torch.zeros(1, robots, robots, dtype=torch.bool, device=own.device)
        weights = own.new_zeros(1, 1, robots, robots).expand(batch, self.heads, -1, -1)
        return Attended(torch.zeros_like(own), weights, None, nobody)


def dot_product_attention(
    queries: Tensor, keys: Tensor, values: Tensor, heads: int, available: Tensor | None
) -> Attended:
    """x_i = sum over j != i of alpha_ij v_j, with alpha_ij = softmax of q_i . k_j / sqrt(d).

    Args:
        queries: (R, B, W), columns h*d..(h+1)*d belong to head h; likewise keys and values.
        keys: (R, B, W).
        values: (R, B, W).
        heads: H.
        available: (B, R) bool; no robot attends to an unavailable one. None: all are available.
    """
    robots, batch, width = queries.shape
    visible = visible_teammates(robots, available, queries.device)
    queries, keys, values = (_by_head(x, heads) for x in (queries, keys, values))
    # Teammates before robots: a softmax along the middle dimension of such small matrices is
    # much faster than one along the last, and no product below needs a copy of its operands.
    scores = torch.bmm(keys, queries.transpose(1, 2)).view(batch, heads, robots, robots)
    seen = visible.transpose(1, 2).unsqueeze(1)
    # The lowest finite number instead of -inf avoids NaN for a robot without teammates.
    lowest = torch.finfo(scores.dtype).min
    hidden = torch.zeros_like(seen, dtype=scores.dtype).masked_fill_(~seen, lowest)
    weights = torch.add(hidden, scores, alpha=(width // heads) ** -0.5).softmax(dim=2)
    if robots == 1 or available is not None:
        weights = weights * seen  # if a robot sees nobody, its softmax gives equal weights
    mixed = torch.bmm(weights.flatten(0, 1).transpose(1, 2), values)
    return Attended(
        mixed.transpose(0, 1).reshape(robots, batch, width),
        weights.transpose(2, 3),
        scores.transpose(2, 3),
        visible,
    )


def mean_attention(values: Tensor, heads: int, available: Tensor | None) -> Attended:
    """x_i = the mean of v_j over the teammates j that robot i sees.

    Args:
        values: (R, B, W).
        heads: H.
        available: As in `dot_product_attention`.
    """
    robots, batch, _ = values.shape
    visible = visible_teammates(robots, available, values.device)
    weights = visible.to(values.dtype)
    weights = weights / weights.sum(dim=2, keepdim=True).clamp_min(1.0)
    mixed = torch.bmm(weights.expand(batch, -1, -1), values.transpose(0, 1)).transpose(0, 1)
    return Attended(
        mixed.contiguous(), weights.unsqueeze(1).expand(batch, heads, -1, -1), None, visible
    )


def max_attention(values: Tensor, heads: int, available: Tensor | None) -> Attended:
    """x_i = the largest v_j over the teammates j that robot i sees, for each feature.

    Args:
        values: (R, B, W).
        heads: H.
        available: (B, R) bool, as in `dot_product_attention`.
    """
    robots, batch, width = values.shape
    visible = visible_teammates(robots, available, values.device)
    seen = visible.any(2).t().unsqueeze(2)  # (R, 1 or B, 1) whether a robot sees anybody
    if available is not None:
        lowest = torch.finfo(values.dtype).min
        values = values.masked_fill(~available.t().unsqueeze(2), lowest)
    # A robot's largest value is the team's, or the second where the team's is its own.
    best, who = values.topk(min(2, robots), dim=0)
    own = who[0] == torch.arange(robots, device=values.device).view(-1, 1, 1)
    mixed = torch.where(own, best[-1], best[0]) * seen
    with torch.no_grad():
        whose = torch.where(own, who[-1], who[0]).view(robots, batch, heads, width // heads)
        counts = values.new_zeros(robots, batch, heads, robots)
        counts.scatter_add_(3, whose, values.new_ones(()).expand(whose.shape))
        weights = counts * (heads / width) * seen.unsqueeze(3)
    return Attended(mixed, weights.permute(1, 2, 0, 3), None, visible)


def _by_head(x: Tensor, heads: int) -> Tensor:
    """View (R, B, W) as (B*H, R, d) without a copy."""
    robots, batch, width = x.shape
    return x.view(robots, batch * heads, width // heads).transpose(0, 1)
