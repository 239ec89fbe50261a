"""Pages that play: what they may send, what they get, and that none disturbs another."""

import json
import threading
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from spare_robots import spared_world

from innerattn.config import Scenario
from innerattn.errors import RunError, WorldError
from innerattn.evaluate.interactive import InteractiveWorld, endless
from innerattn.policies import scripted_policy
from innerattn.report.play.sessions import Sessions


def world() -> InteractiveWorld:
    scenario = endless(Scenario.preset("mixed").replace(max_victims=3))
    names = ("hungarian", "greedy")
    return InteractiveWorld(
        scenario, {name: scripted_policy(name, scenario) for name in names}, 10_001
    )


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def sessions(clock: Clock) -> Sessions:
    return Sessions(world, most=3, idle_s=60.0, clock=clock)


def sent(sessions: Sessions, path: str, message: Any) -> tuple[int, dict[str, Any]]:
    body = message if isinstance(message, bytes) else json.dumps(message).encode()
    answer = sessions.take(path, body)
    assert answer.kind == "application/json"
    document = json.loads(answer.text)
    assert document["schema_version"] == 1
    return int(answer.status), document


def opened(sessions: Sessions) -> str:
    status, document = sent(sessions, "sessions", {})
    assert status == 200
    return f"sessions/{document['session']}"


def test_a_page_gets_a_world_and_its_state(sessions: Sessions) -> None:
    status, document = sent(sessions, "sessions", {})
    assert status == 200
    assert len(document["session"]) >= 16
    assert document["worlds"]["robots"][0]["name"] == "food_0"
    assert document["policies"] == ["hungarian", "greedy"]
    assert (document["episode"], document["step"], document["rescued"]) == (0, 0, 0)
    path = f"sessions/{document['session']}"
    for step in range(1, 4):
        status, state = sent(sessions, path, {"do": "step"})
        assert (status, state["step"]) == (200, step)
    assert state["positions"] != document["positions"]


MESSAGES = [
    {"do": "look"},
    {"do": "policy", "name": "greedy"},
    {"do": "steer", "robot": 1, "x": 0.5, "y": -1},
    {"do": "steer", "robot": None},
    {"do": "move_robot", "robot": 0, "x": 0.25, "y": 0},
    {"do": "push_robot", "robot": 0, "vx": 1.5, "vy": 0.0},
    {"do": "faults", "robot": 0, "values": {"motor_gain": 0.2}},
    {"do": "move_victim", "slot": 0, "x": 0.1, "y": 0.1},
    {"do": "restart"},
]


def test_every_message_is_answered_with_the_state(sessions: Sessions) -> None:
    path = opened(sessions)
    for message in MESSAGES:
        status, state = sent(sessions, path, message)
        assert status == 200, (message, state)
    assert (state["policy"], state["episode"], state["faults"][0]) == ("greedy", 1, {})


REFUSED = [
    (b"", "message: Invalid JSON"),
    (b"{" * 3000, "message: Invalid JSON"),
    ([], "message: Input should be a valid dictionary"),
    ({}, "message: Unable to extract tag"),
    ({"do": "import os"}, "message: Input tag 'import os'"),
    ({"do": "step", "times": 5}, "message: step.times: Extra inputs"),
    ({"do": "move_robot", "robot": "0", "x": 0, "y": 0}, "move_robot.robot: Input should be a"),
    ({"do": "move_robot", "robot": 0, "x": 0}, "move_robot.y: Field required"),
    (b'{"do": "move_robot", "robot": 0, "x": NaN, "y": 0}', "Invalid JSON: NaN is not a number"),
    (b'{"do": "move_robot", "robot": 0, "x": 1e999, "y": 0}', "Invalid JSON: 1e999 is not finite"),
    (b'{"do": "step", "do": "restart"}', "the key 'do' comes twice"),
    ({"do": "move_victim", "slot": 0, "x": 1e308, "y": 0}, "x"),
    ({"do": "faults", "robot": 0, "values": {"motor_gain": 1e308}}, "motor_gain"),
    ({"do": "push_robot", "robot": 10**20, "vx": 0, "vy": 0}, "robot = 1000"),
    ({"do": "faults", "robot": 10**20, "values": {"motor_gain": 1}}, "robot = 1000"),
    ({"do": "steer", "robot": 10**20}, "robot = 1000"),
    ({"do": "move_robot", "robot": 10**30, "x": 0, "y": 0}, "robot = 1000"),
    ({"do": "move_robot", "robot": 0, "x": 1, "y": 0}, "x = 1.0: must be in -0.95..=0.95 m"),
    ({"do": "move_victim", "slot": 10**30, "x": 0, "y": 0}, "holds no victim"),
    ({"do": "add_victim", "task": 7, "x": 0, "y": 0}, "must be in 0..=1"),
    ({"do": "faults", "robot": 0, "values": {"motor_gain": 7}}, "motor_gain, env 0, robot 0"),
    ({"do": "faults", "robot": 0, "values": {"__class__": 1}}, "fault '__class__'"),
    ({"do": "add_robot"}, "message: add_robot.kind: Field required"),
    ({"do": "add_robot", "kind": 0}, "message: add_robot.kind: Input should be a valid string"),
    ({"do": "add_robot", "kind": "food"}, "kind = 'food': no robot can be added to this world"),
    ({"do": "policy", "name": "../../run"}, "policy = '../../run': must be one of"),
]


