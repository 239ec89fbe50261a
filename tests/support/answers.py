"""What the page of one file and the server of `innerattn play` answer to the same messages."""

import json
from typing import Any

import numpy as np
import pytest

from innerattn.report.play.sessions import Sessions

# Begins a world of another document, and answers messages; gives all states, or what was refused.
ANSWER = """async ([given, messages]) => {
  const { rust, constructor: Inside, given: own } = play.link.transport;
  const inside = new Inside(rust, given ?? own), opened = await inside.ask("sessions", {});
  const found = [opened];
  for (const message of messages) {
    try {
      found.push(await inside.ask(`sessions/${opened.session}`, message));
    } catch (error) {
      found.push({ schema_version: 1, error: error.message });
    }
  }
  inside.leave(`sessions/${opened.session}`);
  return found;
}"""


def served(make: Any, messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What the server of `innerattn play` answers."""
    sessions, found = Sessions(make), []
    path = "sessions"
    for message in [{}, *messages]:
        found.append(json.loads(sessions.take(path, json.dumps(message).encode()).text))
        path = f"sessions/{found[0]['session']}"
    return found


def like(ours: Any, theirs: Any, place: str = "answer", within: float = 2e-5) -> None:
    """The same but for the last digit of numbers that were rounded.

    Where actions are vectors, their last bits grow from step to step; ``within`` says how far.
    """
    if isinstance(theirs, dict):
        assert sorted(ours) == sorted(theirs), place
        for key in theirs:
            if key != "session":
                like(ours[key], theirs[key], f"{place}.{key}", within)
    elif isinstance(theirs, list):
        assert len(ours) == len(theirs), place
        for index, (one, other) in enumerate(zip(ours, theirs, strict=True)):
            like(one, other, f"{place}[{index}]", within)
    elif isinstance(theirs, float) and not isinstance(ours, bool):
        most = max(2e-3, within) if "attention" in place else within
        assert ours == pytest.approx(theirs, abs=most), place
    else:
        assert ours == theirs, place


def drawn_messages(count: int, policy: str) -> list[dict[str, Any]]:
    """Steps, and now and then a hand that reaches in; some of it is refused."""
    draws = np.random.default_rng(11)
    at = lambda most=1.0: round(float(draws.uniform(-most, most)), 3)  # noqa: E731
    found: list[dict[str, Any]] = []
    for _ in range(count):
        robot = int(draws.integers(4))
        wrong = {"motor_gain": 0.2, "heading_bias": 0.5, "unavailable": 1.0, "blackout": 1.0}
        kind = list(wrong)[draws.integers(4)]
        reached: list[dict[str, Any]] = [
            {"do": "look"},
            {"do": "move_robot", "robot": robot, "x": at(), "y": at()},
            {"do": "push_robot", "robot": robot, "vx": at(5.5), "vy": at(5.5)},
            {"do": "faults", "robot": robot, "values": {kind: wrong[kind]}},
            {"do": "faults", "robot": robot, "values": {"motor_gain": 1.0, kind: 2.0}},
            {"do": "faults", "robot": robot, "values": {"unavailable": 0.0, "blackout": 0.0}},
            {"do": "move_victim", "slot": int(draws.integers(2)), "x": at(), "y": at()},
            {"do": "add_victim", "task": int(draws.integers(2)), "x": at(), "y": at()},
            {"do": "steer", "robot": robot, "x": at(), "y": at()},
            {"do": "steer", "robot": None},
            {"do": "policy", "name": policy},
            {"do": "restart"},
            {"do": "restart", "seed": int(draws.integers(20_000))},
        ]
        found.append(reached[draws.integers(len(reached))])
        found += [{"do": "step"}] * 12
    return found
