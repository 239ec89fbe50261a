"""Environments to compare, each behind the same few calls: steps of a batch, places for studies.

Every contestant has four agents, a new episode at once when one ends, and five discrete actions.
Peers play their simple spread, the scene nearest to ours. A contestant imports its package when it
is made, so that each can be measured in a process of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

AGENTS = 4
ACTIONS = 5

Floats = NDArray[np.float32]


class Contestant(Protocol):
    """E worlds of four agents.

    Attributes:
        radii: (4,) radii of the agents, m.
        speed: Speed of the fastest agent, m/s.
    """

    radii: Floats
    speed: float

    def prepare(self, actions: NDArray[np.int64]) -> Any:
        """Actions (E, 4) in the form the package likes best; this is not timed."""

    def act(self, actions: Any) -> object:
        """One control step under prepared actions; all that a learner reads is made ready."""

    def move(self, positions: Floats, velocities: Floats) -> None:
        """Put all agents at positions (E, 4, 2) with velocities (E, 4, 2)."""

    def positions(self) -> Floats:
        """Places of all agents, (E, 4, 2)."""


class Ours:
    """The default mixed scenario."""

    def __init__(self, num_envs: int, episode: int, engine: str, substeps: int) -> None:
        from innerattn.config import Scenario
        from innerattn.envs import BatchEnv

        changed = {"engine": engine, "substeps": substeps, "episode_steps": episode}
        scenario = Scenario.model_validate(Scenario.preset("mixed").model_dump() | changed)
        self.env = BatchEnv(scenario, num_envs, seed=0, copy=False)
        self.env.reset()
        self.radii = np.array([robot.radius_m for robot in scenario.robots], dtype=np.float32)
        self.speed = max(robot.max_speed_mps for robot in scenario.robots)
        self.prepare = np.ascontiguousarray
        self.act = self.env.step
        self.move = self.env.set_motion
        self.positions = self.env.positions


class Vmas:
    """VMAS: PyTorch tensors over the batch."""

    def __init__(self, num_envs: int, episode: int) -> None:
        import torch
        from vmas import make_env

        self.torch = torch
        self.env = make_env(
            "simple_spread",
            num_envs,
            device="cpu",
            continuous_actions=False,
            max_steps=episode,
            seed=0,
            n_agents=AGENTS,
        )
        self.env.reset()
        self.agents = self.env.world.agents
        self.radii = np.array([agent.shape.radius for agent in self.agents], dtype=np.float32)
        self.speed = 1.0
        self.steps, self.episode = 0, episode

    def prepare(self, actions: NDArray[np.int64]) -> Any:
        columns = self.torch.from_numpy(actions)
        return [columns[:, agent, None].contiguous() for agent in range(AGENTS)]

    def act(self, actions: Any) -> object:
        result = self.env.step(list(actions))
        self.steps += 1
        if self.steps % self.episode == 0:  # all episodes end together
            return result, self.env.reset()
        return result

    def move(self, positions: Floats, velocities: Floats) -> None:
        for index, agent in enumerate(self.agents):
            agent.set_pos(self.torch.from_numpy(positions[:, index].copy()), batch_index=None)
            agent.set_vel(self.torch.from_numpy(velocities[:, index].copy()), batch_index=None)

    def positions(self) -> Floats:
        places: Floats = self.torch.stack([a.state.pos for a in self.agents], dim=1).numpy()
        return places


class Mpe2:
    """mpe2, the particle environments of PettingZoo: one world at a time."""

    def __init__(self, num_envs: int, episode: int) -> None:
        from mpe2 import simple_spread_v3

        make = simple_spread_v3.parallel_env
        self.envs = [make(N=AGENTS, max_cycles=episode) for _ in range(num_envs)]
        for seed, env in enumerate(self.envs):
            env.reset(seed=seed)
        self.worlds = [env.unwrapped.world for env in self.envs]
        self.radii = np.array([agent.size for agent in self.worlds[0].agents], dtype=np.float32)
        self.speed = 1.0

    def prepare(self, actions: NDArray[np.int64]) -> Any:
        names = self.envs[0].possible_agents
        return [dict(zip(names, row.tolist(), strict=True)) for row in actions]

    def act(self, actions: Any) -> object:
        results = []
        for env, chosen in zip(self.envs, actions, strict=True):
            step = env.step(chosen)
            results.append((step, None if env.agents else env.reset()))
        return results

    def move(self, positions: Floats, velocities: Floats) -> None:
        for world, places, speeds in zip(self.worlds, positions, velocities, strict=True):
            for agent, place, speed in zip(world.agents, places, speeds, strict=True):
                agent.state.p_pos, agent.state.p_vel = place.astype(float), speed.astype(float)

    def positions(self) -> Floats:
        return np.array([[a.state.p_pos for a in w.agents] for w in self.worlds], dtype=np.float32)


class JaxMarl:
    """JaxMARL: one compiled step over the batch, new episodes inside it."""

    def __init__(self, num_envs: int, episode: int) -> None:
        import jax
        import jaxmarl

        self.jax, self.num_envs = jax, num_envs
        env = jaxmarl.make(
            "MPE_simple_spread_v3", num_agents=AGENTS, num_landmarks=AGENTS, max_steps=episode
        )
        self.names = env.agents
        keys = jax.random.split(jax.random.key(0), num_envs)
        _, self.state = jax.jit(jax.vmap(env.reset))(keys)
        self.keys = keys

        def step(keys: object, state: object, actions: object) -> object:
            chosen = {name: actions[:, agent] for agent, name in enumerate(self.names)}  # type: ignore[index]
            pairs = jax.vmap(jax.random.split)(keys)
            return pairs[:, 0], *jax.vmap(env.step)(pairs[:, 1], state, chosen)

        self.step = jax.jit(step)
        self.radii = np.asarray(env.rad[:AGENTS], dtype=np.float32)
        self.speed = 1.0

    def prepare(self, actions: NDArray[np.int64]) -> Any:
        return self.jax.numpy.asarray(actions, dtype="int32")

    def act(self, actions: Any) -> object:
        self.keys, obs, self.state, *rest = self.step(self.keys, self.state, actions)
        return self.jax.block_until_ready((obs, rest))

    def move(self, positions: Floats, velocities: Floats) -> None:
        state = self.state
        self.state = state.replace(
            p_pos=state.p_pos.at[:, :AGENTS].set(positions),
            p_vel=state.p_vel.at[:, :AGENTS].set(velocities),
        )

    def positions(self) -> Floats:
        return np.asarray(self.state.p_pos[:, :AGENTS])


def _ours(engine: str, substeps: int = 6) -> Callable[[int, int], Contestant]:
    return lambda num_envs, episode: Ours(num_envs, episode, engine, substeps)


CONTESTANTS: dict[str, tuple[str, Callable[[int, int], Contestant]]] = {
    "innerattn rapier": ("innerattn", _ours("rapier")),
    "innerattn rapier, 4 substeps": ("innerattn", _ours("rapier", 4)),
    "innerattn rapier, 2 substeps": ("innerattn", _ours("rapier", 2)),
    "innerattn rapier, 1 substep": ("innerattn", _ours("rapier", 1)),
    "innerattn discs": ("innerattn", _ours("discs")),
    "VMAS": ("vmas", Vmas),
    "mpe2": ("mpe2", Mpe2),
    "JaxMARL": ("jaxmarl", JaxMarl),
}
"""Package, and maker from the number of worlds and the steps of an episode, by name."""


def installed(package: str) -> str | None:
    """The version of a package that is here, or None."""
    try:
        return version(package)
    except ImportError:
        return None