@pytest.mark.parametrize(("message", "text"), REFUSED, ids=[text for _, text in REFUSED])
def test_wrong_messages_are_refused_in_one_line(
    sessions: Sessions, message: Any, text: str
) -> None:
    path = opened(sessions)
    before = sent(sessions, path, {"do": "look"})
    status, answer = sent(sessions, path, message)
    assert status == 400
    assert text in answer["error"]
    assert "\n" not in answer["error"]
    assert sent(sessions, path, {"do": "look"}) == before


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=6,
)
fields = st.sampled_from(["kind", "robot", "x", "y", "vx", "vy", "slot", "task", "name", "values"])
kinds = st.sampled_from(
    ["step", "move_robot", "push_robot", "faults", "add_robot", "add_victim", "steer", "policy"]
)


@settings(max_examples=150)
@given(kinds, st.dictionaries(fields, json_values), st.binary(max_size=60))
def test_any_message_is_answered(kind: str, values: dict[str, Any], noise: bytes) -> None:
    sessions = SHARED
    path = opened(sessions)
    for body in (json.dumps({"do": kind, **values}).encode(), noise):
        status, _ = sent(sessions, path, body)
        assert status in (200, 400)
    assert sent(sessions, path, {"do": "step"})[0] == 200
    assert sent(sessions, path, {"do": "end"})[0] == 200


SHARED = Sessions(world)


def test_robots_are_added_until_none_is_left(clock: Clock) -> None:
    sessions = Sessions(lambda: spared_world(Scenario.preset("mixed"), 1, "greedy"), clock=clock)
    path = opened(sessions)
    add = {"do": "add_robot", "kind": "medical"}
    status, state = sent(sessions, path, add)
    assert (status, [one.get("unavailable", 0) for one in state["faults"]]) == (
        200,
        [0, 0, 0, 0, 1, 1, 0],
    )
    for message, text in (
        (add, "all 1 spare medical robots are in the arena: take one out first"),
        (add | {"kind": "tea"}, "kind = 'tea': must be one of food, navigation, medical"),
    ):
        before = sent(sessions, path, {"do": "look"})
        status, answer = sent(sessions, path, message)
        assert (status, answer["error"]) == (400, text)
        assert sent(sessions, path, {"do": "look"}) == before
    out = {"do": "faults", "robot": 6, "values": {"unavailable": 1.0}}
    assert sent(sessions, path, out)[1]["faults"][6] == {"unavailable": 1.0}
    assert sent(sessions, path, add)[1]["faults"][6] == {}


def test_two_pages_do_not_disturb_each_other(sessions: Sessions) -> None:
    one, other, alone = opened(sessions), opened(sessions), opened(sessions)
    assert len({one, other, alone}) == 3
    sent(sessions, one, {"do": "faults", "robot": 0, "values": {"unavailable": 1.0}})
    sent(sessions, one, {"do": "move_robot", "robot": 1, "x": 0.0, "y": 0.0})
    sent(sessions, one, {"do": "policy", "name": "greedy"})
    for _ in range(20):
        sent(sessions, one, {"do": "step"})
        found, wanted = (sent(sessions, path, {"do": "step"}) for path in (other, alone))
        assert found == wanted
    assert sent(sessions, one, {"do": "look"})[1]["faults"][0] == {"unavailable": 1.0}


def test_pages_at_the_same_time(sessions: Sessions) -> None:
    paths = [opened(sessions) for _ in range(3)]
    wanted = Sessions(world)
    alone = opened(wanted)
    for _ in range(30):
        expected = sent(wanted, alone, {"do": "step"})
    found: list[Any] = []

    def go(path: str) -> None:
        for _ in range(30):
            state = sent(sessions, path, {"do": "step"})
        found.append(state)

    threads = [threading.Thread(target=go, args=(path,)) for path in paths]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [expected] * 3


def test_sessions_end_with_their_pages(sessions: Sessions, clock: Clock) -> None:
    kept, closed, silent = opened(sessions), opened(sessions), opened(sessions)
    status, answer = sent(sessions, "sessions", {})
    assert (status, answer["error"]) == (
        503,
        "3 pages are open, the most at a time: close one, then reload",
    )
    assert sent(sessions, closed, {"do": "end"})[0] == 200
    clock.now = 50.0
    assert sent(sessions, kept, {"do": "look"})[0] == 200
    clock.now = 61.0
    assert len(sessions) == 1
    for gone in (closed, silent, "sessions/guessed"):
        status, answer = sent(sessions, gone, {"do": "step"})
        assert status == 410
        assert "has ended" in answer["error"]
    assert sent(sessions, kept, {"do": "step"})[0] == 200
    assert sent(sessions, "elsewhere", {"do": "step"})[0] == 404


def test_a_world_that_cannot_be_made_takes_no_place() -> None:
    def make() -> InteractiveWorld:
        raise RunError("runs/gone: no such run folder")

    sessions = Sessions(make, most=1)
    for _ in range(3):
        status, answer = sent(sessions, "sessions", {})
        assert (status, answer["error"]) == (400, "runs/gone: no such run folder")


def test_a_world_that_fails_starts_anew(
    sessions: Sessions, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = opened(sessions)
    step = InteractiveWorld.step

    def fail(_: InteractiveWorld) -> None:
        monkeypatch.setattr(InteractiveWorld, "step", step)
        raise WorldError("env 0: it failed in this step", [0])

    monkeypatch.setattr(InteractiveWorld, "step", fail)
    status, answer = sent(sessions, path, {"do": "step"})
    assert (status, answer["error"]) == (500, "env 0: it failed in this step")
    status, state = sent(sessions, path, {"do": "step"})
    assert (status, state["episode"], state["step"]) == (200, 1, 1)
