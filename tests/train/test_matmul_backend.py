import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import torch

from innerattn.train import matmul_backend
from innerattn.train.matmul_backend import chosen_matmul_backend

WHO_MULTIPLIES = """
import torch
from innerattn.train.matmul_backend import chosen_matmul_backend

left, right = torch.randn(4, 512, 44), torch.randn(4, 44, 64)
with chosen_matmul_backend("auto") as used:
    print("innerattn:", used, flush=True)
    torch.bmm(left, right)
"""


def setting() -> str:
    return str(torch.backends.mkldnn.matmul.fp32_precision)


@contextmanager
def rounded_to_bfloat16() -> Iterator[None]:
    """What oneDNN would do on a processor that has instructions for bfloat16 matrices."""
    bmm = torch.bmm

    def rounded(left: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
        return bmm(left.bfloat16().float() if left.dtype == torch.float32 else left, right)

    torch.bmm = rounded
    try:
        yield
    finally:
        torch.bmm = bmm


@contextmanager
def nothing() -> Iterator[None]:
    yield


@pytest.mark.parametrize("choice", ["auto", "default"])
def test_the_library_in_use_is_named_and_exact(choice: str) -> None:
    with chosen_matmul_backend(choice) as used:
        name, error = used.split(", error ")
        assert name in ("default", "onednn")
        assert 0.0 < float(error.split(" ")[0]) < 1e-5


def test_default_leaves_the_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matmul_backend, "_onednn_is_faster", lambda: True)
    before = setting()
    with chosen_matmul_backend("default") as used:
        assert setting() == before
        assert used.startswith("default, error ")


def test_the_setting_is_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matmul_backend, "_onednn_is_faster", lambda: True)
    before = setting()
    with chosen_matmul_backend("auto") as used:
        assert (setting() == "bf16") == used.startswith("onednn, error ")
    assert setting() == before


def test_a_library_that_is_not_exact_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matmul_backend, "_onednn_is_faster", lambda: True)
    monkeypatch.setattr(matmul_backend, "onednn", rounded_to_bfloat16)
    bmm = torch.bmm
    with chosen_matmul_backend("auto") as used:
        assert torch.bmm is bmm
    assert used.startswith("default, error ")
    assert "(onednn " in used
    assert float(used.split("(onednn ")[1].rstrip(")")) > 1e-3


def test_a_setting_that_does_nothing_is_not_named_onednn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matmul_backend, "_onednn_is_faster", lambda: True)
    monkeypatch.setattr(matmul_backend, "onednn", nothing)
    with chosen_matmul_backend("auto") as used:
        assert used.startswith("default, error ")
        assert used.endswith(" (onednn not in use)")


@pytest.mark.parametrize(
    ("flags", "precision", "device", "warns"),
    [
        ("fma avx2", "bfloat16", "cpu", True),
        ("fma avx512_bf16", "bfloat16", "cpu", False),
        ("amx_bf16", "bfloat16", "cpu", False),
        ("asimd bf16", "bfloat16", "cpu", False),
        ("fma avx2", "bfloat16", "cuda", False),
        ("fma avx2", "float32", "cpu", False),
    ],
)
def test_bfloat16_where_it_is_slow_is_warned_of(
    flags: str,
    precision: str,
    device: str,
    warns: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text(f"flags : {flags}\n")
    monkeypatch.setattr(matmul_backend, "_CPUINFO", info)
    matmul_backend.warn_of_slow_bfloat16(precision, device)
    assert ("network.precision = 'bfloat16'" in caplog.text) == warns


@pytest.mark.long
def test_the_library_that_is_named_multiplies() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WHO_MULTIPLIES],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"ONEDNN_VERBOSE": "1"},
    )
    after = done.stdout.split("innerattn: ")[1]
    lines = [line for line in after.splitlines() if ",exec,cpu,matmul," in line]
    assert (len(lines) == 1) == after.startswith("onednn, error ")
    assert all("4x512x44:4x44x64" in line for line in lines)
