"""Every code block of the pages is run, here or by the test that is named here."""

import json
import os
import re
import shlex
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import tyro

from innerattn.cli.main import COMMANDS, _parse, main
from innerattn.cli.replay import recorded
from innerattn.config import Scenario, load_run_config
from innerattn.config.instances import read_instances, read_worlds
from innerattn.envs import BatchEnv
from innerattn.policies import Exported
from innerattn.report.replay import read_moments
from innerattn.studies.plan import plan_study
from innerattn.studies.study import study_in
from innerattn.train.orders import OrderTraining
from innerattn.zoo import run_path

ROOT = Path(__file__).parents[2]
ORDERS = ROOT / "python/innerattn/policies/orders/ral.safetensors"
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("*/*.md")])
FENCE = re.compile(r"(?ms)^(?P<fence>```+)(?P<language>[^\n]*)\n(?P<code>.*?)^(?P=fence)[ \t]*$")
LANGUAGES = {"sh", "python", "toml", "rust", "text", "mermaid"}

RUN_ELSEWHERE = {
    ("docs/extending/algorithm.md", "python"): "tests/examples/test_pages.py",
    ("docs/extending/algorithm.md", "toml"): "tests/examples/test_pages.py",
    ("docs/extending/fault.md", "rust"): "rust_env/tests/worlds/extending/mod.rs",
    ("docs/extending/measure.md", "python"): "tests/test_extending_measure.py",
    ("docs/extending/network.md", "python"): "tests/examples/test_pages.py",
    ("docs/extending/network.md", "toml"): "tests/examples/test_pages.py",
    ("docs/extending/reward.md", "rust"): "rust_env/tests/worlds/extending/mod.rs",
    ("docs/extending/scenario.md", "python"): "tests/envs/test_extending.py",
    ("docs/extending/scenario.md", "toml"): "tests/envs/test_extending.py",
    ("docs/libraries.md", "python"): "tests/test_docs.py",
    ("docs/runs.md", "python"): "tests/test_docs.py",
}
"""The blocks of a language on a page, and the file that tests them."""

SMALL = {
    "demo": ("--no-open", "--episodes", "20"),
    "evaluate": ("--episodes", "2", "--score-episodes", "20", "--long-episodes", "2"),
    "replay": ("--episodes", "2"),
    "export": (),
    "info": (),
    "new": (),
    "report": (),
    "seal": (),
}
"""Commands that are run, and what keeps them short. Others serve until they are stopped, or take
minutes: their words are checked, and tests/cli runs them."""


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """Language and code of each block; directives of the site are none."""
    for found in FENCE.finditer(page.read_text("utf-8")):
        language = found["language"].strip()
        if not language.startswith("{"):
            yield language, found["code"]


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def of_language(language: str) -> list[Path]:
    """The pages whose blocks of a language are run here."""
    return [
        page
        for page in PAGES
        if (name_of(page), language) not in RUN_ELSEWHERE
        and any(one == language for one, _ in blocks(page))
    ]


def test_every_block_says_its_language() -> None:
    for page in PAGES:
        assert {language for language, _ in blocks(page)} <= LANGUAGES, page


def test_what_is_run_elsewhere_is_there() -> None:
    for (page, language), test in RUN_ELSEWHERE.items():
        assert language in {one for one, _ in blocks(ROOT / page)}, page
        text = (ROOT / test).read_text("utf-8")
        assert Path(page).stem in text or page in text, (page, test)


