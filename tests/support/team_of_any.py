"""Policies for any team, for one of five robots and in random teams."""

from contextlib import closing
from pathlib import Path
from typing import Any

import torch

from innerattn.config import RunConfig, Scenario, load_run_config
from innerattn.envs import BatchEnv
from innerattn.policies.exported.contract import WEIGHTS, Contract, contract_in, contract_text
from innerattn.policies.exported.pair_network import PairActor, PairLayers
from innerattn.policies.exported.view import VIEW, ViewActor
from innerattn.train import RunFolder
from innerattn.train.export import export_run
from innerattn.train.export.document import contract_document, network_of
from innerattn.train.export.view_form import ViewForm
from innerattn.train.teams.policy import TeamPolicy
from innerattn.zoo import run_path

_DRONE = {"kind": "drone", "abilities": ["look"], "max_speed_mps": 1.8, "mass_kg": 0.4}
_DIGGER = {"kind": "digger", "abilities": ["dig"], "max_speed_mps": 0.6, "mass_kg": 1.5}
_MEDIC = {"kind": "medic", "abilities": ["heal"], "max_speed_mps": 1.2, "mass_kg": 0.8}

TEAM = Scenario.model_validate(
    {
        "max_victims": 3,
        "episode_steps": 50,
        "robots": [
            {"name": "drone_0", **_DRONE},
            {"name": "drone_1", **_DRONE},
            {"name": "digger_0", **_DIGGER},
            {"name": "digger_1", **_DIGGER},
            {"name": "medic", **_MEDIC},
        ],
        "tasks": [
            {"name": "buried", "needs": ["dig", "dig", "look"]},
            {"name": "hurt", "needs": ["heal", "look"]},
        ],
    }
)


def exported(folder: Path) -> None:
    """Export ``zoo:any`` for `TEAM` into ``export``."""
    export_run(run_path("zoo:any"), folder / "export", TEAM)


def config_of(pooling: str, scenario: Scenario, seed: int) -> RunConfig:
    """A run of one method in these worlds."""
    values = {"train.threads": 1, "train.seed": seed, "team.hidden_width": 24}
    made = load_run_config(method=f"team-{pooling}", overrides=values)
    return made.model_copy(update={"scenario": scenario})


def policy_of(config: RunConfig) -> TeamPolicy:
    """A policy whose outputs differ, as trained ones' do."""
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        policy = TeamPolicy(config, env)
    draw = torch.Generator().manual_seed(config.train.seed)
    with torch.no_grad():
        for parameter in policy.actor.parameters():
            parameter += 0.1 * torch.randn(parameter.shape, generator=draw)
    return policy


def contract_of(config: RunConfig) -> Contract:
    """The contract of an export whose files are not there."""
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        names = env.observation_names()
    document = contract_document(
        config,
        names,
        network_of(config, names, None),
        of_robot=["any"] * len(config.scenario.robots),
        actors={"any": WEIGHTS},
        weights_sha256="0" * 64,
        run={"method": config.train.method},
        files={WEIGHTS: b""},
    )
    return contract_in(contract_text(document))


def actors_of(contract: Contract, policy: TeamPolicy) -> list[PairActor]:
    """The policy in numpy, for each robot."""
    tensors = {name: one.numpy() for name, one in policy.actor.state_dict().items()}
    layers = PairLayers(contract.network, tensors)
    return [PairActor(contract, robot, layers) for robot in range(len(contract.robots))]


class EagerFile:
    """The graph of a policy's ONNX file, computed by torch."""

    def __init__(self, policy: TeamPolicy) -> None:
        self._form = ViewForm(policy.actor)

    @torch.no_grad()
    def logits(self, view: dict[str, Any]) -> Any:
        """See `innerattn.policies.exported.view.ViewFile`."""
        logits, probabilities = self._form(*(torch.tensor(view[name]) for name in VIEW))
        torch.testing.assert_close(probabilities, logits.exp(), rtol=1e-4, atol=1e-6)
        return logits.numpy()


def view_actors_of(contract: Contract, file: Any) -> list[ViewActor]:
    """The policy of a file, for each robot."""
    return [ViewActor(contract, robot, file) for robot in range(len(contract.robots))]


def run_of(folder: Path, config: RunConfig) -> Path:
    """A run folder with the weights of `policy_of`."""
    run = RunFolder.create(folder, config, threads=1)
    run.save_weights(policy_of(config).state(), 0)
    run.mark("done", 0, 0, 0.0)
    return folder
