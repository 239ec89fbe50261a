"""Run folders: made whole or not at all, and read with suspicion."""

import json
import math
import os
import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
import torch
from reseal import reseal

from innerattn.config import RunConfig, read_toml
from innerattn.envs import BatchEnv
from innerattn.errors import RunError
from innerattn.records.run_folder import newest_weights, read_info
from innerattn.train import RunFolder, checkpoint, load_policy, train
from innerattn.train.weights import digest_of

Configure = Callable[..., RunConfig]


@pytest.fixture
def run(finished_run: Path, tmp_path: Path) -> Path:
    """A copy that a test may change."""
    return Path(shutil.copytree(finished_run, tmp_path / "copy"))


def refusal(run: Path) -> str:
    with pytest.raises(RunError) as caught:
        load_policy(run)
    message = str(caught.value)
    assert str(run) in message
    assert "\n" not in message
    return message


def newest(run: Path) -> Path:
    return run / "checkpoints" / (run / "checkpoints" / "latest").read_text().strip()


def test_create_makes_a_run_that_is_running(small_config: Configure, tmp_path: Path) -> None:
    config = small_config()
    folder = RunFolder.create(tmp_path / "new" / "run", config, threads=3)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["run"]
    assert read_toml(folder.path / "config.toml") == config
    info = read_info(folder.path)
    assert (info.state, info.env_steps, info.updates, info.threads) == ("running", 0, 0, 3)
    assert {"innerattn", "python", "torch", "numpy"} == info.versions.keys()
    assert info.versions["torch"] == torch.__version__.split("+")[0]
    assert "holds no checkpoint yet" in refusal(folder.path)


def test_mark_is_read_back(small_config: Configure, tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path / "run", small_config(), threads=1)
    folder.mark("interrupted", 120, 5, 1.23456, 2.00049)
    folder.mark("interrupted", 120, 5, 1.23456)
    info = read_info(folder.path)
    assert (info.state, info.env_steps, info.updates) == ("interrupted", 120, 5)
    assert (info.seconds, info.cpu_seconds) == (1.235, 2.0)


@pytest.mark.parametrize("kind", ["folder", "file", "dangling link"])
def test_create_refuses_what_exists(small_config: Configure, tmp_path: Path, kind: str) -> None:
    path = tmp_path / "run"
    if kind == "folder":
        path.mkdir()
    elif kind == "file":
        path.write_text("mine")
    else:
        path.symlink_to(tmp_path / "nowhere")
    with pytest.raises(RunError, match="exists already"):
        RunFolder.create(path, small_config(), threads=1)
    assert [entry.name for entry in tmp_path.iterdir()] == ["run"]


