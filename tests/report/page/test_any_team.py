"""Policies for any team in the page: they choose as those in numpy do, for teams of all sorts."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from answers import ANSWER, served
from browser import PHONE, WIDE, until, visit
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page
from team_of_any import TEAM, actors_of, config_of, contract_of, policy_of, run_of

from innerattn.config import Battery, RangeSensor, Scenario
from innerattn.config.family import Family
from innerattn.config.scenario import Fault
from innerattn.envs import BatchEnv
from innerattn.errors import ConfigError, RunError
from innerattn.evaluate.interactive import InteractiveWorld, endless
from innerattn.evaluate.trained import load_trained
from innerattn.policies import Exported
from innerattn.report.page.page import page_document, worlds_page
from innerattn.report.page.team import read_team
from innerattn.train import RunFolder

SEED = 12_345
POOLINGS = ("inner", "uniform", "max", "nearest")

# Log-probabilities of all robots for some observations, each R × D.
LOGITS = """async ([given, observations]) => {
  const { rust, constructor: Inside } = play.link.transport;
  const inside = new Inside(rust, given), { session } = await inside.ask("sessions", {});
  const team = inside.sessions.get(session).policies.get("any");
  const chosen = (row, robot) => team.logits(robot, Float64Array.from(row));
  const found = observations.map((obs) => obs.map(chosen));
  inside.leave(`sessions/${session}`);
  return found;
}"""

# Lets the team act; gives observations, actions and attention of each step.
ACT = """async (steps) => {
  const { given, rust, constructor: Inside } = play.link.transport;
  const inside = new Inside(rust, given), { session } = await inside.ask("sessions", {});
  const engine = inside.sessions.get(session), found = [];
  for (let step = 0; step < steps; step++) {
    found.push({ obs: [...engine.obs], actions: engine.actions, attention: engine.attention });
    engine.step();
  }
  inside.leave(`sessions/${session}`);
  return found;
}"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "page.html"
    policies = {"any": read_team("zoo:any", TEAM), "random": None, "greedy": None}
    path.write_text(worlds_page("any", TEAM, policies, SEED), "utf-8")
    return path


@pytest.fixture(scope="module")
def page(browser: Browser, file: Path) -> Iterator[Page]:
    with visit(browser, file) as seen:
        ready(seen.page)
        yield seen.page


def ready(page: Page) -> None:
    until(page, "Boolean(window.play)")
    page.get_by_role("button", name="Pause").click()
    until(page, "!play.link.busy")


def team_with_amounts() -> Scenario:
    """Needs and abilities that are no whole numbers, and a robot with two of them."""
    abilities = [{"water": 1.2}, {"water": 0.7}, {"water": 0.5, "foam": 2.3}, {"foam": 1.1}]
    robots = [
        {"name": f"r{at}", "kind": f"k{at}", "abilities": one, "max_speed_mps": 1.0, "mass_kg": 0.8}
        for at, one in enumerate(abilities)
    ]
    tasks = [
        {"name": "fire", "needs": {"water": 1.9}},
        {"name": "oil", "needs": {"foam": 3.4, "water": 0.5}},
    ]
    return Scenario.model_validate({"max_victims": 5, "robots": robots, "tasks": tasks})


def drawn_teams() -> dict[str, tuple[str, Scenario]]:
    """Random teams and others, with the pooling that is tried in them."""
    found = {}
    for number in range(12):
        timed = {"service": 0.5, "deadline": 0.4, "order": 0.5}
        team = Family(robots=(2, 9), unavailable=0.5, **timed).draw(5, number)
        faults = [*team.faults, Fault(robot="robot_0", kind="lost_communication", value=0.3)]
        faults += [Fault(robot="robot_1", kind="position_noise", value=0.1)]
        team = team.replace(faults=faults) if number % 3 == 0 else team
        team = team.replace(unavailable_robots="leave") if number % 4 == 1 else team
        found[f"family {number}"] = (POOLINGS[number % 4], team)
    alone = TEAM.tasks[1].model_copy(update={"needs": ("heal",)})
    found["alone"] = (
        "inner",
        TEAM.replace(robots=TEAM.robots[-1:], tasks=[alone], situation="single"),
    )
    found["amounts"] = ("inner", team_with_amounts())
    found["many victims"] = ("uniform", TEAM.replace(max_victims=9))
    return found


def driven(scenario: Scenario) -> NDArray[np.float32]:
    """Observations (N, R, D) of worlds whose robots drive at random, some of them within reach."""
    rng = np.random.default_rng(2)
    with closing(BatchEnv(scenario, 6, seed=3, num_threads=1)) as env:
        parts = [env.reset()]
        for _ in range(9):
            parts.append(env.step(rng.integers(0, 5, parts[-1].shape[:2])).obs)
    return np.concatenate(parts)


def shaken(obs: NDArray[np.float32]) -> NDArray[np.float32]:
    """The same, with places and velocities that no world has, and blind robots."""
    rng = np.random.default_rng(4)
    found = obs * rng.choice([0.3, 1.0, 1.7], obs.shape) * (rng.random(obs.shape) < 0.97)
    found = np.where(np.isin(obs, (0.0, 1.0)), obs, found)
    found[rng.random(obs.shape[:2]) < 0.05] = 0.0
    return found.astype(np.float32)


