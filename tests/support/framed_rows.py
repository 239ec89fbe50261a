"""Rows of observations and what canonical frames make of them."""

from __future__ import annotations

import numpy as np
import torch

from innerattn.nn.symmetry import NUM_ELEMENTS, SquareSymmetry
from innerattn.train.columns import entity_columns, vector_columns


def check_frames_keep(rows: np.ndarray, names: list[str], suffix: str) -> None:
    """Turned rows (..., D) have one form, in which columns that end in ``suffix`` are as before."""
    obs = torch.from_numpy(rows.reshape(-1, rows.shape[-1]))
    assert entity_columns(names).width == obs.shape[1]
    symmetry = SquareSymmetry(vector_columns(names), torch.device("cpu"))
    own = symmetry.turn(obs, symmetry.frame(obs))
    for element in range(NUM_ELEMENTS):
        turned = symmetry.turn(obs, torch.full((len(obs),), element))
        assert torch.equal(symmetry.turn(turned, symmetry.frame(turned)), own)
    kept = [name.endswith(suffix) for name in names]
    assert any(kept)
    assert torch.equal(own[:, kept], obs[:, kept])
