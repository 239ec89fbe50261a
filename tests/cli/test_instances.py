"""Instances in `innerattn evaluate`, `innerattn info` and `innerattn replay`."""

import json
from pathlib import Path
from typing import Any

import pytest

from innerattn.cli.main import main
from innerattn.config import Scenario
from innerattn.config.instances import read_instances, read_worlds
from innerattn.policies.scripted.planner import schedule_by

Captured = pytest.CaptureFixture[str]
RAL = read_instances("ral")


def document(capsys: Captured, policy: str, *options: str) -> dict[str, Any]:
    assert main(["evaluate", policy, *options, "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("policy", ["planner", "guided", "learnt", "greedy", "random"])
def test_the_document_has_every_instance(policy: str, capsys: Captured) -> None:
    found = document(capsys, policy, "--instances", "ral", "--time-limit-ms", "2", "--seed", "4")
    assert (found["schema_version"], found["policy"], found["seed"]) == (1, policy, 4)
    assert found["time_limit_ms"] == (2 if policy in ("planner", "guided") else None)
    instances = read_instances("ral")
    assert [one["name"] for one in found["instances"]] == [one.name for one in instances]
    for one, instance in zip(found["instances"], instances, strict=True):
        assert one["published_makespan"] == instance.makespan_milp_600s
        assert one["lower_bound"] == instance.lower_bound_milp <= one["makespan"]
        assert one["seconds"] > 0.0
        if policy not in ("planner", "guided"):
            assert one["makespan"] == schedule_by(policy, instance, 0.0, 4).makespan
    makespans = [one["makespan"] for one in found["instances"]]
    assert found["mean_makespan"] == pytest.approx(sum(makespans) / 30)
    assert found["published_mean_makespan"] == pytest.approx(23.9242, abs=1e-4)
    ratio = found["mean_makespan"] / found["published_mean_makespan"]
    assert found["ratio"] == pytest.approx(ratio)


@pytest.mark.parametrize("policy", ["planner", "guided"])
def test_a_number_of_orders_gives_the_same_schedules(policy: str, capsys: Captured) -> None:
    words = ("--instances", "ral", "--evaluations", "400")
    found, again = (document(capsys, policy, *words) for _ in range(2))
    assert (found["evaluations"], found["time_limit_ms"]) == (400, None)
    for one, other in zip(found["instances"], again["instances"], strict=True):
        assert one["makespan"] == other["makespan"]


def test_instances_without_published_values(tmp_path: Path, capsys: Captured) -> None:
    table = read_instances("ral")[0].model_dump(mode="json")
    table |= {"makespan_milp_600s": None, "lower_bound_milp": None}
    path, results = tmp_path / "mine.json", tmp_path / "found.json"
    path.write_text(json.dumps([table]))
    words = ["evaluate", "greedy", "--instances", str(path)]
    assert main([*words, "--json", str(results)]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if "greedy" in line]
    assert row.split()[:5] == ["greedy", "1", "30.01", "-", "-"]
    found = json.loads(results.read_text())
    assert (found["ratio"], found["published_mean_makespan"]) == (None, None)
    assert found["instances"][0]["published_makespan"] is None
    assert main([*words, "--quiet"]) == 0
    assert capsys.readouterr().out == "greedy: mean makespan 30.01, 1 instance\n"


def test_the_table_fits_a_terminal(capsys: Captured) -> None:
    assert main(["evaluate", "planner", "--instances", "ral", "--time-limit-ms", "3"]) == 0
    printed = capsys.readouterr().out
    assert "23.92" in printed
    assert max(map(len, printed.splitlines())) <= 80


def test_wrong_words(tmp_path: Path, capsys: Captured) -> None:
    bad = tmp_path / "bad.json"
    bad.write_text("[{}]")
    cases = [
        (2, "greedy --time-limit-ms 3", "--time-limit-ms: needs --instances"),
        (2, "gredy --instances ral", "gredy: with --instances must be one of planner, guided, le"),
        (2, "greedy:a --instances ral", "greedy:a: only learnt and guided take a file"),
        (2, "learnt: --instances ral", "learnt:: needs a file after the colon, or no colon"),
        (1, "guided:none.bin --instances ral", "none.bin: missing, or not a plain file"),
        (2, "planner --instances ral --episodes 3", "--episodes: has no meaning with --instances"),
        (2, "planner --instances ral --time-limit-ms 0", "--time-limit-ms 0: must be 1 to 8640000"),
        (
            2,
            "planner --instances ral --evaluations 0",
            "--evaluations 0: must be 1 to 10",
        ),
        (2, "planner --evaluations 9", "--evaluations: needs --instances"),
        (
            2,
            "planner --instances standard --evaluations 9",
            "--evaluations: has no meaning",
        ),
        (2, "planner --instances ral --seed -1", "--seed -1: must be 0 to 2**63 - 1"),
        (1, "planner --instances rall", "rall: missing, or not a plain file, did you mean 'ral'?"),
        (1, f"planner --instances {bad}", f"{bad}: instances[0].name: must be given"),
    ]
    for code, line, told in cases:
        assert main(["evaluate", *line.split()]) == code, line
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith(f"innerattn: error: {told}"), err
        assert err.count("\n") == 1


def test_an_instance_is_described(tmp_path: Path, capsys: Captured) -> None:
    tiny = {
        "name": "tiny",
        "speed": 1.0,
        "robots": [{"depot": [0.0, 0.0], "skills": [0, 1]}] * 2,
        "tasks": [{"position": [3.0, 4.0], "skills": [0, 1], "duration": 2.0}],
    }
    path = tmp_path / "mine.json"
    path.write_text(json.dumps([tiny]))
    assert main(["info", "--instance", f"{path}:tiny"]) == 0
    rows = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert rows == {
        "instance": "tiny",
        "robots": "2, speed 1",
        "skills": "0 (2), 1 (2) (robots that have it)",
        "tasks": "1, each for 2 to 2 robots, 2.00 of work for each robot",
        "published": "makespan -, lower bound -",
        "planner": "makespan 12.00",
    }
    assert main(["info", "--instance", "ral:ral_77"]) == 1
    assert "ral: no instance is named 'ral_77', did you mean" in capsys.readouterr().err


def packed(path: Path) -> dict[str, Any]:
    """What the page of a schedule holds."""
    mark = '<script type="application/json" id="data">'
    found = json.loads(path.read_text("utf-8").split(mark, 1)[1].split("</script>", 1)[0])
    assert isinstance(found, dict)
    return found


def test_a_schedule_is_replayed(
    tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    instances = read_instances("ral")
    assert main(["replay", "random", "--instance", "ral:ral_04", "--seed", "7"]) == 0
    page = tmp_path / "replay.html"
    makespan = schedule_by("random", instances[4], 0.0, 7).makespan
    assert packed(page)["makespan"] == makespan
    ratio = makespan / (instances[4].makespan_milp_600s or 0.0)
    assert capsys.readouterr().out == (
        f"replay.html: ral_04, random, makespan {makespan:.2f}, "
        f"published {instances[4].makespan_milp_600s:.2f}, ratio {ratio:.3f}\n"
    )
    other = tmp_path / "other.html"
    words = ["replay", "--instance", "ral", "--time-limit-ms", "3", "-o", str(other)]
    assert main(words) == 0
    assert "ral_00, planner, makespan " in capsys.readouterr().out
    greedy = schedule_by("greedy", instances[0], 0.0, 0)
    assert packed(other)["makespan"] <= greedy.makespan
    assert sorted(tmp_path.iterdir()) == [other, page]


def test_wrong_words_for_a_replay(tmp_path: Path, capsys: Captured) -> None:
    most = 86_400_000
    cases = [
        (2, "greedy --time-limit-ms 3", "--time-limit-ms: needs --instance"),
        (2, "gredy --instance ral", "gredy: with --instance must be one of planner, guided, lea"),
        (2, "greedy random --instance ral", "2 policies: with --instance must be one"),
        (2, "--instance ral --episodes 3", "--episodes: has no meaning with --instance"),
        (2, "--instance ral --scenario x.toml", "--scenario: has no meaning with --instance"),
        (2, "--instance ral --robot a", "--robot: has no meaning with --instance"),
        (2, "--instance ral --episode 0", "--episode: has no meaning with --instance"),
        (2, f"--instance ral --time-limit-ms {most + 1}", "--time-limit-ms 86400001: must be 1 to"),
        (2, "--instance ral --seed -1", "--seed -1: must be 0 to 2**63 - 1"),
        (2, "--instance ral -o x.gif", "-o x.gif: with --instance must end in .html"),
        (2, "--instance ral -o x.mp4", "-o x.mp4: with --instance must end in .html"),
        (1, "--instance ral:ral_77", "ral: no instance is named 'ral_77', did you mean"),
        (1, "--instance rall", "rall: missing, or not a plain file, did you mean 'ral'?"),
        (1, f"--instance ral -o {tmp_path}/no/x.html", f"{tmp_path}/no: no such folder"),
    ]
    out = tmp_path / "out.html"
    for code, line, told in cases:
        target = [] if " -o " in line else ["-o", str(out)]
        assert main(["replay", *line.split(), *target]) == code, line
        printed, err = capsys.readouterr()
        assert printed == ""
        assert err.startswith(f"innerattn: error: {told}"), err
        assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_schedules_are_played_with_bodies(tmp_path: Path, capsys: Captured) -> None:
    path = tmp_path / "two.json"
    entries = [one.model_dump(mode="json") for one in read_instances("ral")[:2]]
    path.write_text(json.dumps(entries))
    words = ("--instances", str(path))
    points = document(capsys, "greedy", *words)
    bodies = document(capsys, "greedy", *words, "--engine", "rapier")
    assert (points["engine"], bodies["engine"]) == (None, "rapier")
    for one, other in zip(points["instances"], bodies["instances"], strict=True):
        assert one["makespan"] != other["makespan"] == pytest.approx(one["makespan"], rel=0.03)
        assert one["is_done"]
        assert other["is_done"]
    assert main(["evaluate", "greedy", *words, "--engine", "discs"]) == 0
    assert "by robots with bodies (engine discs)" in " ".join(capsys.readouterr().out.split())
    assert main(["evaluate", "greedy", "--engine", "discs"]) == 2
    assert "--engine: needs --instances" in capsys.readouterr().err


def test_a_schedule_is_shown_as_robots_with_bodies_carry_it_out(
    tmp_path: Path, capsys: Captured
) -> None:
    words = ["replay", "greedy", "--instance", "ral:ral_03", "-o", str(tmp_path / "page.html")]
    assert main([*words, "--engine", "discs"]) == 0
    makespan = float(capsys.readouterr().out.split()[-1])
    assert makespan == pytest.approx(schedule_by("greedy", RAL[3], 0.0, 0).makespan, rel=0.03)
    page = (tmp_path / "page.html").read_text()
    assert "Replay of greedy" in page
    for line, told in (
        ("replay greedy --engine discs", "--engine: needs --instance"),
        (f"replay greedy --engine discs --instance {tiny(tmp_path)}", "--engine: has no meaning"),
    ):
        assert main(line.split()) == 2
        assert told in capsys.readouterr().err


def tiny(folder: Path) -> Path:
    """A file with the first two worlds of the set."""
    path = folder / "tiny.json"
    path.write_text(json.dumps([one.written() for one in read_worlds("standard")[:2]]))
    return path


def test_a_script_is_measured_in_worlds(tmp_path: Path, capsys: Captured) -> None:
    path = tiny(tmp_path)
    found = document(capsys, "hungarian", "--instances", str(path))
    worlds = read_worlds(path)
    assert [one["name"] for one in found["instances"]] == [one.name for one in worlds]
    assert (found["policy"], found["seed"], found["played"]) == ("hungarian", 0, 2)
    makespans = [one["makespan"] for one in found["instances"]]
    assert found["mean_makespan"] == pytest.approx(sum(makespans) / 2)
    assert main(["evaluate", "hungarian", "--instances", str(path)]) == 0
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= 80
    assert "score 1 is as good" in " ".join(printed.split()).replace("score: ", "score ")
    assert main(["evaluate", "hungarian", "--instances", str(path), "--quiet"]) == 0
    line = capsys.readouterr().out
    assert line.startswith("hungarian: score ")
    assert line.endswith(", 2 worlds\n")
    assert main(["evaluate", "greedy", "--instances", str(path), "--time-limit-ms", "3"]) == 2
    assert "--time-limit-ms: has no meaning in worlds" in capsys.readouterr().err


def test_a_world_is_described_and_replayed(
    tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tiny(tmp_path)  # it is read quicker than the set
    world = read_worlds(path)[1]
    assert main(["info", "--instance", f"standard:{world.name}"]) == 0
    text = capsys.readouterr().out
    assert text.splitlines()[-1].startswith(f"# {world.name}: 2 robots, 6 victims; ")
    (tmp_path / "world.toml").write_text(text)
    assert Scenario.from_toml("world.toml") == world.scenario
    words = ["--instance", f"{path}:{world.name}"]
    assert main(["replay", "hungarian", "greedy", *words]) == 0
    assert "replay.html: 1 episode, " in capsys.readouterr().out
    assert main(["replay", "hungarian", *words, "--scenario", "world.toml"]) == 2
    assert "--scenario: has no meaning with --instance" in capsys.readouterr().err
    assert main(["replay", "hungarian", *words, "--time-limit-ms", "5"]) == 2
    assert "--time-limit-ms: has no meaning in worlds" in capsys.readouterr().err
