import pytest
import torch

from innerattn.train import matmul_backend


def test_the_library_in_use_is_named_and_exact() -> None:
    with matmul_backend.best_matmul_backend() as used:
        name, error = used.split(", error ")
        assert name in ("default", "onednn")
        assert 0.0 < float(error.split(" ")[0]) < 1e-5


def test_onednn_is_exact_and_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matmul_backend, "_onednn_is_faster", lambda: True)
    before = torch.backends.mkldnn.matmul.fp32_precision
    with matmul_backend.best_matmul_backend() as used:
        assert torch.backends.mkldnn.matmul.fp32_precision == "tf32"
    assert used.startswith("onednn, error ")
    assert torch.backends.mkldnn.matmul.fp32_precision == before


def test_a_backend_that_is_not_exact_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matmul_backend, "_onednn_is_faster", lambda: True)
    monkeypatch.setattr(matmul_backend, "_LARGEST_ERROR", 0.0)
    before = torch.backends.mkldnn.matmul.fp32_precision
    with matmul_backend.best_matmul_backend() as used:
        assert torch.backends.mkldnn.matmul.fp32_precision == before
    assert used.startswith("default, error ")
    assert "onednn" in used