@pytest.mark.parametrize("name", drawn_teams())
def test_it_chooses_as_the_one_in_numpy_does(page: Page, tmp_path: Path, name: str) -> None:
    pooling, scenario = drawn_teams()[name]
    config = config_of(pooling, scenario, 7)
    team = read_team(run_of(tmp_path / "run", config), scenario)
    given = page_document(scenario, {"any": team}, SEED)
    obs = driven(scenario)
    obs = np.concatenate([obs, shaken(obs)])
    found = np.array(page.evaluate(LOGITS, [given, obs.tolist()]))
    actors = actors_of(contract_of(config), policy_of(config))
    expected = np.stack([one.logits(obs[:, robot]) for robot, one in enumerate(actors)], axis=1)
    np.testing.assert_allclose(np.exp(found), np.exp(expected), atol=2e-4)
    likeliest = expected.argmax(-1)
    assert len(np.unique(likeliest)) > 2
    best = np.sort(expected, -1)
    clear = best[..., -1] - best[..., -2] > 1e-3
    assert clear.mean() > 0.95
    np.testing.assert_array_equal(found.argmax(-1)[clear], likeliest[clear])


def test_the_team_of_the_package_acts_as_its_export_does(page: Page, any_team: Path) -> None:
    found = page.evaluate(ACT, 300)
    obs = np.array([one["obs"] for one in found], np.float32).reshape(300, len(TEAM.robots), -1)
    team = Exported(any_team / "export", backend="numpy")
    logits = np.stack(
        [team.logits(name, obs[:, robot]) for robot, name in enumerate(team.robot_names)], axis=1
    )
    best = np.sort(logits, -1)
    clear = best[..., -1] - best[..., -2] > 1e-3
    assert clear.mean() > 0.95
    actions = np.array([one["actions"] for one in found])
    np.testing.assert_array_equal(actions[clear], logits.argmax(-1)[clear])
    assert all(one["attention"] is None for one in found)


def test_it_answers_as_the_server_of_play_does(page: Page) -> None:
    """Blind robots and broken motors too: each robot acts on what it sees itself."""
    worlds = endless(TEAM)
    policy = load_trained("zoo:any", worlds, each_sees=True)[1]
    step = {"do": "step"}
    messages: list[dict[str, Any]] = [step] * 60
    for robot, kind in ((0, "blackout"), (3, "unavailable"), (4, "lost_communication")):
        messages += [{"do": "faults", "robot": robot, "values": {kind: 1.0}}, *[step] * 25]
    messages += [{"do": "move_robot", "robot": 2, "x": 0.5, "y": -0.5}, *[step] * 20]
    theirs = served(lambda: InteractiveWorld(worlds, {"any": policy}, SEED), messages)
    given = page_document(TEAM, {"any": read_team("zoo:any", TEAM)}, SEED)
    ours = page.evaluate(ANSWER, [given, messages])
    for at, (one, other) in enumerate(zip(ours, theirs, strict=True)):
        assert one["attention"] is other["attention"] is None
        assert one["faults"] == other["faults"]
        np.testing.assert_allclose(one["positions"], other["positions"], atol=2e-5, err_msg=str(at))
        assert one["rescued"] == other["rescued"]
    assert theirs[-1]["rescued"] > 3


@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_it_plays_without_a_word_in_the_console(
    browser: Browser, file: Path, size: tuple[int, int]
) -> None:
    with visit(browser, file, size) as seen:
        page, said = seen.page, []
        page.on("console", lambda message: said.append(message.text))
        page.on("request", lambda request: said.append(request.url))
        page.reload()
        ready(page)
        steps = 10_000 if size == WIDE else 300
        play = "async (steps) => { while (steps--) await play.send({ do: 'step' }); }"
        page.evaluate(play, steps)
        until(page, "!play.link.busy && !play.stale")
        assert page.evaluate("play.run.now.step") >= steps
        assert page.evaluate("play.run.now.rescued") > 5
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        assert page.get_by_text("This policy shows no attention.").is_visible()
        assert "attention" not in page.locator("#subtitle").inner_text()
        assert not [one for one in said if not one.startswith("file:")]


def test_the_file_is_small(file: Path) -> None:
    assert file.stat().st_size < 3_000_000


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"actions": "continuous"}, r"scenario\.actions = 'continuous': must be 'discrete' for"),
        ({"observed_victims": 1}, r"scenario\.observed_victims = 1: must be left out; policies"),
        ({"robots": {"battery": Battery(capacity_j=9.0)}}, r"scenario\.robots\[0\]\.battery"),
        ({"robots": {"sight_m": 0.5}}, r"scenario\.robots\[0\]\.sight_m = 0\.5: must be left out"),
        (
            {"robots": {"range_sensor": RangeSensor(rays=5, range_m=1.0)}},
            r"scenario\.robots\[0\]\.range_sensor",
        ),
    ],
)
def test_what_it_does_not_know_is_refused(change: dict[str, Any], said: str) -> None:
    robots = [one.model_copy(update=change.get("robots", {})) for one in TEAM.robots]
    with pytest.raises(ConfigError, match=said):
        read_team("zoo:any", TEAM.replace(**{**change, "robots": robots}))


def test_weights_of_another_network_are_refused(tmp_path: Path) -> None:
    run = RunFolder.create(tmp_path / "run", config_of("inner", TEAM, 1), threads=1)
    run.save_weights(policy_of(config_of("max", TEAM, 1)).state(), 0)
    run.mark("done", 0, 0, 0.0)
    with pytest.raises(RunError, match=r"its weights: actor\.rivals\.key\.weight has none, must"):
        read_team(tmp_path / "run")
