"""Files at the limits of what is read: no time, memory or message grows out of proportion."""

import hashlib
import json
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from innerattn.config.untrusted import MOST_TOML_BYTES, parse_json
from innerattn.config.untrusted_toml import parse_toml
from innerattn.errors import ConfigError, RunError, UnsealedRunWarning
from innerattn.experiments.live import read_live
from innerattn.records.logged import logged_lines
from innerattn.records.run_folder import config_in
from innerattn.train.checkpoint_info import MOST_BYTES, checkpoint_info

TIMES = 20
"""Most bytes of memory for each byte of a file, past what is free."""
FREE = 32 << 20
SIZE = 3_000_000

VALUES = {
    "lists": "[]",
    "objects": "{}",
    "nested": "[[[[]]]]",
    "pairs": '["ab","cd"]',
    "numbers": "0.5",
    "digits": "1",
    "large": "12345",
    "words": '"ab"',
    "named": '{"a":1}',
    "rows": "[0.123456789,0.123456789]",
    "losses": '{"policy_loss":0.123456789}',
}


def peak(text: str) -> tuple[int, str]:
    """Most memory that reading a JSON text takes [bytes], and why it was refused."""
    data, refused = text.encode(), ""
    tracemalloc.start()
    try:
        parse_json(data)
    except ValueError as error:
        refused = str(error)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most, refused


