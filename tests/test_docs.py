"""The documentation names everything that it should."""

import pkgutil
import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from innerattn.config import Scenario, TrainConfig, load_run_config
from innerattn.config.schedule import Ramp

ROOT = Path(__file__).parents[1]


def test_the_scenario_reference_names_every_key() -> None:
    text = (ROOT / "docs" / "scenario.md").read_text("utf-8")
    parts = ("robots", "tasks", "obstacles", "faults")
    nested = [name for part in parts for name in _fields_of(part)]
    missing = [name for name in [*Scenario.model_fields, *nested] if f"`{name}" not in text]
    assert not missing


def _fields_of(part: str) -> list[str]:
    (model, *_) = Scenario.model_fields[part].annotation.__args__
    return list(model.model_fields)


def test_the_examples_about_runs_work(run_dir: Path) -> None:
    text = (ROOT / "docs" / "runs.md").read_text("utf-8")
    examples = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        exec(compile(example, "docs/runs.md", "exec"), {"run": str(run_dir)})


def test_the_examples_for_other_libraries_work() -> None:
    text = (ROOT / "docs" / "libraries.md").read_text("utf-8")
    examples = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(examples) == 6
    known: dict[str, object] = {}
    for example in examples:
        if "TorchRL" in example and find_spec("torchrl") is None:
            continue
        exec(compile(example, "docs/libraries.md", "exec"), known)
    assert known["state"].shape == (24,)  # type: ignore[attr-defined]
    assert known["states"].shape == (64, 24)  # type: ignore[attr-defined]
    assert known["last"].shape == (64,)  # type: ignore[attr-defined]
    np.testing.assert_allclose(known["robot_rewards"].sum(axis=1), known["rewards"])  # type: ignore[attr-defined]


def test_what_is_said_of_a_runs_files_is_there(run_dir: Path) -> None:
    text = (ROOT / "docs" / "runs.md").read_text("utf-8")
    named = {name for line in text.splitlines() for name in re.findall(r"^\| `([^`]+)`", line)}
    keys = {name for name in named if name.startswith("train.")}
    assert keys <= {f"train.{key}" for key in TrainConfig.model_fields}
    found = {str(path.relative_to(run_dir)) for path in run_dir.rglob("*") if path.is_file()}
    known = {re.sub(r"/(best-)?\d+([/.])", r"/\1N\2", name) for name in found}
    assert named - keys == known - {"checkpoints/latest"}


def test_the_configuration_in_the_scenario_reference_is_one(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "scenario.md").read_text("utf-8")
    (example,) = re.findall(r"```toml\n(\[scenario\].*?)```", text, flags=re.DOTALL)
    (tmp_path / "mine.toml").write_text(example)
    config = load_run_config(config_file=tmp_path / "mine.toml")
    assert (config.scenario.rescue_credit, config.td.gamma) == ("team", 0.9)
    assert [task.name for task in config.scenario.tasks] == ["injured"]


def test_the_schedule_on_the_page_about_training_is_one(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "training.md").read_text("utf-8")
    (example,) = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    (tmp_path / "mine.toml").write_text(example)
    schedule = load_run_config(config_file=tmp_path / "mine.toml").train.schedule
    assert schedule.gamma is not None
    assert (schedule.gamma.first, schedule.gamma.end) == (0.95, 1.0)


def test_the_page_about_training_says_what_the_budgets_do() -> None:
    text = (ROOT / "docs" / "training.md").read_text("utf-8")
    for budget in ("fast", "strong"):
        config = load_run_config("mixed", "ppo-inner", budget)
        assert (config.network.symmetry, config.network.parameter_sharing) == ("canonical", "kind")
        assert (config.ppo.gamma, config.ppo.epochs, config.ppo.minibatch_size) == (0.98, 2, 512)
        assert (config.train.num_envs, config.ppo.rollout_steps) == (1_024, 25)
        assert (config.train.engine, config.train.episode_steps) == ("discs", 50)
        schedule = config.train.schedule
        assert schedule.dense_weight == Ramp(first=0.3, last=0.0, end=0.1)
        assert schedule.team_credit == Ramp(first=1.0, last=1.0)
        assert schedule.entropy_weight == Ramp(first=0.015, last=0.0003)
        for key in ("network.symmetry", "train.engine", "train.episode_steps", "ppo.gamma"):
            assert f"`{key}`" in text


def test_every_equation_has_the_function_and_the_test_that_its_page_names() -> None:
    text = (ROOT / "docs" / "equations.md").read_text("utf-8")
    functions = set(re.findall(r"`(innerattn\.[\w.]+)`", text))
    tests = set(re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", text))
    assert len(functions) > 15
    assert len(tests) > 15
    for name in functions:
        assert callable(pkgutil.resolve_name(name)), name
    for file, test in tests:
        assert f"def {test}(" in (ROOT / file).read_text("utf-8"), test
    for number in range(1, 11):
        assert re.search(rf"\beqs?\. (\d (to|and) )?{number}\b", text) or number == 6, number
