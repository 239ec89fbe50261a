"""Algorithms and attentions that are added from outside."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import ClassVar

import pytest
from pydantic import Field

from innerattn.config import (
    Algorithm,
    AlgorithmConfig,
    RunConfig,
    load_run_config,
    read_toml,
    register_algorithm,
    register_attention,
    registry,
    write_toml,
)
from innerattn.errors import ConfigError


class WalkConfig(AlgorithmConfig):
    """Numbers of a made-up algorithm."""

    place: ClassVar[str] = "walk"

    stride: int = Field(3, ge=1, description="length of a step")

    @property
    def rows_per_update(self) -> int:
        return 7 * self.stride

    def rows_of_training(self, env_steps: int) -> int:
        return env_steps * self.stride


@pytest.fixture(autouse=True)
def _own_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_algorithms", "_attentions"):
        monkeypatch.setattr(registry, name, dict(getattr(registry, name)))


@pytest.fixture
def budgets(tmp_path: Path) -> Path:
    for folder, stride in (("cold", 5), ("warm", 6)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "short.toml").write_text(f"[walk]\nstride = {stride}\n")
    return tmp_path


@pytest.fixture
def walk(budgets: Path) -> Algorithm:
    algorithm = Algorithm(
        config=WalkConfig,
        learner="walking:Walker",
        attends=True,
        methods={"stroll": {"network": {"attention": "none"}, "walk": {"stride": 1}}},
        budgets=budgets / "cold",
        warm_budgets=budgets / "warm",
    )
    register_algorithm(algorithm)
    return algorithm


def test_the_built_in_methods_are_these() -> None:
    kinds = ("inner", "uniform", "frozen", "oracle", "max", "independent")
    known = [f"{algorithm}-{kind}" for algorithm in ("td", "ppo") for kind in kinds]
    any_team = [f"team-{pooling}" for pooling in ("inner", "uniform", "max", "nearest")]
    known += ["mappo", *any_team]
    assert list(registry.methods()) == known
    with pytest.raises(ConfigError) as error:
        load_run_config(method="ppo")
    allowed = f"{', '.join(map(repr, known[:-1]))} or {known[-1]!r}"
    assert str(error.value) == f"train.method = 'ppo': must be {allowed}, did you mean 'ppo-inner'?"


@pytest.mark.usefixtures("walk")
def test_methods_of_a_registered_algorithm() -> None:
    assert [*registry.methods()][-3:] == ["walk-max", "walk-independent", "stroll"]
    config = load_run_config(method="walk-uniform")
    assert config.algorithm == WalkConfig()
    assert config.network.attention == "uniform"
    assert config.algorithm.rows_per_update == 21
    assert load_run_config(method="stroll").algorithm == WalkConfig(stride=1)
    with pytest.raises(ConfigError, match=r"^walk\.stride = 2: train\.method = 'stroll' needs 1$"):
        load_run_config(method="stroll", overrides={"walk.stride": 2})


@pytest.mark.usefixtures("walk")
def test_budgets_of_a_registered_algorithm() -> None:
    def stride(budget: str, **given: object) -> int:
        config = load_run_config(method="walk-inner", budget=budget, overrides=given)
        assert isinstance(config.algorithm, WalkConfig)
        return config.algorithm.stride

    assert stride("quick") == 3  # which the algorithm does not change
    assert stride("short") == 5
    assert stride("short", **{"train.warm_start": "greedy"}) == 6
    assert stride("short", **{"walk.stride": 9}) == 9


@pytest.mark.usefixtures("walk")
def test_a_registered_section_is_checked() -> None:
    for key, message in (
        ("walk.stride", r"^walk\.stride = 0: must be greater than or equal to 1$"),
        ("walk.pace", r"^walk\.pace: unknown key$"),
        ("run.stride", r"^run: unknown key$"),
    ):
        for method in ("walk-inner", "td-inner"):
            with pytest.raises(ConfigError, match=message):
                load_run_config(method=method, overrides={key: 0})


@pytest.mark.usefixtures("walk")
def test_a_registered_section_is_kept(tmp_path: Path) -> None:
    used = load_run_config(method="walk-inner", overrides={"walk.stride": 4})
    write_toml(used, tmp_path / "config.toml")
    assert read_toml(tmp_path / "config.toml") == used
    assert used.in_use()["walk"] == {"gamma": 0.95, "stride": 4}
    assert not used.in_use().keys() & {"td", "ppo"}
    assert used.replace(td={"gamma": 0.5}).digest() == used.digest()
    assert load_run_config(method="walk-inner").digest() != used.digest()
    assert used.replace(scenario={"shaping": "potential", "shaping_discount": 0.95}) != used
    with pytest.raises(ConfigError, match=r"only with the learner's walk\.gamma = 0\.95"):
        used.replace(scenario={"shaping": "potential", "shaping_discount": 0.9})


def test_registering_changes_no_other_run(tmp_path: Path) -> None:
    before = load_run_config()
    write_toml(before, tmp_path / "before.toml")
    register_algorithm(Algorithm(config=WalkConfig, learner="walking:Walker", attends=True))
    after = load_run_config()
    write_toml(after, tmp_path / "after.toml")
    assert (after, after.digest()) == (before, before.digest())
    assert (tmp_path / "after.toml").read_bytes() == (tmp_path / "before.toml").read_bytes()
    with_section = RunConfig.model_validate({"walk": {"stride": 8}})  # given and not in use
    assert with_section.digest() == RunConfig().digest()


def test_an_attention_makes_methods() -> None:
    before = registry.methods().keys()
    register_attention("blind", "attending:Blind")
    assert registry.methods().keys() - before == {"td-blind", "ppo-blind"}
    assert load_run_config(method="ppo-blind").network.attention == "blind"
    with pytest.raises(ConfigError, match=r"'blind': train\.method = 'td-inner' needs 'inner'"):
        load_run_config(overrides={"network.attention": "blind"})


def test_taken_names_are_refused(walk: Algorithm) -> None:
    with pytest.raises(ValueError, match="algorithm 'walk' is registered already"):
        register_algorithm(walk)

    class Other(WalkConfig):
        place: ClassVar[str] = "other"

    with pytest.raises(ValueError, match="algorithm 'other': method 'mappo' is registered already"):
        register_algorithm(Algorithm(config=Other, learner="a:B", methods={"mappo": {}}))
    for name in ("inner", "none"):
        with pytest.raises(ValueError, match=f"attention '{name}' is registered already"):
            register_attention(name, "a:B")


EXTENSION = """
from typing import ClassVar
from innerattn.config import Algorithm, AlgorithmConfig, register_algorithm

class LeapConfig(AlgorithmConfig):
    place: ClassVar[str] = "leap"
    @property
    def rows_per_update(self): return 1
    def rows_of_training(self, env_steps): return 0

register_algorithm(Algorithm(config=LeapConfig, learner="leaping:Leap", methods={"leap": {}}))
"""
SHOW = """
import json, sys
from innerattn.config import load_run_config, registry
print(json.dumps([[*registry.methods()], load_run_config(method="leap").algorithm.place]))
assert "torch" not in sys.modules
"""


@pytest.mark.parametrize("first", ["", "import leaping\n"])
def test_installed_packages_register_by_an_entry_point(tmp_path: Path, first: str) -> None:
    (tmp_path / "leaping.py").write_text(EXTENSION)
    (tmp_path / "broken.py").write_text("raise OSError('no such thing')")
    for name in ("leaping", "broken"):
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[innerattn.extensions]\n{name} = {name}\n")
    path = os.pathsep.join([str(tmp_path), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", first + SHOW],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    known, place = json.loads(done.stdout)
    assert (known[-1], place) == ("leap", "leap")
    assert done.stderr.splitlines() == [
        "Extension 'broken' is left out: broken cannot be imported (OSError: no such thing)"
    ]
