"""Policies for any team on robots: they act as the learner does on each robot's own row."""

import json
import shutil
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from team_of_any import (
    TEAM,
    EagerFile,
    actors_of,
    config_of,
    contract_of,
    policy_of,
    view_actors_of,
)

from innerattn.config import Scenario
from innerattn.config.family import Family
from innerattn.config.scenario import Fault
from innerattn.envs import BatchEnv
from innerattn.errors import ExportError, ReadingError
from innerattn.nn.teams.frames import turn, turn_back_choices
from innerattn.policies import Exported, PolicyInput
from innerattn.policies.exported.contract import contract_text
from innerattn.policies.exported.pair_network import mixture
from innerattn.policies.exported.pairs import frame_of, turned
from innerattn.policies.exported.readings import RowBuilder
from innerattn.policies.exported.table import bodies_of, demand_of
from innerattn.policies.exported.view import VIEW, ViewFile
from innerattn.train.export.check import MOST_OF_PAIRS, at_edge
from innerattn.train.export.onnx_file import view_file
from innerattn.train.export.view_form import ViewForm
from innerattn.train.export.view_pairs import View
from innerattn.train.teams.sheet import TeamSheet, as_tensor

POOLINGS = ("inner", "uniform", "max", "nearest")
SORTS = Family(robots=(2, 9), unavailable=0.5, service=0.5, deadline=0.4, order=0.5)
SENSES = (
    (),
    (Fault(robot="robot_0", kind="lost_communication", value=0.3),),
    (Fault(robot="robot_1", kind="position_noise", value=0.1),),
)


