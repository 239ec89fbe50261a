"""Instances: what is read, and what is refused with which words."""

import copy
import json
import pickle
from pathlib import Path
from typing import Any

import pytest

from innerattn.config.instances import Instance, named_instance, read_instances
from innerattn.errors import ConfigError

SMALL: dict[str, Any] = {
    "name": "small",
    "speed": 0.5,
    "robots": [
        {"depot": [0.0, 0.0], "skills": [0]},
        {"depot": [1.0, 0.0], "skills": [0, 3]},
    ],
    "tasks": [{"position": [0.5, 0.5], "skills": [0, 3], "duration": 2.0}],
}


def written(tmp_path: Path, *entries: object) -> Path:
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(entries))
    return path


def test_the_published_instances_are_there() -> None:
    found = read_instances("ral")
    assert [instance.name for instance in found] == [f"ral_{n:02d}" for n in range(30)]
    for instance in found:
        assert (len(instance.robots), len(instance.tasks), instance.speed) == (15, 20, 0.2)
        assert instance.lower_bound_milp is not None
        assert instance.makespan_milp_600s is not None
        assert instance.lower_bound_milp < instance.makespan_milp_600s
    mean = sum(instance.makespan_milp_600s or 0.0 for instance in found) / len(found)
    assert mean == pytest.approx(23.924, abs=5e-4)


def test_a_file_is_read_and_its_values_are_kept(tmp_path: Path) -> None:
    (found,) = read_instances(written(tmp_path, SMALL))
    assert json.loads(found.model_dump_json(exclude_none=True)) == SMALL
    assert found == copy.deepcopy(found) == pickle.loads(pickle.dumps(found))
    assert named_instance(str(written(tmp_path, SMALL))) == found
    assert named_instance(f"{written(tmp_path, SMALL)}:small") == found


def changed(*place: str | int, value: object) -> dict[str, Any]:
    """`SMALL` with another value at a place."""
    entry = copy.deepcopy(SMALL)
    inner: Any = entry
    for part in place[:-1]:
        inner = inner[part]
    inner[place[-1]] = value
    return entry


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        (changed("speed", value=0), "small.speed = 0.0: must be 1e-6 to 1000000.0"),
        (changed("speed", value=-1.0), "small.speed = -1.0: must be 1e-6 to"),
        (changed("tasks", 0, "duration", value=-2), "small.tasks[0].duration = -2.0: must be 0.0 "),
        (changed("tasks", 0, "position", value=[0, 2e6]), "small.tasks[0].position = 2000000.0: "),
        (changed("tasks", 0, "position", value=[0]), "small.tasks[0].position[1]: must be given"),
        (changed("robots", 1, "depot", value=[-2e6, 0]), "small.robots[1].depot = -2000000.0: mu"),
        (changed("tasks", 0, "skills", value=[2]), "small.tasks[0].skills = [2]: no robot has sk"),
        (changed("tasks", 0, "skills", value=[]), "small.tasks[0].skills = []: must be 1 to 2 sk"),
        (changed("tasks", 0, "skills", value=[3, 3]), "small.tasks[0].skills = [3, 3]: the team "),
        (changed("tasks", 0, "skills", value=[32]), "small.tasks[0].skills[0] = 32: must be less"),
        (changed("robots", 0, "skills", value=[-1]), "small.robots[0].skills[0] = -1: must be gr"),
        (changed("robots", value=[]), "small.number of robots = 0: must be 1 to 64"),
        (changed("tasks", value=[]), "small.number of tasks = 0: must be 1 to 500"),
        (changed("sped", value=1), "small.sped: unknown key, did you mean speed?"),
        (changed("speed", value="fast"), "small.speed = 'fast': must be a valid number"),
        (changed("name", value="a\nb"), "instances[0].name = 'a\\nb': String should match pattern"),
        ({}, "instances[0].name: must be given; instances[0].speed: must be given"),
        (3, "instances[0] = 3: must be"),
    ],
)
def test_wrong_values_are_named(tmp_path: Path, entry: object, told: str) -> None:
    path = written(tmp_path, entry)
    with pytest.raises(ConfigError) as caught:
        read_instances(path)
    assert told in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_wrong_files_are_named(tmp_path: Path) -> None:
    path = written(tmp_path)
    cases = {
        "[]": "must be a list of one instance or more",
        "{}": "must be a list of one instance or more",
        "[": "is not a JSON file",
        json.dumps([SMALL, SMALL]): "the name 'small' comes 2 times",
        json.dumps([changed("speed", value=float("nan"))]): "is not a JSON file: NaN is not",
        json.dumps([changed("speed", value=0.0)]).replace("0.0", "1e999", 1): "is not a JSON file",
    }
    for text, told in cases.items():
        path.write_text(text)
        with pytest.raises(ConfigError) as caught:
            read_instances(path)
        assert str(caught.value).startswith(f"{path}: {told}"), text
    with pytest.raises(ConfigError, match="rall: missing, or not a plain file, did you mean 'ral'"):
        read_instances("rall")
    with pytest.raises(ConfigError, match="ral: no instance is named 'ral_99', did you mean 'ral_"):
        named_instance("ral:ral_99")
    assert named_instance("ral:ral_07").name == "ral_07"


def test_numbers_that_are_not_finite_are_refused() -> None:
    for value in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="finite number"):
            Instance.model_validate(changed("tasks", 0, "duration", value=value))
