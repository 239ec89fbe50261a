"""Whole trainings for a family of teams: run folders, stops, and other teams than they were of."""

import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
import torch

from innerattn.config import RunConfig, Scenario, load_run_config
from innerattn.config.family import Family
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError
from innerattn.evaluate import load_trained, run_episodes
from innerattn.train import Progress, load_policy, resume, train
from innerattn.train.resume import DamagedCheckpointError, newest_checkpoint, read_saved
from innerattn.train.teams.training import TeamTraining
from innerattn.train.weights import digest_of

SMALL = {
    "train.num_envs": 32,
    "train.env_steps": 640,
    "train.log_every_env_steps": 160,
    "train.checkpoint_every_env_steps": 160,
    "train.episode_steps": 20,
    "imitation.env_steps": 480,
    "team.teams": 4,
    "team.new_teams": 2,
    "team.rollout_steps": 5,
    "team.hidden_width": 8,
    "team.key_width": 4,
}


def config(method: str = "team-inner", **given: object) -> RunConfig:
    values = SMALL | {key.replace("__", "."): value for key, value in given.items()}
    return load_run_config(method=method, overrides=values, family="any")


def lines(run: Path) -> list[dict[str, object]]:
    """The metrics of a run without its times."""
    rows = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    return [
        {key: value for key, value in row.items() if not key.endswith(("seconds", "_per_s"))}
        for row in rows
    ]


def newest(run: Path) -> str:
    number = (run / "checkpoints" / "latest").read_text().strip()
    return digest_of(run / "checkpoints" / number / "weights.safetensors")


def stops_after(env_steps: int, stage: str) -> Callable[[Progress], None]:
    def stop(progress: Progress) -> None:
        if progress.stage == stage and progress.env_steps >= env_steps:
            raise KeyboardInterrupt

    return stop


@pytest.mark.long
@pytest.mark.parametrize("method", ["team-inner", "team-uniform", "team-max", "team-nearest"])
def test_a_run_acts_in_worlds_of_any_team(tmp_path: Path, method: str) -> None:
    run = train(config(method, train__warm_start="hungarian"), tmp_path / "run")
    metrics = lines(run)
    assert metrics[-1]["env_steps"] == 640 + 480
    assert "agreement" in metrics[0]["losses"]
    assert "kl" in metrics[-1]["losses"]
    assert 32 < metrics[-1]["episodes"] < 64 + 2 * 8 * 7  # new teams begin anew
    for scenario in (Scenario.preset("mixed"), Family().draw(5, 1), Scenario.preset("mixed-8")):
        _, policy = load_trained(run, scenario)
        played = run_episodes(policy, scenario, 5, 3, num_threads=1)
        again = run_episodes(policy, scenario, 5, 3, num_threads=1)
        assert played.rescues.tobytes() == again.rescues.tobytes()
    _, one_team = load_policy(run)
    with closing(BatchEnv("mixed", 6, seed=1)) as env:
        actions = one_team.act(torch.tensor(env.reset()))
    assert actions.shape == (6, 4)