@pytest.fixture
def place(tmp_path: Path, run_dir: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which a user would type the commands, with what the pages name."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "examples" / "scenarios", tmp_path / "examples" / "scenarios")
    shutil.copytree(ROOT / "docs" / "moments", tmp_path / "docs" / "moments")
    for name in ("NAME", "OTHER", "mine", "first", "hardened", "harbour", "mixed-s0"):
        shutil.copytree(run_dir, tmp_path / "runs" / name)
    for page in PAGES:
        text = page.read_text("utf-8")
        for name, code in re.findall(r"(?s)`(\w+\.toml)`[^`]*:\n\n```toml\n(.*?)```", text):
            (tmp_path / name).write_text(code, "utf-8")
    (tmp_path / "mine.toml").write_text('situation = "double"\nepisode_steps = 20\n')
    few = [one.model_dump(mode="json") for one in read_instances("ral")[:2]]
    (tmp_path / "mine.json").write_text(json.dumps(few))
    shutil.copy(ORDERS, tmp_path / "mine.safetensors")
    return tmp_path


def test_python_blocks(place: Path, plain_team: Path) -> None:
    """Blocks of a page run one after the other, as a reader would run them."""
    export = shutil.copytree(plain_team / "export", place / "export")
    shutil.copytree(export, "my-team")
    for page in of_language("python"):
        with BatchEnv("mixed", 2, seed=0) as env:
            env.reset()
            known: dict[str, object] = {"run": "runs/NAME", "folder": str(export), "env": env}
            known |= {"np": np, "team": Exported(export, backend="numpy")}
            for language, code in blocks(page):
                if language == "python":
                    exec(compile(code, name_of(page), "exec"), known)


def test_toml_blocks(tmp_path: Path, run_dir: Path) -> None:
    """Each is a file that the command takes: a scenario, or a run's configuration."""
    file = tmp_path / "block.toml"
    for page in of_language("toml"):
        for language, code in blocks(page):
            if language != "toml":
                continue
            file.write_text(code, "utf-8")
            keys = set(tomllib.loads(code))
            if keys <= set(Scenario.model_fields):
                Scenario.from_toml(file)
            elif keys == {"moments"}:
                assert read_moments(file, [recorded(str(run_dir))], ["a"])
            elif keys == {"family"}:
                load_run_config(method="team-inner", family=file)
            elif keys & {"grid", "report"}:
                study = study_in(code.encode(), file)
                if page.name != "measure.md":  # of its own: tests/test_extending_measure.py
                    plan_study(study, tmp_path.joinpath)
            else:
                load_run_config("mixed", "ppo-inner", config_file=file)


def test_the_output_on_the_first_page_is_what_is_printed(
    run_dir: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Lines without a number are the same; numbers are those of a longer training."""
    (shown,) = (code for language, code in blocks(ROOT / "README.md") if language == "text")
    assert main(["evaluate", str(run_dir)]) == 0
    printed = {" ".join(line.split()) for line in capsys.readouterr().out.splitlines()}
    fixed = {" ".join(line.split()) for line in shown.splitlines() if not re.search(r"\d|─", line)}
    assert len(fixed) > 4
    assert fixed <= printed


def lines() -> list[tuple[str, str]]:
    """Page and command of every line that a reader may type."""
    found = []
    for page in of_language("sh"):
        for language, code in blocks(page):
            if language == "sh":
                whole = code.replace("\\\n", " ").splitlines()
                words = [line.partition(" #")[0].strip() for line in whole]
                found += [(name_of(page), one) for one in words if one and one[0] != "#"]
    return found


LINES = lines()


@pytest.mark.long
@pytest.mark.usefixtures("place")
def test_commands_of_innerattn_are_understood() -> None:
    """Names of methods that only an installed example knows are left to tests/examples."""
    commands = [(page, one) for page, one in LINES if one.startswith("innerattn ")]
    assert len(commands) > 40
    for page, command in commands:
        words = shlex.split(command.partition(" > ")[0])[1:]
        if {"ippo", "td-additive"} & set(words):
            assert page in ("docs/extending/algorithm.md", "docs/extending/network.md")
        elif words[0] == "--completion":
            with pytest.raises(SystemExit) as ended:
                main(words)
            assert ended.value.code == 0
        else:
            assert words[0] in COMMANDS
            _parse(words)  # SystemExit if a word is wrong


def some_of_each() -> list[str]:
    """The commands that are run: of those that differ only in the run's name, one."""
    found = {}
    for _, one in sorted(LINES, key=lambda line: line[1]):
        if one.split()[0] == "innerattn" and one.split()[1] in SMALL:
            alike = re.sub(r"runs/\w+|zoo:(?!any)[\w-]+", "RUN", one)
            if one.split()[1] == "export":
                alike = re.sub(r" -o \S+", "", alike)
            found.setdefault(alike, one)
    return list(found.values())


@pytest.mark.long
@pytest.mark.parametrize("command", some_of_each())
def test_commands_run(place: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = shlex.split(command)[1:]
    small = SMALL[words[0]]
    if words[0] == "seal":  # an older run
        (place / words[1] / "manifest.json").unlink()
        info = place / words[1] / "run.json"
        info.write_text(info.read_text().replace('"sealed": true', '"sealed": false'))
    if words[0] == "report":  # those of a method differ by their seed
        words = [one for one in words if one not in ("runs/mixed-s1", "runs/mixed-s2")]
    given = [] if set(small) & set(words) else list(small)
    if words[0] == "replay" and "-o" in words:
        given = []  # one episode, of those that were recorded
    if "--instances" in words or (words[0] == "replay" and "--instance" in words):
        given = ["--time-limit-ms", "2"]
    if any(one.split(":")[0] == "standard" for one in words):
        given = []
        words = [few_worlds(place) if one == "standard" else one for one in words]
    assert main([*words, *given]) == 0, capsys.readouterr().err


def few_worlds(place: Path) -> str:
    """A file with the first worlds of the set."""
    path = place / "few.json"
    path.write_text(json.dumps([one.written() for one in read_worlds("standard")[:2]]))
    return str(path)


def test_other_commands_name_what_is_there() -> None:
    targets = set(re.findall(r"(?m)^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8")))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    pinned = (ROOT / "constraints.txt").read_text("utf-8")
    for page, line in LINES:
        for command in line.split(" && "):
            words = [one for one in shlex.split(command) if not re.match(r"[A-Z_]+=", one)]
            match words:
                case ["innerattn", *_]:
                    pass
                case ["uvx", "innerattn", *rest]:
                    _parse(rest)
                case ["uv", "run", *rest]:
                    own = rest.index("innerattn")
                    options, extras = rest[:own:2], rest[1:own:2]
                    assert {*options} <= {"--extra"}, line
                    assert {*extras} <= {*project["optional-dependencies"]}, line
                    _parse(rest[own + 1 :])
                case ["docker", "build", *_, "."]:
                    assert (ROOT / "Dockerfile").is_file(), line
                case ["docker", "run", *rest]:
                    _parse(rest[rest.index("innerattn") + 1 :])
                case ["make", target, *_]:
                    assert target in targets, line
                case ["pip", "install", "-e" | "-r", path]:
                    assert (ROOT / path).exists(), line
                case ["pip", "install", what]:
                    name, _, extras = what.rstrip("]").partition("[")
                    ours = name in ("innerattn", "innerattn-policies")
                    assert ours or f"{name}==" in pinned, line
                    given = set(filter(None, extras.split(",")))
                    assert given <= set(project["optional-dependencies"]), line
                case ["python", "-m", "innerattn.train.orders", *rest]:
                    tyro.cli(OrderTraining, args=rest)  # SystemExit if a word is wrong
                case ["python", "-m", "robot", *_]:
                    assert (ROOT / "examples/robot/robot/__main__.py").is_file()
                case ["torchrun", *rest]:
                    started = rest[rest.index("-m") + 1 :]
                    assert started[0] == "innerattn"
                    _parse(started[1:])  # SystemExit if a word is wrong
                case ["python" | "pytest" | "cp", path, *_]:
                    assert (ROOT / path).is_file(), line
                case ["cargo", "test" | "bench", *_]:
                    named = [one for one in words if f'name = "{one}"' in manifests()]
                    assert named, line
                case [".", ".venv/bin/activate"] | ["mkdir", "-p", _] | ["git", *_]:
                    pass
                case _:
                    pytest.fail(f"{page}: nobody runs {line!r}")


def manifests() -> str:
    """The names of all tests and benchmarks in Rust."""
    found = [path.read_text("utf-8") for path in ROOT.glob("*/Cargo.toml")]
    names = [path.parent.name for path in (ROOT / "rust_env").rglob("tests/*/main.rs")]
    return "\n".join([*found, *(f'name = "{name}"' for name in names)])


def test_the_zoo_that_pages_name_is_there() -> None:
    for page in PAGES:
        for name in re.findall(r"zoo:[a-z0-9-]+", page.read_text("utf-8")):
            assert run_path(name).is_dir(), page
    assert os.sep in str(run_path("zoo:mixed"))
