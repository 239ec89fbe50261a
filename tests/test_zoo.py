"""The zoo: every team does what its card says; what a card cannot vouch for is not taken in."""

import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from made_run import LONG, LONG_STEPS, RECORDED, SCORED, made_run

from innerattn.config import SCENARIOS, Scenario
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.evaluate import load_trained, run_episodes
from innerattn.policies import best_script, scripts_of
from innerattn.records.run_files import AlteredFileError, RunFiles
from innerattn.records.run_folder import config_of, newest_weights
from innerattn.report.marks import marked
from innerattn.train import load_policy
from innerattn.train.weights import digest_of
from innerattn.zoo import CARD, FOLDER, PREFIX, read_card, run_path, zoo_names

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))
import publish_zoo as packing  # noqa: E402

EPISODES = 150


OPTIONS = (
    f"--network.hidden-width 8 --evaluate.episodes {RECORDED} --evaluate.score-episodes {SCORED} "
    f"--evaluate.long-episodes {LONG} --evaluate.long-episode-steps {LONG_STEPS} --evaluate.seed 3"
)
"""What the configuration of a made run with seed 3 has beside the budget."""


@pytest.fixture
def packed(tmp_path: Path) -> Path:
    """A team of an untrained run, in a zoo of its own."""
    run = made_run(tmp_path / "runs", "single", "td-inner", 3)
    (tmp_path / "zoo").mkdir()
    return packing.pack(run.folder, "single", "quick", tmp_path / "zoo", OPTIONS)


WORKED = {file.stem for file in (ROOT / "examples" / "scenarios").glob("*.toml")}
WITHOUT_A_TEAM = {"rescue-16", "rescue-64"}
"""Nobody has trained a team for these."""


def test_there_is_a_team_of_each_preset_and_each_worked_scenario() -> None:
    assert len(WORKED) == 10
    assert set(zoo_names()) == {*SCENARIOS, *WORKED, "any"} - WITHOUT_A_TEAM


def test_the_zoo_is_small() -> None:
    size = sum(file.stat().st_size for file in FOLDER.rglob("*") if file.is_file())
    assert size < packing.MOST_BYTES


@pytest.mark.parametrize(
    "name",
    [
        one if one in ("any", "mixed") else pytest.param(one, marks=pytest.mark.long)
        for one in zoo_names()
    ],
)
def test_a_team_scores_what_its_card_says(name: str) -> None:
    card = read_card(name)
    short = card["lengths"][0]
    config, policy = load_trained(f"{PREFIX}{name}", greedy=True)
    assert config.scenario.episode_steps == short["episode_steps"]
    played = run_episodes(policy, config.scenario, EPISODES, card["worlds_seed"], num_threads=1)
    rescues = played.rescue_counts()
    card_mean = short["rescues_per_episode"]["mean"]
    # Four standard errors: of the same worlds' first ones, it is seldom more than one.
    assert abs(rescues.mean() - card_mean) < 4 * rescues.std() / np.sqrt(EPISODES)
    if config.scenario.has_limited_sight:  # the script of the score sees everything
        assert short["score_as_seen"] > 0.8
        assert short["score"]["mean"] > 0.7
    else:
        assert short["score"]["mean"] > 0.8


@pytest.mark.parametrize("name", zoo_names())
def test_weights_are_those_of_the_card(name: str) -> None:
    card = read_card(name)
    config, _ = load_policy(f"{PREFIX}{name}")
    assert digest_of(newest_weights(run_path(f"{PREFIX}{name}"))) == card["weights_sha256"]
    assert RunFiles(f"{PREFIX}{name}").info.weights_sha256 == card["weights_sha256"]
    assert f"--method {config.train.method} " in card["command"]
    assert f"--seed {card['seed']} " in card["command"]


