"""The process of one robot: it senses, tells its teammates, listens, decides, and drives.

It gets an exported team, and knows nothing of the world but what its messages say.
"""

from __future__ import annotations

import json
import os
import random
import select
import signal
import sys
from dataclasses import asdict, dataclass
from typing import Any

from innerattn.errors import ReadingError
from innerattn.policies.exported import Exported
from robot.link import LOOPBACK, Clock, LinkSettings, LossyLink, open_socket, pack, received

LISTEN_SHARE = 0.3
"""Part of a control period that a robot listens to its teammates before it decides."""
_MOST_PATIENCE_S = 1.0
"""So often a process that waits looks whether the hardware's process is still there [s]."""


@dataclass(frozen=True)
class MemberSettings:
    """What a process is told on its command line."""

    export: str
    name: str
    hardware_port: int
    backend: str | None
    seed: int
    latency_s: float
    loss: float
    skew_s: float

    def text(self) -> str:
        """As one word of a command line."""
        return json.dumps(asdict(self))


class Member:
    """One robot."""

    def __init__(self, settings: MemberSettings) -> None:
        """Load the team and open the sockets."""
        self._name = settings.name
        self._team = Exported(settings.export, backend=settings.backend, seed=settings.seed)  # type: ignore[arg-type]
        self._max_age_s = self._team.contract.max_age_s
        self._period_s = self._team.contract.control_period_s
        self._hardware = open_socket()
        self._hardware.connect((LOOPBACK, settings.hardware_port))
        link = LinkSettings(settings.latency_s, settings.loss, settings.skew_s)
        self._link = LossyLink(link, settings.seed)
        self._skew_s = random.Random(settings.seed).uniform(-settings.skew_s, settings.skew_s)
        self._clock = Clock(0.0, 1.0)
        self._peers: list[int] = []
        self._heard: dict[str, dict[str, Any]] = {}
        self._sensed: dict[str, Any] | None = None
        self._decide_at = 0.0

    def run(self) -> int:
        """Serve until the hardware says that it is over, or is gone; the exit code."""
        parent = os.getppid()
        self._tell_hardware({"kind": "hello", "port": self._link.port})
        while True:
            ready, _, _ = select.select(
                [self._hardware, self._link.socket], [], [], self._patience()
            )
            if not ready and os.getppid() != parent:
                print(f"{self._name}: the hardware is gone", file=sys.stderr)
                return 1
            for message in received(self._hardware):
                if message["kind"] == "end":
                    return 0
                self._take(message)
            for message in received(self._link.socket):
                self._listen(message)
            now = self._clock.now()
            self._link.flush(now)
            if self._sensed is not None and now >= self._decide_at:
                self._decide(self._sensed)
                self._sensed = None

    def _patience(self) -> float:
        """Until something is to be done [s of this machine]."""
        times = [] if self._link.next_due is None else [self._link.next_due]
        if self._sensed is not None:
            times.append(self._decide_at)
        if not times:
            return _MOST_PATIENCE_S
        return min(_MOST_PATIENCE_S, self._clock.real(min(times) - self._clock.now()))

    def _take(self, message: dict[str, Any]) -> None:
        """What the hardware says: how to begin, or what the robot senses."""
        if message["kind"] == "begin":
            self._clock = Clock(message["start"], message["scale"], self._skew_s)
            peers = message["peers"]
            self._peers = [port for name, port in peers.items() if name != self._name]
            return
        now = self._clock.now()
        if self._sensed is None or self._sensed["episode"] != message["episode"]:
            self._heard = {
                name: one
                for name, one in self._heard.items()
                if one["episode"] == message["episode"]
            }
        self._sensed = {**message, "time": now}
        self._decide_at = now + LISTEN_SHARE * self._period_s
        own = {key: message["own"][key] for key in ("position", "velocity", "available")}
        told = {"robot": self._name, "episode": message["episode"], "time": now, "body": own}
        self._link.send(told, self._peers, now)

    def _listen(self, message: dict[str, Any]) -> None:
        """Keep the newest message of each teammate; drop what is none."""
        name, episode, time = (message.get(key) for key in ("robot", "episode", "time"))
        if name not in self._team.robot_names or name == self._name:
            return
        if not (isinstance(episode, int) and isinstance(time, float) and "body" in message):
            return
        before = self._heard.get(name)
        if before is None or (episode, time) > (before["episode"], before["time"]):
            self._heard[name] = message

    def _decide(self, sensed: dict[str, Any]) -> None:
        now = self._clock.now()
        teammates = {
            name: {**one["body"], "time": one["time"]}
            for name, one in self._heard.items()
            if one["episode"] == sensed["episode"] and isinstance(one["body"], dict)
        }
        readings = {
            "now": now,
            "own": {**sensed["own"], "time": sensed["time"]},
            "victims_time": sensed["time"],
            "victims": sensed["victims"],
            "teammates": teammates,
        }
        fresh = [one for one in teammates.values() if abs(now - one["time"]) <= self._max_age_s]
        try:
            decision = self._team.decide(self._name, readings)
        except ReadingError as error:  # no command: the hardware gives no force then
            print(f"{self._name}: {error}", file=sys.stderr)
            return
        self._tell_hardware(
            {
                "kind": "command",
                "tick": sensed["tick"],
                "action": (decision.force.tolist() if decision.action is None else decision.action),
                "heard": len(fresh),
            }
        )

    def _tell_hardware(self, message: dict[str, Any]) -> None:
        self._hardware.send(pack({"robot": self._name, **message}))


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the hardware, which ends us
    sys.exit(Member(MemberSettings(**json.loads(sys.argv[1]))).run())
