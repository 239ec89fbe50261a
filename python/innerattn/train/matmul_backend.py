"""Which library multiplies matrices: the faster one for this processor, if it is as exact.

PyTorch multiplies float32 matrices on a CPU by MKL. On AMD processors with AVX-512, MKL uses only
AVX2, and oneDNN uses AVX-512. The choice depends on the processor alone, never on a measured time,
so that a run gives the same numbers every time.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import torch
from torch import Tensor

_log = logging.getLogger(__name__)
_CPUINFO = Path("/proc/cpuinfo")
_LARGEST_ERROR = 1e-5
"""Relative to the largest entry; float32 gives some 1e-6, bfloat16 some 1e-2."""
_PROBES = ((4, 256, 128, 128), (4, 128, 512, 128), (1, 1_024, 64, 5))
"""Batch, rows, inner size and columns of the products that are checked."""


@contextmanager
def chosen_matmul_backend(choice: Literal["auto", "default"]) -> Iterator[str]:
    """Use a library inside the block.

    Args:
        choice: "auto" is oneDNN where it is faster, really multiplies and is exact; "default" is
            PyTorch's own choice.

    Yields:
        The library and its measured error, e.g. "onednn, error 2.1e-07", for ``run.json``.
    """
    default = _products()
    if choice == "default" or not _onednn_is_faster():
        yield f"default, error {_error(default):.1e}"
        return
    with onednn():
        found = _products()
        if _differ(found, default) and _error(found) <= _LARGEST_ERROR:
            yield f"onednn, error {_error(found):.1e}"
            return
    why = f"{_error(found):.1e}" if _differ(found, default) else "not in use"
    yield f"default, error {_error(default):.1e} (onednn {why})"


@contextmanager
def onednn() -> Iterator[None]:
    """Let oneDNN multiply inside the block, where PyTorch and the processor allow it.

    No setting asks for oneDNN and float32. This one allows bfloat16, which oneDNN uses only on
    processors with AMX; that is why the error is measured. "tf32" does nothing without AMX.
    """
    mkldnn: Any = torch.backends.mkldnn  # older versions have no such setting
    matmul = mkldnn.matmul
    before = matmul.fp32_precision
    matmul.fp32_precision = "bf16"
    try:
        yield
    finally:
        matmul.fp32_precision = before


def warn_of_slow_bfloat16(precision: str, device: str) -> None:
    """Say that products in bfloat16 may slow a training down, where the processor has none.

    Args:
        precision: `network.precision`.
        device: `train.device`.
    """
    if precision != "bfloat16" or device != "cpu" or not _CPUINFO.exists():
        return
    if not {"avx512_bf16", "amx_bf16", "bf16"} & set(_CPUINFO.read_text().split()):
        _log.warning(
            "innerattn: warning: network.precision = 'bfloat16': this processor has no "
            "instructions for it; 'float32' may be faster"
        )


def _onednn_is_faster() -> bool:
    return (
        hasattr(torch.backends.mkldnn, "matmul")
        and torch.backends.cpu.get_cpu_capability() == "AVX512"
        and _CPUINFO.exists()
        and "AuthenticAMD" in _CPUINFO.read_text()
    )


def _factors() -> list[tuple[Tensor, Tensor]]:
    source = torch.Generator().manual_seed(0)
    return [
        (
            torch.randn(batch, rows, inner, generator=source),
            torch.randn(batch, columns, inner, generator=source).transpose(1, 2),
        )
        for batch, rows, inner, columns in _PROBES
    ]


def _products() -> list[Tensor]:
    """Products by the library that is in use."""
    return [torch.bmm(left, right) for left, right in _factors()]


def _differ(some: list[Tensor], others: list[Tensor]) -> bool:
    """Whether another library multiplied: two libraries round differently."""
    return not all(map(torch.equal, some, others))


def _error(products: list[Tensor]) -> float:
    """Largest error of a product, as a share of its largest entry, against float64."""
    exact = [torch.bmm(left.double(), right.double()) for left, right in _factors()]
    pairs = zip(products, exact, strict=True)
    return max(float((found - true).abs().max() / true.abs().max()) for found, true in pairs)