@given(
    number=st.integers(0, 10_000),
    pooling=st.sampled_from(POOLINGS),
    faults=st.sampled_from(SENSES),
    leave=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_any_team_acts_as_the_learner_does(
    number: int, pooling: str, faults: tuple[Fault, ...], leave: bool
) -> None:
    """Random teams of the family, whose robots drive at random; some are unavailable.

    In numpy, and in the graph of the ONNX file.
    """
    scenario = SORTS.draw(5, number)
    scenario = scenario.replace(faults=(*scenario.faults, *faults))
    if leave:
        scenario = scenario.replace(unavailable_robots="leave")
    config = config_of(pooling, scenario, number)
    policy, contract = policy_of(config), contract_of(config)
    names = [column.name for column in contract.observation]
    moving = np.array(["position" in name or "velocity" in name for name in names])
    rng = np.random.default_rng(number)
    with closing(BatchEnv(scenario, 5, seed=number, num_threads=1)) as env:
        obs = env.reset()
        for _ in range(rng.integers(0, 8)):
            obs = env.step(rng.integers(0, 5, obs.shape[:2])).obs
    expected = policy.own_log_probs(torch.tensor(obs)).numpy()
    in_numpy, in_graph = actors_of(contract, policy), view_actors_of(contract, EagerFile(policy))
    for robot, actor in [*enumerate(in_numpy), *enumerate(in_graph)]:
        found = actor.logits(obs[:, robot])
        assert found.dtype == np.float32
        wanted = expected[:, robot]
        apart = np.abs(np.exp(found) - np.exp(wanted)).max(axis=1)
        for row in np.flatnonzero(apart >= MOST_OF_PAIRS):  # two robots arrive at the same time
            assert at_edge(policy, moving, robot, obs[row, robot], found[row])
        best = np.sort(wanted, axis=1)
        clear = (apart < MOST_OF_PAIRS) & (best[:, -1] - best[:, -2] > MOST_OF_PAIRS)
        np.testing.assert_array_equal(found.argmax(1)[clear], wanted.argmax(1)[clear])


def test_what_is_known_beforehand_is_what_the_learner_knows() -> None:
    for number in range(5):
        scenario = Family().draw(6, number)
        config = config_of("max", scenario, 0)
        contract = contract_of(config)
        with closing(BatchEnv(scenario, 1, num_threads=1)) as env:
            tables = TeamSheet(scenario, env.observation_names()).tables(as_tensor(env.reset()))
        order = list(range(len(scenario.robots)))
        bodies = np.stack(bodies_of(contract, order), axis=-1)
        np.testing.assert_array_equal(bodies, tables.bodies[0])
        np.testing.assert_array_equal(demand_of(contract), tables.demand[0])


def test_frames_and_mixtures_are_those_of_the_networks() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        vector = tuple(np.round(rng.normal(size=2), 1).tolist())
        frame = frame_of(vector)
        x, y = turned(vector, frame)
        assert x >= y >= 0.0
        other = rng.normal(size=2)
        there = turn(torch.tensor(other)[None], torch.tensor([frame]))[0]
        assert turned(tuple(other.tolist()), frame) == tuple(there.tolist())
        rows = rng.normal(size=(3, 6)) * 20.0
        frames = rng.integers(0, 8, 3)
        both = torch.tensor(rows)
        choices = turn_back_choices(both[:, 1:].log_softmax(1), torch.tensor(frames))
        expected = (choices + both[:, :1].log_softmax(0)).logsumexp(0)
        np.testing.assert_allclose(
            mixture(rows.tolist(), frames.tolist()), expected, rtol=1e-9, atol=1e-12
        )


def body(rng: np.random.Generator, **more: object) -> dict[str, Any]:
    pair = rng.uniform(-0.9, 0.9, (2, 2)).tolist()
    return {"position": pair[0], "velocity": pair[1], **more}


def readings(rng: np.random.Generator, others: list[str]) -> dict[str, Any]:
    """A world in which all are heard and three wait."""
    victims = [
        {"task": task, "position": rng.uniform(-0.9, 0.9, 2).tolist()}
        for task in ("buried", "hurt", "buried")
    ]
    mates = {name: body(rng) for name in others}
    return {"own": body(rng), "teammates": mates, "victims": victims}


@pytest.mark.parametrize("pooling", POOLINGS)
@pytest.mark.parametrize("leave", [False, True])
def test_who_is_not_heard_or_has_left_is_as_if_it_were_not_there(pooling: str, leave: bool) -> None:
    whole = TEAM.replace(unavailable_robots="leave") if leave else TEAM
    fewer = whole.replace(robots=[one for one in whole.robots if one.name != "drone_1"])
    policy = policy_of(config_of(pooling, whole, 4))
    contracts = [contract_of(config_of(pooling, one, 4)) for one in (whole, fewer)]
    ours, theirs = (actors_of(contract, policy)[0] for contract in contracts)
    builder, small = (RowBuilder(contract, 0, 1.0) for contract in contracts)
    rng, differ = np.random.default_rng(4), 0
    for _ in range(40):
        said = readings(rng, ["digger_0", "digger_1", "medic"])
        expected = theirs.logits(small.row(said)[None])

        def with_drone(drone: object, said: dict[str, Any] = said) -> np.ndarray:
            mates = said["teammates"] | {"drone_1": drone}
            return ours.logits(builder.row({**said, "teammates": mates})[None])

        away = with_drone(body(rng, available=False) if leave else None)
        np.testing.assert_allclose(away, expected, rtol=1e-4, atol=1e-4)
        there = with_drone(body(rng))
        differ += int(np.abs(np.exp(there) - np.exp(expected)).max() > 1e-3)
    assert differ > 10  # it matters whether it is there


def test_readings_become_actions(any_team: Path) -> None:
    team = Exported(any_team / "export")
    assert (team.backend, team.name, team.greedy) == ("numpy", "team-inner", True)
    rng = np.random.default_rng(1)
    drawn = Exported(any_team / "export", greedy=False, seed=2)
    taken = set()
    for _ in range(60):
        said = readings(rng, ["drone_1", "digger_0", "digger_1", "medic"])
        decision = team.decide("drone_0", said)
        assert decision.action == int(decision.probabilities.argmax())
        np.testing.assert_allclose(decision.probabilities.sum(), 1.0, atol=1e-6)
        np.testing.assert_array_equal(decision.row, team.row("drone_0", said))
        taken.add(decision.action)
    assert len(taken) == 5
    chances = decision.probabilities
    actions = [drawn.decide("drone_0", said).action for _ in range(2_000)]
    np.testing.assert_allclose(np.bincount(actions, minlength=5) / 2_000, chances, atol=0.04)
    now = {**said, "now": 5.0, "victims_time": 5.0}
    now["own"] = said["own"] | {"time": 5.0}
    now["teammates"] = {name: one | {"time": 4.9} for name, one in said["teammates"].items()}
    late = {**now, "teammates": now["teammates"] | {"medic": body(rng, time=1.0)}}
    silent = {**now, "teammates": now["teammates"] | {"medic": None}}
    assert (team.row("drone_0", late) == team.row("drone_0", silent)).all()


def test_rows_beyond_all_measure_choose_no_action(any_team: Path) -> None:
    team = Exported(any_team / "export")
    width = len(team.contract.observation)
    for size in (3e38, 1e12):
        with pytest.raises(ReadingError, match="row: is beyond what the policy of medic can act"):
            team.decide("medic", np.full(width, size))
    rng = np.random.default_rng(0)
    for scale in (1.0, 1e4, 1e7):
        row = rng.normal(size=width) * scale
        with suppress(ReadingError):  # what is not finite is never an action
            assert np.isfinite(team.decide("medic", row).probabilities).all()
    assert team.decide("medic", team.dark_row("medic")).action in range(5)


def test_a_robot_alone_acts() -> None:
    robots = [TEAM.robots[-1]]
    task = TEAM.tasks[1].model_copy(update={"needs": ("heal",)})
    alone = TEAM.replace(robots=robots, tasks=[task], situation="single")
    config = config_of("inner", alone, 1)
    policy = policy_of(config)
    with closing(BatchEnv(alone, 20, seed=1, num_threads=1)) as env:
        obs = env.reset()
    expected = policy.own_log_probs(torch.tensor(obs))[:, 0]
    contract = contract_of(config)
    for actor in (actors_of(contract, policy)[0], view_actors_of(contract, EagerFile(policy))[0]):
        np.testing.assert_allclose(actor.logits(obs[:, 0]), expected, atol=1e-4)


@pytest.mark.parametrize(
    "pooling", ["inner", *(pytest.param(one, marks=pytest.mark.long) for one in POOLINGS[1:])]
)
def test_one_file_serves_any_team(pooling: str) -> None:
    """Other robots, victims and abilities than the file was made with; also none to help."""
    config = config_of(pooling, TEAM, 5)
    policy = policy_of(config)
    assert View._fields == tuple(VIEW)
    file = ViewFile(view_file(ViewForm(policy.actor), "mark"), "any.onnx", "mark")
    alone = TEAM.replace(
        robots=[TEAM.robots[-1]],
        tasks=[TEAM.tasks[1].model_copy(update={"needs": ("heal",)})],
        situation="single",
    )
    teams = [TEAM, alone, *(SORTS.draw(6, number) for number in range(4))]
    sizes = set()
    for number, scenario in enumerate(teams):
        here = config.model_copy(update={"scenario": scenario})
        contract = contract_of(here)
        with closing(BatchEnv(scenario, 8, seed=number, num_threads=1)) as env:
            obs = env.reset()
            obs = env.step(np.full(obs.shape[:2], number % 5)).obs
        obs[0] = 0.0  # nobody is there
        numpys, graphs = actors_of(contract, policy), view_actors_of(contract, file)
        for robot, (plain, graph) in enumerate(zip(numpys, graphs, strict=True)):
            wanted, found = plain.logits(obs[:, robot]), graph.logits(obs[:, robot])
            assert found.dtype == np.float32
            apart = np.abs(np.exp(found) - np.exp(wanted)).max(axis=1)
            assert np.sort(apart)[-2] < MOST_OF_PAIRS  # but for one where two arrive at once
        sizes.add((len(scenario.robots), scenario.num_victims, len(contract.abilities)))
    assert len(sizes) > 3


def test_rows_of_nobody_change_nothing() -> None:
    """A program may keep rows for robots and victims that are not there."""
    config = config_of("inner", TEAM, 3)
    policy, contract = policy_of(config), contract_of(config)
    file, rng = EagerFile(policy), np.random.default_rng(3)
    (actor, *_), builder = view_actors_of(contract, file), RowBuilder(contract, 0, 1.0)
    for _ in range(20):
        view = actor.view(builder.row(readings(rng, ["drone_1", "digger_0", "digger_1", "medic"])))
        expected = file.logits(view)
        more = dict(view)
        for name in ("positions", "velocities", "bodies"):
            more[name] = np.append(view[name], rng.random((2, view[name].shape[1])), 0)
        for name, rows in (("abilities", 2), ("needs", 3)):
            more[name] = np.append(view[name], np.zeros((rows, view[name].shape[1])), 0)
        more["present"] = np.append(view["present"], [False, False])
        for name in ("victims", "waits"):
            more[name] = np.append(view[name], rng.random((3, view[name].shape[1])), 0)
        more = {name: np.asarray(one, view[name].dtype) for name, one in more.items()}
        np.testing.assert_allclose(file.logits(more), expected, rtol=1e-4, atol=1e-4)
        assert np.abs(file.logits({**view, "needs": view["needs"] * 0})[0] - expected[0]) > 1e-3


def test_both_backends_play_alike(any_team: Path) -> None:
    folder = any_team / "export"
    assert Exported(folder).backend == "numpy"
    numpy, onnx = (Exported(folder, backend=one) for one in ("numpy", "onnxruntime"))
    assert onnx.backend == "onnxruntime"
    with closing(BatchEnv(TEAM, 16, seed=4, num_threads=1)) as env:
        obs = env.reset()
        for _ in range(10):
            actions = numpy.act(PolicyInput(obs))
            assert (onnx.act(PolicyInput(obs)) == actions).mean() > 0.98
            obs = env.step(actions).obs
    width = len(onnx.contract.observation)
    with pytest.raises(ReadingError, match="row: is beyond what the policy of medic can act on"):
        onnx.decide("medic", np.full(width, 1e12))


def test_rows_that_need_too_much_are_refused() -> None:
    many = [f"a{number:02}" for number in range(13)]
    robots = [robot.model_copy(update={"abilities": tuple(many)}) for robot in TEAM.robots]
    tasks = [one.model_copy(update={"needs": ("a00", "a01")}) for one in TEAM.tasks]
    scenario = TEAM.replace(robots=robots, tasks=tasks)
    config = config_of("uniform", scenario, 0)
    contract = contract_of(config)
    policy = policy_of(config)
    row = np.ones(len(contract.observation), np.float32)
    for actor in (actors_of(contract, policy)[0], view_actors_of(contract, EagerFile(policy))[0]):
        with pytest.raises(ReadingError, match="row: has a victim that needs 13 abilities: must"):
            actor.logits(row[None])


Change = Callable[[dict[str, Any]], None]


def put(place: str, value: object) -> Change:
    """Set one value of a document, by keys with dots; numbers are places in lists."""

    def change(document: dict[str, Any]) -> None:
        *path, last = place.split(".")
        within: Any = document
        for key in path:
            within = within[int(key)] if isinstance(within, list) else within[key]
        within[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (put("network.pairs", None), "network.pairs: must be there for the encoder 'pairs' alone"),
        (put("network.encoder", "flat"), "network.pairs: must be there for the encoder 'pairs'"),
        (put("robots.1.battery_j", 5.0), "robots: drone_1 must set forces, see everything and"),
        (put("robots.1.drive", "velocity"), "robots: drone_1 must set forces, see everything and"),
        (put("robots.0.sight_m", 0.5), "robots: drone_0 must set forces, see everything and have"),
        (
            put("tasks.1.needs", list("abcdefghi")),
            "tasks: hurt needs 9 abilities: must be at most 8",
        ),
        (put("tasks", []), "tasks: has 0 entries: must have at least 1 for the encoder 'pairs'"),
        (put("network.pairs.rescue_radius_m", -0.1), r"network\.pairs\.rescue_radius_m: is -0\.1"),
        (
            put("network.pairs.services_s", [1.0]),
            "network.pairs.services_s: must have an entry for each task, or none",
        ),
        (
            put("network.pairs.longest_deadline_s", -1.0),
            r"network\.pairs\.longest_deadline_s: is -1\.0",
        ),
        (put("network.hidden_width", 47), r": has shape \(.*48\), must have \(.*47\)"),
        (put("network.pairs.key_width", 8), r"rivals\.key\.weight: has shape \(16, 48\), must"),
        (put("network.pooling", "max"), r"partners\.key\.weight: is missing or unknown"),
        (put("damping", 2.0), "damping: is 2.0"),
    ],
)
def test_contracts_that_cannot_be_are_refused(
    any_team: Path, tmp_path: Path, change: Change, said: str
) -> None:
    copy = Path(shutil.copytree(any_team / "export", tmp_path / "copy"))
    document = json.loads((copy / "contract.json").read_text())
    del document["sha256"]
    change(document)

    def load() -> None:
        (copy / "contract.json").write_bytes(contract_text(document))
        Exported(copy)

    with pytest.raises((ValueError, ExportError), match=said) as caught:
        load()
    assert "\n" not in str(caught.value)


def test_the_team_of_the_page_is_the_one_of_the_tests(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "teams.md").read_text("utf-8")
    (tmp_path / "my_team.toml").write_text(page.split("```toml\n")[1].split("```")[0])
    assert Scenario.from_toml(tmp_path / "my_team.toml") == TEAM