@pytest.mark.parametrize("name", zoo_names())
def test_a_card_names_what_made_the_team_and_what_it_is_measured_against(name: str) -> None:
    card, config = read_card(name), config_of(RunFiles(f"{PREFIX}{name}"))
    assert packing.config_of_command(card["command"]).digest() == config.digest()
    assert card["script"] == best_script(scripts_of(config.scenario))
    for length in card["lengths"]:
        assert ("score_as_seen" in length) == config.scenario.has_limited_sight
    steps = [length["episode_steps"] for length in card["lengths"]]
    assert steps == [config.scenario.episode_steps, config.evaluate.long_episode_steps]
    row = next(line for line in packing.table().splitlines() if f"`{PREFIX}{name}`" in line)
    cells = [cell.strip() for cell in row.split("|")]
    assert (cells[2], cells[3], cells[7]) == (f"`{card['script']}`", *map(str, steps))


def test_the_page_lists_the_zoo() -> None:
    assert marked(DOCS / "zoo.md", "teams")[1].strip() == packing.table()
    assert marked(DOCS / "zoo.md", "commands")[1].strip() == packing.commands()


def test_a_packed_run_loads_and_its_card_is_sealed(packed: Path) -> None:
    with closing(BatchEnv("single", 1)) as env:
        assert load_policy(packed)[0].scenario.num_robots == env.num_robots
    assert packing.read_card("single", packed.parent)["seed"] == 3
    assert "`zoo:single`" in packing.table(packed.parent)
    command = packing.read_card("single", packed.parent)["command"]
    assert f" --budget quick {OPTIONS} --seed 3 --train.threads 1" in command
    assert command in packing.commands(packed.parent)
    assert not (packed / "metrics.jsonl").exists()
    (packed / CARD).write_text((packed / CARD).read_text().replace('"seed": 3', '"seed": 4'))
    with pytest.raises(AlteredFileError, match="altered"):
        RunFiles(packed).read(CARD, 1 << 20)


def test_a_run_of_another_command_is_refused(tmp_path: Path) -> None:
    run = made_run(tmp_path / "runs", "single", "td-inner", 3)
    (tmp_path / "zoo").mkdir()
    zoo = tmp_path / "zoo"
    said = "trained otherwise than --preset single --method td-inner --budget quick says: evaluate"
    with pytest.raises(RunError, match=f"{said}.*, network.hidden_width$"):
        packing.pack(run.folder, "single", "quick", zoo)
    others = {
        "double": OPTIONS,  # other worlds
        "rovers": OPTIONS,
        "single": OPTIONS.replace("width 8", "width 16"),
    }
    for name, options in others.items():
        with pytest.raises(RunError, match="trained otherwise than "):
            packing.pack(run.folder, name, "quick", zoo, options)
    with pytest.raises(RunError, match="triple: must be any, a preset or the name of a file in "):
        packing.pack(run.folder, "triple", "quick", zoo, OPTIONS)
    with pytest.raises(SystemExit) as caught:
        packing.pack(run.folder, "single", "quick", zoo, f"{OPTIONS} --no-such 3")
    assert caught.value.code == 2
    assert list(zoo.iterdir()) == []


@pytest.mark.parametrize("name", sorted(WORKED))
def test_a_worked_scenario_is_named_by_its_file(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # the file is found from the root of the project
    config = packing.config_of_command(
        f"innerattn train --scenario {packing.WORKED}/{name}.toml --method ppo-inner --budget fast "
        "--network.symmetry none --warm-start greedy --seed 4 --train.threads 1"
    )
    assert config.scenario == Scenario.from_toml(ROOT / packing.WORKED / f"{name}.toml")
    assert (config.train.warm_start, config.train.seed, config.train.workers) == ("greedy", 4, 1)
    assert config.network.symmetry == "none"


def test_an_unknown_team_is_refused() -> None:
    with pytest.raises(RunError, match=r"zoo:triple: no such team; there are .*zoo:single"):
        run_path("zoo:triple")
    with pytest.raises(RunError, match="no such team"):
        load_policy("zoo:../records")
