"""Hostile text is refused in no time, and only plain files are read."""

import os
import sys
import time
from pathlib import Path

import pytest

from innerattn.config import Scenario, load_run_config, read_toml, write_toml
from innerattn.config.files import write_in_place, write_whole
from innerattn.config.untrusted import parse_json, read_plain
from innerattn.config.untrusted_toml import parse_toml
from innerattn.errors import ConfigError, RunError

TOML = {
    "a dotted key of 100,000 parts": "a" + 100_000 * ".a" + " = 1",
    "a spaced dotted key": "a" + 100_000 * " . a" + " = 1",
    "a quoted dotted key": '"a"' + 50_000 * '."a"' + " = 1",
    "a dotted header": "[a" + 100_000 * ".b" + "]",
    "a header of headers": "[[a" + 100_000 * ".b" + "]]",
    "an inline dotted key": "x = {a" + 100_000 * ".b" + " = 1}",
    "deep lists": "x = " + 100_000 * "[" + 100_000 * "]",
    "lists deeper than ours": "x = " + 100 * "[" + 100 * "]",
    "deep tables": "x = " + 50_000 * "{a = " + "1" + 50_000 * "}",
    "very many keys": "".join(f"a{number} = 1\n" for number in range(60_000)),
    "very many tables": "".join(f"[a{number}]\n" for number in range(60_000)),
    "a long number": "x = " + 100_000 * "9",
    "a number of 60 digits": "x = " + 60 * "9",
    "a letter a million times": 1_000_000 * "a",
    "dots": 1_000_000 * ".",
    "words and dots without an end": 500_000 * "a.",
    "quotes": 500_000 * '"a',
}


@pytest.mark.parametrize("what", TOML)
def test_hostile_toml_is_refused_at_once(what: str, tmp_path: Path) -> None:
    began = time.monotonic()
    with pytest.raises(ValueError, match=r"."):
        parse_toml(TOML[what])
    file = tmp_path / "file.toml"
    file.write_text(TOML[what])
    for read in (read_toml, Scenario.from_toml, lambda path: load_run_config(config_file=path)):
        with pytest.raises(ConfigError, match=r"file\.toml"):
            read(file)
    assert time.monotonic() - began < 10.0


def test_values_may_hold_dots(tmp_path: Path) -> None:
    text = "x = '" + 100 * "a." + "'\ny = [" + ", ".join(100 * ["0.5"]) + "]\na.b.c.d = 1\n"
    assert parse_toml(text)["a"] == {"b": {"c": {"d": 1}}}
    write_toml(load_run_config(), tmp_path / "config.toml")
    assert read_toml(tmp_path / "config.toml") == load_run_config()


JSON = {
    "deep lists": 1_000_000 * "[",
    "deep lists that end": 100_000 * "[" + 100_000 * "]",
    "lists deeper than ours": 100 * "[" + 100 * "]",
    "deep objects": 100_000 * '{"a":',
    "a key twice after 400,000": "{" + "".join(f'"{n}":1,' for n in range(400_000)) + '"1":1}',
    "all of 400,000 keys twice": "{" + "".join(f'"{n}":1,' for n in range(200_000)) * 2 + '"":1}',
    "a long number": 1_000_000 * "9",
    "a number of 60 digits": 60 * "9",
    "a negative number of 60 digits": "[-" + 60 * "9" + "]",
    "a number past all": "1e999",
    "not a number": '{"a": NaN}',
    "infinity": "[-Infinity]",
    "a key twice": '{"a": 1, "a": 2}',
    "no text": "\x00",
    "nothing": "",
}


@pytest.mark.parametrize("what", JSON)
def test_hostile_json_is_refused_at_once(what: str) -> None:
    began = time.monotonic()
    with pytest.raises(ValueError, match=r"."):
        parse_json(JSON[what])
    assert time.monotonic() - began < 5.0


def test_json_is_read() -> None:
    assert parse_json(b'{"a": [1, -2.5, 1e3, true, null, "x"]}') == {
        "a": [1, -2.5, 1000.0, True, None, "x"]
    }


def test_only_plain_files_of_a_bounded_size_are_read(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"12345")
    assert read_plain(file, 5) == b"12345"
    with pytest.raises(RunError, match=r"file: has 5 bytes: must have at most 4"):
        read_plain(file, 4)
    with file.open("r+b") as large:
        large.truncate(2**40)  # of holes: it takes no room
    with pytest.raises(RunError, match=r"must have at most 1000"):
        read_plain(file, 1000)
    link = tmp_path / "link"
    link.symlink_to(file)
    for path in (link, tmp_path, tmp_path / "nothing", Path("/dev/zero"), Path("/dev/stdin")):
        with pytest.raises(RunError, match="missing, or not a plain file"):
            read_plain(path, 2**41)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no such files")
def test_a_pipe_nobody_writes_to_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    for read in (read_toml, Scenario.from_toml, lambda path: load_run_config(config_file=path)):
        with pytest.raises(ConfigError, match=r"pipe\.toml: missing, or not a plain file"):
            read(pipe)


def test_a_configuration_may_be_a_link(tmp_path: Path) -> None:
    write_toml(load_run_config(), tmp_path / "config.toml")
    (tmp_path / "link.toml").symlink_to(tmp_path / "config.toml")
    assert read_toml(tmp_path / "link.toml") == load_run_config()


def test_a_planted_file_beside_the_one_that_is_written_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = tmp_path / "mine"
    mine.write_text("mine")
    monkeypatch.setattr("secrets.token_hex", lambda _: "0")
    (tmp_path / f".summary.json.{os.getpid()}.0").symlink_to(mine)
    (tmp_path / f".summary.json.{os.getpid()}").symlink_to(mine)
    with pytest.raises(FileExistsError):
        write_whole(tmp_path / "summary.json", b"{}")
    assert mine.read_text() == "mine"
    monkeypatch.undo()
    write_whole(tmp_path / "summary.json", b"{}")
    assert mine.read_text() == "mine"
    assert (tmp_path / "summary.json").read_bytes() == b"{}"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limits")
def test_what_has_no_room_in_place_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    import resource

    file = tmp_path / "state"
    file.write_bytes(b"a" * 60)
    write_in_place(file, b"b" * 80)
    assert file.read_bytes() == b"b" * 80
    write_in_place(file, b"c" * 60)
    assert file.read_bytes() == b"c" * 60
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for room in (30, 70):
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
        try:
            with pytest.raises(OSError, match="state"):
                write_in_place(file, b"d" * 80)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert file.read_bytes() == b"c" * 60
    link = tmp_path / "link"
    link.symlink_to(file)
    with pytest.raises(OSError, match="link"):
        write_in_place(link, b"e")
