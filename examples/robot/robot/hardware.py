"""A world that stands for hardware: it runs at the control period, whoever is late."""

from __future__ import annotations

import json
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.policies import Exported, PolicyInput
from robot.link import LinkSettings, open_socket, pack, received
from robot.member import MemberSettings

_START_S = 120.0
"""Processes must have begun within so long [s]."""
_DEADLINE_SHARE = 0.9
"""A command that comes later in its control period is not carried out."""


@dataclass(frozen=True)
class Drive:
    """What to drive: a team, for how long, how fast, over which link.

    Attributes:
        export: folder of the team.
        episodes: how many.
        episode_steps: length of an episode [control steps]; None: as in the scenario.
        scale: world seconds in a second of this machine; 1: real time.
        seed: of the worlds, losses, clocks and drawn actions.
        backend: what computes the policies; None: onnxruntime where it is installed.
    """

    export: Path
    episodes: int = 4
    episode_steps: int | None = None
    scale: float = 1.0
    seed: int = 0
    backend: str | None = None

    def world(self, team: Exported) -> BatchEnv:
        """The world, at the start of its first episode."""
        scenario = Scenario.model_validate(team.contract.scenario)
        if self.episode_steps is not None:
            scenario = scenario.replace(episode_steps=self.episode_steps)
        env = BatchEnv(scenario, 1, seed=self.seed, num_threads=1)
        env.reset()
        return env


@dataclass
class Outcome:
    """What a drive came to.

    Attributes:
        rescues: of all episodes.
        episodes: how many.
        commands: that were carried out.
        late: control periods in which a robot gave no command in time; it then has no force.
        heard: teammates whose messages were fresh, as a sum over commands.
        teammates: of each robot.
        overruns: control periods that began late, as this machine was busy.
    """

    rescues: int = 0
    episodes: int = 0
    commands: int = 0
    late: int = 0
    heard: int = 0
    teammates: int = 0
    overruns: int = 0

    @property
    def rescues_per_episode(self) -> float:
        """Mean number of rescues."""
        return self.rescues / self.episodes

    @property
    def heard_share(self) -> float:
        """Share of teammates with fresh messages, when a robot decided."""
        return self.heard / max(1, self.commands * self.teammates)


def drive(settings: Drive, link: LinkSettings) -> Outcome:
    """Drive a team of processes, one for each robot, through whole episodes.

    Raises:
        RuntimeError: a process did not begin, or has ended.
    """
    team = Exported(settings.export, backend="numpy")
    names = team.robot_names
    env = settings.world(team)
    outcome = Outcome(episodes=settings.episodes, teammates=len(names) - 1)
    with _members(settings, link, names) as (port, processes, addresses):
        start = time.monotonic() + 0.1
        period = team.contract.control_period_s / settings.scale
        peers = {name: peer for name, (_, peer) in addresses.items()}
        for address, _ in addresses.values():
            begin = {"kind": "begin", "start": start, "scale": settings.scale, "peers": peers}
            port.sendto(pack(begin), address)
        ticks = settings.episodes * env.scenario.episode_steps
        begins = start
        for tick in range(ticks):
            wait = begins - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            else:
                outcome.overruns += wait < -0.5 * period
                begins -= min(0.0, wait)  # the world waits, too: nothing is skipped
            _sense(env, team, tick, port, addresses)
            commands = _commands(port, tick, len(names), begins + _DEADLINE_SHARE * period)
            if any(process.poll() is not None for process in processes):
                raise RuntimeError("a robot's process has ended")
            shape = (1, len(names), 2) if env.continuous else (1, len(names))
            actions = np.zeros(shape, np.float32 if env.continuous else np.int64)
            for name, command in commands.items():
                actions[0, names.index(name)] = command["action"]
                outcome.heard += command["heard"]
            outcome.commands += len(commands)
            outcome.late += len(names) - len(commands)
            outcome.rescues += len(env.step(actions).rescues)
            begins += period
        for address, _ in addresses.values():
            port.sendto(pack({"kind": "end"}), address)
    return outcome


