"""`innerattn page`: which file the command writes, and what it refuses."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from team_of_any import TEAM

from innerattn.cli.main import main


def given(path: Path) -> dict[str, Any]:
    """What the page's world begins with."""
    found = re.search(
        r'<script id="given" type="application/json">(.*?)</script>', path.read_text()
    )
    assert found is not None
    document: dict[str, Any] = json.loads(found[1])
    return document


def test_a_team_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "team.html"
    words = ["--preset", "mixed-faults", "--seed", "3"]
    assert main(["page", "zoo:mixed-faults", "-o", str(out), *words]) == 0
    size = out.stat().st_size
    assert size < 3_000_000
    assert capsys.readouterr().out == f"{out}: mixed-faults, {size / 1e6:.1f} MB\n"
    found = given(out)
    assert [one["name"] for one in found["policies"]] == [
        *("mixed-faults", "random", "greedy", "hungarian")
    ]
    assert found["seed"] == str(2**63 + 3)
    scenario = json.loads(found["scenario"])
    assert scenario["faults"]
    assert scenario["episode_steps"] == 1_000_000
    assert "http" not in re.sub(
        r"http-equiv|www\.w3\.org", "", out.read_text().split('id="given"')[0]
    )


def test_a_run_and_a_script_are_written(run_dir: Path, tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    assert main(["page", str(run_dir), "-o", str(out)]) == 0
    assert given(out)["policies"][0]["name"] == run_dir.name
    assert main(["page", "random", "-o", str(out), "--preset", "air-ground"]) == 0
    assert [one["name"] for one in given(out)["policies"]] == ["random"]
    assert len(given(out)["worlds"]["layers"]) == 2
    assert main(["page", "greedy", str(run_dir), "-o", str(out)]) == 0
    assert len(given(out)["worlds"]["robots"]) == 4, "a team for one size takes nobody in"


@pytest.mark.parametrize("name", ["flood", "rovers"])
def test_a_team_comes_first_where_a_page_has_no_script_but_random(
    tmp_path: Path, name: str
) -> None:
    out = tmp_path / "page.html"
    assert main(["page", f"zoo:{name}", "-o", str(out)]) == 0
    assert [one["name"] for one in given(out)["policies"]] == [name, "random"]


def test_a_policy_for_any_team_is_written_for_the_team_of_a_file(tmp_path: Path) -> None:
    out, file = tmp_path / "team.html", tmp_path / "team.toml"
    page = (Path(__file__).parents[2] / "docs" / "teams.md").read_text("utf-8")
    file.write_text(page.split("```toml\n")[1].split("```")[0])
    assert main(["page", "zoo:any", "--scenario", str(file), "-o", str(out)]) == 0
    found = given(out)
    assert [one["name"] for one in found["policies"]] == ["any", "random", "greedy", "hungarian"]
    robots = [one["name"] for one in found["worlds"]["robots"] if "is_spare" not in one]
    assert robots == [one.name for one in TEAM.robots]
    assert len(found["policies"][0]["team"]["known"]["bodies"]) == 11
    words = ["--scenario", str(file), "--spare", "0", "-o", str(out)]
    assert main(["page", "zoo:any", "hungarian", *words]) == 0
    found = given(out)
    assert len(found["policies"][0]["team"]["known"]["bodies"]) == 5
    assert not any("is_spare" in one for one in found["worlds"]["robots"])
    assert json.loads(found["scenario"])["unavailable_robots"] == "stay"


def test_two_policies_stand_side_by_side(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "two.html"
    assert main(["page", "greedy", str(run_dir), "-o", str(out)]) == 0
    assert f": greedy beside {run_dir.name}, " in capsys.readouterr().out
    assert f'data-beside="{run_dir.name}"' in out.read_text()
    names = [one["name"] for one in given(out)["policies"]]
    assert names == ["greedy", run_dir.name, "random", "hungarian"]
    copy = Path(shutil.copytree(run_dir, tmp_path / "copy" / run_dir.name))
    assert main(["page", str(run_dir), str(copy), "-o", str(out)]) == 0
    names = [one["name"] for one in given(out)["policies"]]
    assert names[:2] == [str(run_dir), str(copy)]
    assert main(["page", "greedy", "greedy", "-o", str(out)]) == 0
    assert 'data-beside="greedy"' in out.read_text()
    assert main(["page", "greedy", "-o", str(out)]) == 0
    assert 'data-beside=""' in out.read_text()


@pytest.mark.long
@pytest.mark.parametrize("team", ["mixed", "any"])
def test_a_team_of_the_package_needs_no_torch(tmp_path: Path, team: str) -> None:
    out = str(tmp_path / "a.html")
    code = (
        "import sys\n"
        "from innerattn.cli.main import main\n"
        f"code = main(['page', 'zoo:{team}', '-o', {out!r}])\n"
        "sys.exit(code or bool({'torch', 'onnx', 'safetensors'} & sys.modules.keys()))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_wrong_use(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "other.toml"
    other.write_text("max_victims = 5\n")
    cases = [
        (1, ["nobody"], "nobody: neither a run's folder nor one of random, greedy, hungarian"),
        (2, ["random", "greedy", "hungarian"], "3 policies: must be 1 or 2 of RUN|POLICY"),
        (1, ["random", "oracle"], "oracle: a page has no such script"),
        (1, ["zoo:mixed", "zoo:mixed-8"], "was trained for other observations"),
        (1, ["oracle"], "oracle: a page has no such script"),
        (1, ["zoo:any", "--preset", "mixed-sight"], "policies for any team see everything"),
        (1, [str(tmp_path)], f"{tmp_path}/run.json: missing"),
        (2, ["random", "--spare", "-1"], "--spare -1: must be 0 to 63"),
        (
            1,
            ["random", "--spare", "21"],
            "--spare 21: scenario.robots (their number) = 67: must be",
        ),
        (1, ["random", str(run_dir), "--spare", "1"], "--spare 1: must be 0 with "),
        (2, ["random", "--seed", "-1"], "--seed -1: must be 0 to 2**63 - 1"),
        (2, ["random", "-o", "page.gif"], "-o page.gif: must end in .html"),
        (1, ["random", "-o", str(tmp_path / "none" / "page.html")], "none: no such folder"),
        (1, ["random", "--preset", "mxied"], "mxied"),
        (1, ["greedy", "--preset", "air-ground"], "greedy: a page has no such script here"),
        (1, ["random", "--scenario", "none.toml"], "none.toml"),
        (2, ["random", "--preset", "mixed", "--scenario", str(other)], "only one of them"),
        (1, [str(run_dir), "--scenario", str(other)], "was trained for other observations"),
    ]
    for code, options, message in cases:
        options = options if "-o" in options else [*options, "-o", str(tmp_path / "page.html")]
        assert main(["page", *options]) == code, options
        captured = capsys.readouterr()
        assert message in captured.err
        assert captured.err.count(os.linesep) == 1
        assert not captured.out
    assert not (tmp_path / "page.html").exists()