@pytest.mark.long
@pytest.mark.parametrize(
    ("env_steps", "stage", "pull", "workers"),
    [
        (160, "imitating", 0.0, 1),
        (480, "imitating", 0.0, 1),
        (320, "training", 0.0, 1),
        (320, "training", 0.5, 1),
        (320, "imitating", 0.5, 2),
        (320, "training", 0.5, 2),
    ],
)
def test_a_stopped_run_goes_on_to_the_same_bits(
    tmp_path: Path, env_steps: int, stage: str, pull: float, workers: int
) -> None:
    chosen = config(
        train__warm_start="hungarian",
        train__stagger_starts=True,
        train__workers=workers,
        team__pull=pull,
    )
    whole = train(chosen, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        train(chosen, tmp_path / "run", progress=stops_after(env_steps, stage))
    assert newest_checkpoint(tmp_path / "run") == env_steps + (480 if stage == "training" else 0)
    resume(tmp_path / "run")
    assert newest(tmp_path / "run") == newest(whole)
    assert lines(tmp_path / "run") == lines(whole)


def test_imitation_alone(tmp_path: Path) -> None:
    run = train(config(train__warm_start="greedy", train__env_steps=0), tmp_path / "run")
    assert lines(run)[-1]["env_steps"] == 480
    assert all("agreement" in line["losses"] for line in lines(run))


def test_a_pull_keeps_to_the_script_while_rewards_are_learnt_from(tmp_path: Path) -> None:
    ends = {}
    for pull in (0.0, 50.0):
        chosen = config(train__warm_start="greedy", imitation__env_steps=160, team__pull=pull)
        losses = [line["losses"] for line in lines(train(chosen, tmp_path / str(pull)))]
        assert all("kl" in found for found in losses[1:])
        assert all(("agreement" in found) == bool(pull) for found in losses[1:])
        ends[pull] = newest(tmp_path / str(pull)), losses[-1]
    assert ends[0.0][0] != ends[50.0][0]
    assert ends[50.0][1]["agreement"] > 0.5  # of five actions


def test_without_a_family_it_is_the_team_of_the_scenario(tmp_path: Path) -> None:
    values = SMALL | {"train.env_steps": 160, "team.new_teams": 1}
    chosen = load_run_config("mixed-1-food", "team-max", overrides=values)
    training = TeamTraining(chosen, "training")
    with closing(training):
        teams = {one.env.scenario.robots for one in training._worlds._worlds}
    assert teams == {chosen.scenario.robots}
    train(chosen, tmp_path / "run")


def test_damaged_states_are_refused(tmp_path: Path) -> None:
    run = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        train(config(), run, progress=stops_after(320, "training"))
    saved = read_saved(run)
    for name, change, said in (
        ("worlds.teams", lambda x: x + 9, "must be in"),
        ("worlds.worlds", lambda x: x[:-5], "bytes"),
        ("worlds.lengths", lambda x: x.flip(0) - 1, "worlds"),
        ("worlds.open_rescues", lambda x: x - 1, "must be in"),
        ("learner.updates", lambda x: x - 1_000, "must be in"),
        ("learner.adam.actor.first.weight.exp_avg_sq", lambda x: x - 1.0, "negative"),
        ("learner.adam.actor.first.bias.step", lambda x: x[None], "must be"),
        ("learner.generator", lambda x: x[:3], "random generator"),
    ):
        state = dict(saved.state)
        state[name] = change(state[name].clone())
        with (
            closing(TeamTraining(saved.config, "training")) as training,
            pytest.raises(ValueError, match=said),
        ):
            training.load(saved.weights, state, "training")
    weights = dict(saved.weights)
    del weights["critic.out.bias"]
    with (
        closing(TeamTraining(saved.config, "training")) as training,
        pytest.raises(ValueError, match=r"has no 'critic\.out\.bias'"),
    ):
        training.load(weights, saved.state, "training")


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        train(config(), tmp_path / "run", progress=stops_after(320, "training"))
    state = tmp_path / "run/checkpoints/320/state.safetensors"
    data = bytearray(state.read_bytes())
    data[-1] ^= 1
    state.write_bytes(data)
    with pytest.raises(DamagedCheckpointError, match=r"state\.safetensors"):
        resume(tmp_path / "run")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"team.teams": 5}, "train.num_envs = 32: must be a multiple of team.teams = 5"),
        ({"team.new_teams": 7}, r"team.new_teams = 7: must be in 0\.\.=4"),
        ({"team.bodies": "hidden"}, r"team\.bodies = 'hidden': needs team\.features = 'plain'"),
        ({"team.pull": 0.5}, "team.pull = 0.5: needs a script to follow, train.warm_start"),
        ({"train.potential": "greedy"}, "train.potential: method 'team-inner' cannot follow it"),
        ({"train.on_divergence": "skip"}, "train.on_divergence: method 'team-inner' cannot"),
        ({"scenario.actions": "continuous"}, "learns 'discrete' actions only"),
        (
            {"scenario.faults": [{"robot": "food_0", "kind": "blackout", "value": 0.5}]},
            "scenario.faults: method 'team-inner' cannot be trained with 'blackout'",
        ),
        ({"train.env_steps": 0}, "train.env_steps = 0: must be at least 1 without a warm start"),
    ],
)
def test_what_it_cannot_do_is_refused(tmp_path: Path, values: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        train(
            load_run_config(method="team-inner", overrides=SMALL | values, family="any"),
            tmp_path / "run",
        )
    assert not (tmp_path / "run").exists()


def test_a_family_needs_a_method_for_any_team() -> None:
    with pytest.raises(ConfigError, match=r"family: train\.method = 'ppo-inner' learns for one"):
        load_run_config(method="ppo-inner", family="any")
    with pytest.raises(ConfigError, match=r"train\.env_steps = 0: must be at least 1"):
        load_run_config(method="ppo-inner", overrides={"train.env_steps": 0})


def test_a_family_is_a_file(tmp_path: Path) -> None:
    file = tmp_path / "rescuers.toml"
    file.write_text("[family]\nrobots = [2, 3]\nsituations = ['double']\n")
    found = load_run_config(method="team-inner", family=file).family
    assert found == Family(robots=(2, 3), situations=("double",))
    for text, said in (
        ("robot = [2, 3]", r"rescuers\.toml.*family\.robot.*robots"),
        ("[family]\nrobots = [3, 2]", "low end must not be above"),
        ("x = 1\n[family]\nrobots = [2, 3]", r"rescuers\.toml: x: must stand in \[family\]"),
    ):
        file.write_text(text)
        with pytest.raises(ConfigError, match=said):
            load_run_config(method="team-inner", family=file)