def drive_directly(settings: Drive) -> Outcome:
    """The same team in the same worlds in this process: every robot knows everything at once."""
    team = Exported(settings.export, backend=settings.backend, seed=settings.seed)  # type: ignore[arg-type]
    env = settings.world(team)
    robots = len(team.robot_names)
    outcome = Outcome(episodes=settings.episodes, teammates=robots - 1)
    for _ in range(settings.episodes * env.scenario.episode_steps):
        actions = team.act(PolicyInput(env.observe()))
        outcome.rescues += len(env.step(actions).rescues)
        outcome.commands += robots
        outcome.heard += robots * (robots - 1)
    return outcome


Address = tuple[str, int]


@contextmanager
def _members(
    settings: Drive, link: LinkSettings, names: tuple[str, ...]
) -> Iterator[tuple[socket.socket, list[subprocess.Popen[bytes]], dict[str, tuple[Address, int]]]]:
    """The processes, and where each listens to hardware and to its teammates."""
    port = open_socket()
    own = port.getsockname()[1]
    paths = [str(Path(__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "OMP_NUM_THREADS": "1"}
    processes = []
    try:
        for index, name in enumerate(names):
            member = MemberSettings(
                export=str(settings.export),
                name=name,
                hardware_port=own,
                backend=settings.backend,
                seed=settings.seed * 1_000 + index,
                latency_s=link.latency_s,
                loss=link.loss,
                skew_s=link.skew_s,
            )
            command = [sys.executable, "-m", "robot.member", member.text()]
            processes.append(subprocess.Popen(command, env=environment))
        yield port, processes, _greeted(port, processes, names)
        for process in processes:
            process.wait(timeout=_START_S)
    finally:
        for process in processes:
            process.kill()
            process.wait()
        port.close()


def _greeted(
    port: socket.socket, processes: list[subprocess.Popen[bytes]], names: tuple[str, ...]
) -> dict[str, tuple[Address, int]]:
    found: dict[str, tuple[Address, int]] = {}
    end = time.monotonic() + _START_S
    while not found.keys() >= set(names):
        if time.monotonic() > end or any(one.poll() is not None for one in processes):
            raise RuntimeError(f"only {len(found)} of {len(names)} robots' processes began")
        if not select.select([port], [], [], 0.2)[0]:
            continue
        data, address = port.recvfrom(4096)
        try:
            message = json.loads(data)
            found[message["robot"]] = (address, int(message["port"]))
        except (ValueError, LookupError, TypeError):
            continue  # somebody else's
    return {name: found[name] for name in names}


def _sense(
    env: BatchEnv,
    team: Exported,
    tick: int,
    port: socket.socket,
    addresses: dict[str, tuple[Address, int]],
) -> None:
    """Tell each robot its own pose and velocity, and where victims are."""
    positions, velocities = env.positions()[0].tolist(), env.velocities()[0].tolist()
    tasks = [task.name for task in team.contract.tasks]
    victims = [
        {"task": tasks[one["task"]], "position": [float(one["x"]), float(one["y"])]}
        if one["present"]
        else None
        for one in env.victims()[0]
    ]
    unavailable = env.fault_state()["unavailable"][0] >= 1.0
    for index, (address, _) in enumerate(addresses.values()):
        own = {
            "position": positions[index],
            "velocity": velocities[index],
            "available": not unavailable[index],
        }
        message: dict[str, Any] = {
            "kind": "sense",
            "tick": tick,
            "episode": int(env.episodes()[0]),
            "own": own,
            "victims": victims,
        }
        port.sendto(pack(message), address)


def _commands(
    port: socket.socket, tick: int, count: int, deadline: float
) -> dict[str, dict[str, Any]]:
    """The commands for this control period that come in time, by robot."""
    found: dict[str, dict[str, Any]] = {}
    while len(found) < count and (left := deadline - time.monotonic()) > 0:
        if select.select([port], [], [], left)[0]:
            for message in received(port):
                if message.get("kind") == "command" and message["tick"] == tick:
                    found[message["robot"]] = message
    return found
