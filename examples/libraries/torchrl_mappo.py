"""TorchRL's MAPPO on `RescueTorchRLEnv`: a policy for each robot, and critics that see the state.

Robots of a kind are a group, as the environment has them. Every rollout is one whole episode of all
worlds.
"""

from __future__ import annotations

import torch
from numpy.typing import NDArray
from scoring import Stopwatch, options, report
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import Tensor, nn
from torch.distributions import Categorical
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import MLP, MultiAgentMLP, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss, ValueEstimators

from innerattn.config import Scenario
from innerattn.envs import RescueTorchRLEnv

WORLDS, EPOCHS, MINIBATCHES = 128, 4, 4
GAMMA, LAMBDA, CLIP, ENTROPY, RATE, MAX_NORM = 0.98, 0.9, 0.2, 0.01, 2e-3, 0.5


def make_actor(env: RescueTorchRLEnv, kind: str) -> ProbabilisticActor:
    """The policy of a kind; it reads (E, n, D) and writes actions (E, n)."""
    robots, width = env.observation_spec[kind, "observation"].shape[-2:]
    network = MultiAgentMLP(
        n_agent_inputs=width,
        n_agent_outputs=env.full_action_spec[kind, "action"].space.n,
        n_agents=robots,
        centralized=False,
        share_params=False,
        depth=2,
        num_cells=64,
        activation_class=nn.Tanh,
    )
    return ProbabilisticActor(
        TensorDictModule(network, [(kind, "observation")], [(kind, "logits")]),
        spec=env.full_action_spec[kind, "action"],
        in_keys={"logits": (kind, "logits")},
        out_keys=[(kind, "action")],
        distribution_class=Categorical,
        return_log_prob=True,
        log_prob_key=(kind, "log_prob"),
    )


def make_loss(env: RescueTorchRLEnv, kind: str, actor: ProbabilisticActor) -> ClipPPOLoss:
    """PPO's loss of a kind; its critic maps the state (E, S) to values (E, n, 1)."""
    robots, state = len(env.group_map[kind]), env.observation_spec["state"].shape[-1]
    values = MLP(state, robots, depth=2, num_cells=64, activation_class=nn.Tanh)
    critic = TensorDictModule(
        nn.Sequential(values, nn.Unflatten(-1, (robots, 1))), ["state"], [(kind, "state_value")]
    )
    loss = ClipPPOLoss(
        actor,
        critic,
        clip_epsilon=CLIP,
        entropy_coeff=ENTROPY,
        normalize_advantage=True,
        normalize_advantage_exclude_dims=(-2,),
    )
    keys = {"sample_log_prob": "log_prob", "value": "state_value"}
    keys |= {name: name for name in ("action", "reward", "done", "terminated", "advantage")}
    loss.set_keys(**{name: (kind, key) for name, key in keys.items()})
    loss.set_keys(value_target=(kind, "value_target"))
    loss.make_value_estimator(ValueEstimators.GAE, gamma=GAMMA, lmbda=LAMBDA)
    return loss


def update(
    rollout: TensorDictBase, kind: str, loss: ClipPPOLoss, adam: torch.optim.Optimizer
) -> None:
    """Train a kind's policy and critic on a rollout (E, T)."""
    shape = rollout["next", kind, "reward"].shape
    for name in ("done", "terminated"):  # an episode ends for the whole team
        rollout["next", kind, name] = rollout["next", name].unsqueeze(-1).expand(shape)
    with torch.no_grad():
        loss.value_estimator(
            rollout,
            params=loss.critic_network_params,
            target_params=loss.target_critic_network_params,
        )
    rows = rollout.reshape(-1)
    for _ in range(EPOCHS):
        for chosen in torch.randperm(len(rows)).split(len(rows) // MINIBATCHES):
            found = loss(rows[chosen])
            total = found["loss_objective"] + found["loss_critic"] + found["loss_entropy"]
            adam.zero_grad()
            total.backward()
            nn.utils.clip_grad_norm_(loss.parameters(), MAX_NORM)
            adam.step()


def main() -> None:
    """Train for a number of env-steps and score the team."""
    given = options(__doc__, 200_000)
    torch.manual_seed(given.seed)
    env = RescueTorchRLEnv(given.situation, WORLDS, seed=given.seed)
    actors = {kind: make_actor(env, kind) for kind in env.group_map}
    losses = {kind: make_loss(env, kind, actor) for kind, actor in actors.items()}
    adams = {kind: torch.optim.Adam(loss.parameters(), lr=RATE) for kind, loss in losses.items()}
    team = TensorDictSequential(*actors.values())
    watch, done = Stopwatch(), 0
    while done < given.env_steps:
        with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
            rollout = env.rollout(env.scenario.episode_steps, team, break_when_any_done=False)
        for kind, loss in losses.items():
            update(rollout, kind, loss, adams[kind])
        done += rollout.numel()
    spent = watch.stop()

    names = [robot.name for robot in Scenario.preset(given.situation).robots]

    def actor(obs: NDArray) -> NDArray:
        chosen: dict[str, Tensor] = {}
        for kind, robots in env.group_map.items():
            own = torch.from_numpy(obs[:, [names.index(robot) for robot in robots]])
            with torch.no_grad():
                best = actors[kind][0].module(own).argmax(dim=-1)
            chosen |= dict(zip(robots, best.unbind(dim=1), strict=True))
        return torch.stack([chosen[name] for name in names], dim=1).numpy()

    report("torchrl", "MAPPO", given, done, spent, actor)


if __name__ == "__main__":
    main()