@pytest.mark.long
@pytest.mark.parametrize("value", VALUES)
def test_no_json_takes_more_than_its_share_of_memory(value: str) -> None:
    one = VALUES[value]
    text = "[" + ",".join([one] * (SIZE // (len(one) + 1))) + "]"
    most, refused = peak(text)
    assert most <= max(FREE, TIMES * len(text))
    ours = value in ("rows", "losses", "numbers", "large")
    assert not refused if ours else "bytes of memory" in refused or most <= TIMES * len(text)


def test_names_of_a_large_object_take_their_share() -> None:
    tiny = "{" + ",".join(f'"{number:x}":1' for number in range(SIZE // 9)) + "}"
    assert "bytes of memory" in peak(tiny)[1]
    files = {f"records/{number}.parquet": {"sha256": "0" * 64} for number in range(SIZE // 100)}
    most, refused = peak(json.dumps(files))
    assert not refused
    assert most < TIMES * SIZE


TABLES = {
    "keys": "".join(f"k{number}=1\n" for number in range(19_000)),
    "tables": "".join(f"[t{number}]\n" for number in range(19_000)),
    "lists": "a=[" + "[]," * 19_000 + "]",
    "dotted": "".join(f"a.b.c.d.e.f.g.h.i.j.k.l.m.n.k{number}=1\n" for number in range(19_000)),
    "comments": "#\n" * (MOST_TOML_BYTES // 2),
    "quoted": "".join(f'"{"x" * 40}{number}"=1\n' for number in range(19_000)),
}


@pytest.mark.long
@pytest.mark.parametrize("table", TABLES)
def test_tables_at_their_limits_take_their_share(table: str) -> None:
    text = TABLES[table]
    assert len(text) <= MOST_TOML_BYTES
    tracemalloc.start()
    parse_toml(text)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most <= FREE


def test_a_table_of_more_values_is_refused() -> None:
    with pytest.raises(ValueError, match="more than 20000 keys, tables or values of lists"):
        parse_toml("a=[" + "1," * 20_001 + "]")


CONFIGS = {
    "unknown": "[train]\n" + "".join(f"k{number}=1\n" for number in range(19_000)),
    "missing": "[[scenario.robots]]\n" * 9_000,
    "long key": f"[train]\n{'x' * 1_000_000}=1\n",
    "long word": f'[train]\nmethod="{"x" * 1_000_000}"\n',
    "long name": f'[[scenario.robots]]\nname="{"x" * 1_000_000}"\nkind="a"\nabilities=["a"]\n'
    "max_speed_mps=1\nmass_kg=1\n",
}


@pytest.mark.parametrize("config", CONFIGS)
def test_no_message_is_as_long_as_a_file(config: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        config_in(CONFIGS[config].encode(), tmp_path / "config.toml")
    said = str(caught.value)
    assert len(said) < 5_000
    assert "\n" not in said
    if config == "unknown":
        assert said.endswith("train.k9: unknown key; and 18,990 more")


def test_a_line_of_metrics_has_a_length(run_dir: Path, tmp_path: Path) -> None:
    line = (run_dir / "metrics.jsonl").read_bytes().splitlines(keepends=True)[0]
    assert [found["env_steps"] for found in logged_lines(line + line)]
    long = b"[" + b"0.5," * (1 << 18) + b"0.5]\n"
    with pytest.raises(
        ValueError, match=r"line 2 has 1,\d+,\d+ bytes: must have at most 1,048,576"
    ):
        list(logged_lines(line + long))
    for name in ("run.json", "config.toml"):
        (tmp_path / name).write_bytes((run_dir / name).read_bytes())
    info = json.loads((tmp_path / "run.json").read_text()) | {"sealed": False}
    (tmp_path / "run.json").write_text(json.dumps(info))
    (tmp_path / "metrics.jsonl").write_bytes(line + long)
    with (
        pytest.warns(UnsealedRunWarning),
        pytest.raises(RunError, match="not the metrics of a run"),
    ):
        read_live(tmp_path)


SEGMENT = {"first": 0, "count": 1, "sha256": "0" * 64}
CHECKPOINTS: dict[str, tuple[Callable[[], dict[str, object]], str]] = {
    "segments": (lambda: {"rows": {"replay": {"seen": 1, "segments": [SEGMENT] * 49_000}}}, ""),
    "bad segments": (
        lambda: {"rows": {"replay": {"seen": 1, "segments": [{"a": 1}] * 49_000}}},
        "rows.replay.segments.0.first: Field required",
    ),
    "memories": (
        lambda: {"rows": {f"r{n}": {"seen": 1, "segments": [SEGMENT]} for n in range(50_000)}},
        "50,000 keys in one place: must be at most 1,000",
    ),
    "metrics": (
        lambda: {"counters": {"step_metrics": {f"m{n}": "a" for n in range(300_000)}}},
        "300,000 keys in one place",
    ),
    "unknown": (lambda: {f"k{n}": 1 for n in range(300_000)}, "keys in one place"),
}


@pytest.mark.long
@pytest.mark.parametrize("what", CHECKPOINTS)
def test_checkpoints_at_their_limits_take_their_share(what: str) -> None:
    changed, message = CHECKPOINTS[what]
    zeros = {f"{name}_sha256": "0" * 64 for name in ("config", "weights", "state", "metrics")}
    document = {"schema_version": 1, "counters": {}, "rows": {}, "metrics_bytes": 0, **zeros}
    document |= changed()
    text = json.dumps(document, sort_keys=True)
    document["sha256"] = hashlib.sha256(text.encode()).hexdigest()
    data = json.dumps(document).encode()
    assert len(data) <= MOST_BYTES
    tracemalloc.start()
    try:
        checkpoint_info(data)
        said = ""
    except ValueError as error:
        said = str(error)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert message in said
    assert bool(message) == bool(said)
    assert most <= max(FREE, TIMES * len(data))


LOAD = """
import resource, sys, warnings
warnings.simplefilter("ignore")
from innerattn.errors import InnerattnError
from innerattn.train import load_policy
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    load_policy(sys.argv[1])
except InnerattnError as error:
    print(error)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.long
def test_networks_are_measured_before_they_are_made(run_dir: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    newest = (run_dir / "checkpoints" / "latest").read_text().strip()
    weights = f"checkpoints/{newest}/weights.safetensors"
    (run / weights).parent.mkdir(parents=True)
    for name in ("run.json", "config.toml", "checkpoints/latest", weights):
        (run / name).write_bytes((run_dir / name).read_bytes())
    info = json.loads((run / "run.json").read_text()) | {"sealed": False}
    (run / "run.json").write_text(json.dumps(info))
    config = (run / "config.toml").read_text()
    changed = [
        "hidden_width = 4096" if line.startswith("hidden_width = ") else line
        for line in config.splitlines()
    ]
    assert changed != config.splitlines()
    (run / "config.toml").write_text("\n".join(changed))
    done = subprocess.run(
        [sys.executable, "-c", LOAD, str(run)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    said, kilobytes = done.stdout.splitlines()
    assert f"{weights}: holds " in said
    assert "numbers; the networks of config.toml have at least " in said
    assert int(kilobytes) < 300_000  # as made, they take over 3,000,000
