"""Which library multiplies matrices: the faster one for this processor, if it is as exact.

PyTorch multiplies float32 matrices on a CPU by MKL. On AMD processors with AVX-512, MKL uses only
AVX2, and oneDNN uses AVX-512. The choice depends on the processor alone, never on a measured time,
so that a run gives the same numbers every time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

_LARGEST_ERROR = 1e-5
"""Relative to the largest entry; float32 gives some 1e-6, bfloat16 some 1e-2."""


@contextmanager
def best_matmul_backend() -> Iterator[str]:
    """Use the best library inside the block.

    Yields:
        The library and its measured error, e.g. "onednn, error 2.1e-07", for ``run.json``.
    """
    if not _onednn_is_faster():
        yield f"default, error {_error():.1e}"
        return
    with _onednn():
        error = _error()
        if error <= _LARGEST_ERROR:
            yield f"onednn, error {error:.1e}"
            return
    yield f"default, error {_error():.1e} (onednn {error:.1e})"


@contextmanager
def _onednn() -> Iterator[None]:
    """Let oneDNN multiply.

    The setting allows TF32. On processors that have instructions for such a format, oneDNN may then
    really be less exact; that is why the error is measured.
    """
    mkldnn: Any = torch.backends.mkldnn  # older versions have no such setting
    matmul = mkldnn.matmul
    before = matmul.fp32_precision
    matmul.fp32_precision = "tf32"
    try:
        yield
    finally:
        matmul.fp32_precision = before


def _onednn_is_faster() -> bool:
    info = Path("/proc/cpuinfo")
    return (
        hasattr(torch.backends.mkldnn, "matmul")
        and torch.backends.cpu.get_cpu_capability() == "AVX512"
        and info.exists()
        and "AuthenticAMD" in info.read_text()
    )


def _error() -> float:
    """Largest error of a batched product, as a share of the largest entry, against float64."""
    source = torch.Generator().manual_seed(0)
    left = torch.randn(4, 128, 128, generator=source)
    right = torch.randn(4, 128, 256, generator=source)
    exact = torch.bmm(left.double(), right.double())
    return float(((torch.bmm(left, right) - exact).abs().max() / exact.abs().max()).item())
