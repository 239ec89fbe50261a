"""`innerattn export`: what it prints, and what it refuses in one line."""

import shutil
from pathlib import Path

import pytest

from innerattn.cli.main import main
from innerattn.policies import Exported
from innerattn.records.run_files import RunFiles


@pytest.fixture
def run(run_dir: Path, tmp_path: Path) -> Path:
    """A trained run that may be changed."""
    return Path(shutil.copytree(run_dir, tmp_path / "run"))


@pytest.mark.long
def test_a_trained_run_is_exported_into_its_folder(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(run)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    lines = out.splitlines()
    assert lines[0].startswith(f"{run / 'export'}: 4 robots, 4 ONNX files, ")
    assert lines[-2].startswith("checked on 10,000 played observations: same greedy action in ")
    assert lines[-1].startswith("largest difference: ")
    team = Exported(run / "export")
    assert (team.name, team.backend) == ("td-inner", "onnxruntime")
    assert b"weights" in RunFiles(run).read("export/contract.json", 1 << 20)  # sealed again
    assert main(["export", str(run)]) == 1
    assert capsys.readouterr().err == (
        f"innerattn: error: {run / 'export'}: is already there; -o names another folder\n"
    )


def test_wrong_runs(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(run / "checkpoints")
    cases = [
        ("nothing", f"{tmp_path / 'nothing'}: no such run folder"),
        ("run", f"{run}: holds no checkpoint yet"),
    ]
    for name, message in cases:
        assert main(["export", str(tmp_path / name), "-o", str(tmp_path / "out")]) == 1
        err = capsys.readouterr().err
        assert err == f"innerattn: error: {message}\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("library", ["onnx", "onnxscript", "onnxruntime"])
def test_a_missing_library_is_named_with_its_extra(
    run: Path, library: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def find(name: str) -> object:
        return None if name == library else name

    monkeypatch.setattr("innerattn.train.export.write.find_spec", find)
    assert main(["export", str(run)]) == 1
    assert capsys.readouterr().err == (
        f"innerattn: error: innerattn export needs {library}: pip install 'innerattn[deploy]'\n"
    )


def test_a_policy_for_any_team_is_exported_for_the_team_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    robots = """robots = [
  { name = "a", kind = "a", abilities = ["see"], max_speed_mps = 1.0, mass_kg = 1.0%s },
  { name = "b", kind = "b", abilities = ["lift"], max_speed_mps = 0.7, mass_kg = 1.2 },
]
tasks = [{ name = "both", needs = ["see", "lift"] }]
situation = "single"
"""
    file, folder = tmp_path / "two.toml", tmp_path / "out"
    file.write_text(robots % "")
    words = ["export", "zoo:any", "--scenario", str(file), "-o", str(folder)]
    assert main(words) == 0
    out, err = capsys.readouterr()
    assert err == ""
    lines = out.splitlines()
    assert lines[0] == f"{folder}: 2 robots, 1 ONNX file, 0.4 MB"
    assert lines[-1].startswith("largest difference: ")
    assert lines[-1].endswith(" in numpy")
    assert Exported(folder).robot_names == ("a", "b")
    monkeypatch.setattr("innerattn.train.export.write.find_spec", lambda _: None)
    assert main([*words[:-1], str(tmp_path / "plain")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{tmp_path / 'plain'}: 2 robots, for numpy alone, 0.2 MB"
    assert lines[-1] == "pip install 'innerattn[deploy]' and export again for an ONNX file, too"
    file.write_text(robots % ", sight_m = 0.5")
    assert main([*words[:-1], str(tmp_path / "none")]) == 1
    assert capsys.readouterr().err == (
        "innerattn: error: scenario.robots[0].sight_m = 0.5: must be left out; policies for any "
        "team see everything\n"
    )
