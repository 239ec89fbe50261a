"""Weights come back as they were written, or not at all."""

import json
import pickle
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load, save, save_file

from innerattn.errors import RunError
from innerattn.train.weights import (
    FORMAT,
    SCHEMA_VERSION,
    digest_of,
    read_weights,
    weights_in,
    write_weights,
)

TENSORS = {
    "actor.weight": torch.arange(12, dtype=torch.float32).reshape(3, 4).t(),  # not contiguous
    "actor.bias": torch.tensor([float("nan"), -0.0, 1e-40]),
    "updates": torch.tensor(7),
    "empty": torch.zeros(0, 3),
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "weights.safetensors"
    write_weights(path, TENSORS)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(RunError) as caught:
        read_weights(path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


def test_round_trip_is_exact(file: Path) -> None:
    read = read_weights(file)
    assert read.keys() == TENSORS.keys()
    for name, tensor in TENSORS.items():
        assert read[name].dtype == tensor.dtype
        assert read[name].shape == tensor.shape
        assert read[name].numpy().tobytes() == tensor.contiguous().numpy().tobytes()


def test_writing_leaves_one_file_and_replaces_the_old(file: Path) -> None:
    write_weights(file, {"other": torch.ones(2)})
    assert list(read_weights(file)) == ["other"]
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_every_truncation_is_refused(file: Path) -> None:
    whole = file.read_bytes()
    for length in [*range(0, len(whole), 7), len(whole) - 1]:
        file.write_bytes(whole[:length])
        refusal(file)


def test_every_altered_byte_is_refused_or_harmless(file: Path) -> None:
    whole = file.read_bytes()
    refused = 0
    for place in range(len(whole)):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        try:
            read = read_weights(file)
        except RunError:
            refused += 1
        else:  # what is read is what was written: padding and the like
            assert {name: t.numpy().tobytes() for name, t in read.items()} == {
                name: t.contiguous().numpy().tobytes() for name, t in TENSORS.items()
            }
    assert refused > 0.9 * len(whole)


@pytest.mark.parametrize(
    ("metadata", "reason"),
    [
        (None, "not a file of"),
        ({"format": "pt"}, "not a file of"),
        ({"format": FORMAT, "schema_version": "2"}, "version 2"),
        ({"format": FORMAT, "schema_version": SCHEMA_VERSION}, "digest"),
        ({"format": FORMAT, "schema_version": SCHEMA_VERSION, "sha256": "0" * 64}, "digest"),
    ],
)
def test_foreign_metadata_is_refused(
    tmp_path: Path, metadata: dict[str, str] | None, reason: str
) -> None:
    path = tmp_path / "weights.safetensors"
    save_file({"a": torch.ones(2)}, path, metadata)
    assert reason in refusal(path)


def test_digest_covers_names_and_shapes(file: Path) -> None:
    with safe_open(file, "pt") as opened:
        metadata = opened.metadata()
    tensors = load(file.read_bytes())
    tensors["actor.weights"] = tensors.pop("actor.weight")
    file.write_bytes(save(tensors, metadata))
    assert "digest" in refusal(file)
    tensors["actor.weight"] = tensors.pop("actor.weights").reshape(3, 4)
    file.write_bytes(save(tensors, metadata))
    assert "digest" in refusal(file)


def test_the_same_tensors_have_the_same_digest_whatever_the_file(
    file: Path, tmp_path: Path
) -> None:
    digest, again = digest_of(file), tmp_path / "again.safetensors"
    with safe_open(file, "pt") as opened:
        metadata = opened.metadata()
    for _ in range(8):  # safetensors draws the order of the metadata anew
        again.write_bytes(save({k: v.contiguous() for k, v in TENSORS.items()}, metadata))
        assert digest_of(again) == digest
    write_weights(again, {**TENSORS, "updates": torch.tensor(8)})
    assert digest_of(again) != digest
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(RunError, match="safetensors"):
        digest_of(file)


def test_the_same_tensors_give_the_same_bytes(file: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.safetensors"
    for _ in range(8):
        write_weights(again, dict(reversed(TENSORS.items())))
        assert again.read_bytes() == file.read_bytes()
    header = int.from_bytes(file.read_bytes()[:8], "little")
    assert header % 8 == 0
    write_weights(again, {"größe": torch.ones(2)})
    assert list(read_weights(again)) == ["größe"]


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "weights.safetensors"
    refusal(path)
    path.write_bytes(pickle.dumps({"a": 1}))
    refusal(path)
    path.unlink()
    path.mkdir()
    refusal(path)


def test_a_link_is_refused(file: Path) -> None:
    link = file.with_name("link.safetensors")
    link.symlink_to(file)
    assert "plain file" in refusal(link)


def header(length: int | None = None, **tensors: object) -> bytes:
    own = {"format": FORMAT, "schema_version": SCHEMA_VERSION, "sha256": 64 * "0"}
    text = json.dumps({"__metadata__": own} | tensors).encode()
    return (len(text) if length is None else length).to_bytes(8, "little") + text


def million_tensors() -> bytes:
    empty = {"dtype": "F32", "shape": [0], "data_offsets": [0, 0]}
    return header(**{f"t{i}": empty for i in range(10**6)})


HOSTILE: dict[str, bytes | Callable[[], bytes]] = {
    "nothing": b"",
    "a header of all memory": header(2**62),
    "a header longer than the file": header(2**20),
    "a million tensors": million_tensors,  # takes seconds to make
    "a tensor of all memory": header(
        t={"dtype": "F32", "shape": [2**40], "data_offsets": [0, 2**42]}
    ),
    "a tensor past all numbers": header(
        t={"dtype": "F32", "shape": [2**62, 2**62], "data_offsets": [0, 0]}
    ),
    "tensors in one place": header(
        a={"dtype": "F32", "shape": [0], "data_offsets": [0, 0]},
        b={"dtype": "F32", "shape": [1], "data_offsets": [0, 4]},
    ),
    "deep": header(a=json.loads(60 * "[" + 60 * "]"), data_offsets=[]),
    "metadata of numbers": header(__metadata__=[1]),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_headers_are_refused_at_once(tmp_path: Path, what: str) -> None:
    file = tmp_path / "weights.safetensors"
    content = HOSTILE[what]
    file.write_bytes(content() if callable(content) else content)
    began = time.monotonic()
    with pytest.raises(RunError, match=r"weights\.safetensors: not"):
        read_weights(file)
    assert time.monotonic() - began < 2.0


def test_weights_of_a_policy_are_finite(tmp_path: Path) -> None:
    file = tmp_path / "weights.safetensors"
    write_weights(file, {"a": torch.ones(2), "b": torch.tensor([1.0, float("nan")])})
    with pytest.raises(RunError, match=r"weights\.safetensors: a value of b is not finite"):
        weights_in(file.read_bytes(), file)