def test_create_leaves_nothing_when_it_fails(
    small_config: Configure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full_disk(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint, "write_toml", full_disk)
    with pytest.raises(RunError, match="No space left"):
        RunFolder.create(tmp_path / "run", small_config(), threads=1)
    assert list(tmp_path.iterdir()) == []


def test_who_begins_second_hears_that_the_first_is_in_training(
    small_config: Configure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = checkpoint.write_toml

    def begun_by_another(config: RunConfig, path: Path) -> None:
        monkeypatch.setattr(checkpoint, "write_toml", write)
        RunFolder.create(tmp_path / "other", config, threads=1).path.rename(tmp_path / "run")
        write(config, path)

    monkeypatch.setattr(checkpoint, "write_toml", begun_by_another)
    with pytest.raises(RunError, match="exists already, and is in training or was killed"):
        RunFolder.create(tmp_path / "run", small_config(), threads=1)
    assert [one.name for one in tmp_path.iterdir()] == ["run"]


def test_create_below_a_file_is_refused(small_config: Configure, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(RunError, match="cannot make the run folder"):
        RunFolder.create(tmp_path / "file" / "run", small_config(), threads=1)


def test_a_newer_checkpoint_is_the_one_loaded(run: Path) -> None:
    _, learner = load_policy(run)
    folder = RunFolder(run, read_info(run))
    state = {name: tensor + 1 for name, tensor in learner.state().items()}
    folder.save_weights(state, 10_000)
    folder.mark("done", 10_000, 1, 1.0)
    _, newer = load_policy(run)
    assert all(torch.equal(tensor, state[name]) for name, tensor in newer.state().items())


def test_the_newest_weights_are_named(run: Path) -> None:
    info, weights = read_info(run), newest_weights(run)
    assert info.weights_sha256 == digest_of(weights)
    folder = RunFolder(run, info)
    folder.save_weights(load_policy(run)[1].state() | {"more": torch.ones(2)}, 10_000)
    folder.mark("done", 10_000, info.updates, info.seconds)
    assert newest_weights(run) != weights
    assert read_info(run).weights_sha256 == digest_of(newest_weights(run)) != info.weights_sha256


@pytest.mark.parametrize("bad", [math.nan, -math.inf])
def test_broken_weights_leave_the_newest_checkpoint_whole(run: Path, bad: float) -> None:
    before = {file: file.read_bytes() for file in run.rglob("*") if file.is_file()}
    state = load_policy(run)[1].state()
    name = sorted(name for name in state if name.startswith("critic."))[0]
    state[name].view(-1)[3] = bad
    folder = RunFolder(run, read_info(run))
    with pytest.raises(RunError, match=rf"env_steps = 700: a value of {name} is {bad}: must be"):
        folder.save_weights(state, 700)
    assert {file: file.read_bytes() for file in run.rglob("*") if file.is_file()} == before


def test_loaded_policies_are_alike_and_draw_alike(small_config: Configure, run: Path) -> None:
    (config, one), (_, other) = load_policy(run), load_policy(run)
    assert config == small_config()
    assert one.updates == other.updates == read_info(run).updates > 0
    with closing(BatchEnv(config.scenario, 40, num_threads=1)) as env:
        obs = torch.tensor(env.reset())
    assert torch.equal(one.act(obs), other.act(obs))
    assert torch.equal(one.act(obs, greedy=True), other.act(obs, greedy=True))


def test_missing_and_foreign_folders(tmp_path: Path) -> None:
    assert "no such run folder" in refusal(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    assert "run.json" in refusal(tmp_path / "empty")


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", "null", '{"schema_version": 1}', "\x00", "3", '"text"']
)
def test_a_foreign_record_is_refused(run: Path, text: str) -> None:
    (run / "run.json").write_text(text)
    assert "run.json" in refusal(run)


@pytest.mark.parametrize(("key", "value"), [("schema_version", 2), ("state", "sleeping")])
def test_an_unknown_version_or_state_is_refused(run: Path, key: str, value: object) -> None:
    info = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps(info | {key: value}))
    assert str(value) in refusal(run)


@pytest.mark.parametrize("name", ["", "..", ".", "../..", "/", "600/../600", "latest", "99", "-1"])
def test_latest_must_be_a_number_beside_it(run: Path, name: str) -> None:
    (run / "checkpoints" / "latest").write_text(name)
    assert "latest" in refusal(run)


@pytest.mark.parametrize(
    "part", ["checkpoints", "latest", "folder", "weights", "run.json", "config"]
)
def test_links_are_refused(run: Path, tmp_path: Path, part: str) -> None:
    path = {
        "checkpoints": run / "checkpoints",
        "latest": run / "checkpoints" / "latest",
        "folder": newest(run),
        "weights": newest(run) / "weights.safetensors",
        "run.json": run / "run.json",
        "config": run / "config.toml",
    }[part]
    os.rename(path, tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    refusal(run)


def test_weights_of_other_networks_are_refused(run: Path) -> None:
    text = (run / "config.toml").read_text()
    assert "hidden_width = 16" in text
    (run / "config.toml").write_text(text.replace("hidden_width = 16", "hidden_width = 32"))
    reseal(run)
    assert "weights.safetensors" in refusal(run)


def test_damaged_weights_are_refused(run: Path) -> None:
    weights = newest(run) / "weights.safetensors"
    whole = weights.read_bytes()
    weights.write_bytes(whole[:-100])
    assert "weights.safetensors" in refusal(run)
    weights.write_bytes(whole[:-1] + bytes([whole[-1] ^ 0xFF]))
    assert "altered" in refusal(run)


@pytest.mark.parametrize("line", ['encoder = "flat"\n', 'parameter_sharing = "none"\n'])
def test_a_folder_from_before_networks_were_a_choice_is_read(
    small_config: Configure, run: Path, line: str
) -> None:
    text = (run / "config.toml").read_text()
    assert text.count(line) == 1
    (run / "config.toml").write_text(text.replace(line, ""))
    reseal(run)
    assert load_policy(run)[0] == small_config()


@pytest.mark.parametrize("method", ["td-inner", "mappo"])
def test_robots_of_a_kind_share_what_comes_back(
    small_config: Configure, tmp_path: Path, method: str
) -> None:
    config = small_config(**{"network.parameter_sharing": "kind", "train.method": method})
    run = train(config, tmp_path / "run")
    found, learner = load_policy(run)
    assert found == config
    assert [robot.kind for robot in config.scenario.robots][:2] == ["food", "food"]
    obs = torch.rand(5, 1, learner.actor.first.weight.shape[2]).expand(-1, 4, -1)
    actions = learner.act(obs, greedy=True)
    assert torch.equal(actions[:, 0], actions[:, 1])
    assert learner.state()["actor.output.parametrizations.bias.original"].shape[0] == 3
    hidden = [name for name in learner.state() if name.startswith("critic.hidden.")]
    assert len(hidden) == (2 if method == "td-inner" else 0)
    text = (run / "config.toml").read_text()
    (run / "config.toml").write_text(text.replace('sharing = "kind"', 'sharing = "none"'))
    reseal(run)
    assert "weights.safetensors" in refusal(run)


@pytest.mark.parametrize("method", ["td-inner", "ppo-inner"])
def test_networks_by_entities_come_back(
    small_config: Configure, tmp_path: Path, method: str
) -> None:
    config = small_config(**{"network.encoder": "entities", "train.method": method})
    run = train(config, tmp_path / "run")
    found, learner = load_policy(run)
    assert found == config
    assert "actor.first.victim.weight" in learner.state()
    text = (run / "config.toml").read_text()
    (run / "config.toml").write_text(text.replace('"entities"', '"flat"'))
    reseal(run)
    assert "weights.safetensors" in refusal(run)
