"""Files that install the package elsewhere ask for what `pyproject.toml` asks for."""

import json
import re
import subprocess
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
RECIPE = yaml.safe_load((ROOT / "packages" / "conda" / "recipe.yaml").read_text("utf-8"))
DOCKERFILE = (ROOT / "Dockerfile").read_text("utf-8")
MATURIN = PROJECT["build-system"]["requires"][0]


def spaced(requirement: str) -> str:
    """A requirement as conda writes it: its name and its versions apart."""
    return re.sub(r"(?<=[a-z])(?=[<>=])", " ", requirement)


def test_conda_asks_for_the_same_packages() -> None:
    needs = RECIPE["requirements"]
    assert needs["run"] == [
        f"python {PROJECT['project']['requires-python']}",
        *map(spaced, PROJECT["project"]["dependencies"]),
    ]
    assert spaced(MATURIN) in needs["host"]
    ((name, entry),) = PROJECT["project"]["scripts"].items()
    assert RECIPE["build"]["python"]["entry_points"] == [f"{name} = {entry}"]


def test_conda_builds_this_version_under_its_licenses() -> None:
    workspace = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]
    assert RECIPE["context"]["version"] == workspace["package"]["version"]
    about, made = RECIPE["about"], "THIRDPARTY.yml"
    assert about["license"] == PROJECT["project"]["license"]
    assert about["license_file"] == [*about["license_file"][:1], made, *about["license_file"][2:]]
    assert {*about["license_file"]} - {made} == {*PROJECT["project"]["license-files"]}
    assert made in " ".join(RECIPE["build"]["script"])


def test_the_container_has_extras_and_a_builder_that_exist() -> None:
    (extras,) = re.findall(r"(?m)^ARG EXTRAS=(\S+)$", DOCKERFILE)
    assert {*extras.split(",")} <= {*PROJECT["project"]["optional-dependencies"]}
    assert f"'{MATURIN}'" in DOCKERFILE


def test_the_editor_builds_a_stage_of_the_container() -> None:
    folder = ROOT / ".devcontainer"
    build = json.loads((folder / "devcontainer.json").read_text("utf-8"))["build"]
    assert (folder / build["dockerfile"]).resolve() == ROOT / "Dockerfile"
    assert (folder / build["context"]).resolve() == ROOT
    assert f" AS {build['target']}\n" in DOCKERFILE


def test_the_container_is_given_all_that_the_wheel_is_made_of() -> None:
    """Of `.dockerignore` the last line that fits decides; a folder's line is for all in it."""
    lines = (ROOT / ".dockerignore").read_text("utf-8").split()
    members = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]["members"]
    folders = ["python", *members]
    tracked = subprocess.run(
        ["git", "ls-files", "--", *folders], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    sources = [one for one in tracked if not one.startswith("benches/") or one.endswith(".rs")]
    needed = ["Cargo.toml", "Cargo.lock", "constraints.txt", "pyproject.toml", *sources]
    needed += PROJECT["project"]["license-files"] + [PROJECT["project"]["readme"]]
    assert len(needed) > 100
    for name in needed:
        given = False
        for line in lines:
            pattern = line.removeprefix("!").removeprefix("/").removeprefix("**/")
            if fnmatch(name, pattern) or fnmatch(name, f"{pattern}/*"):
                given = line.startswith("!")
        assert given, name
