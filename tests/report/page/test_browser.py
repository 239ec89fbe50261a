"""The page of one file in a real browser: its worlds, its team and its answers are Python's."""

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from answers import ANSWER, drawn_messages, like, served
from browser import PHONE, WIDE, Visit, until, visit
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page
from sensing import sensing

from innerattn.config import Obstacle, Scenario
from innerattn.config.files import preset_names
from innerattn.config.streams import stream_seed
from innerattn.envs import BatchEnv
from innerattn.evaluate.interactive import InteractiveWorld, endless
from innerattn.evaluate.trained import load_trained
from innerattn.policies import Exported, PolicyInput, scripted_policy
from innerattn.report.page.page import page_document, worlds_page
from innerattn.report.page.scripts import page_scripts
from innerattn.report.page.team import read_team
from innerattn.train import load_policy
from innerattn.train.export import export_run
from innerattn.train.export.actors import inner_actor
from innerattn.train.export.check import logits_of
from innerattn.zoo import run_path

SEED = 12_345
HOSTILE = "</script><img src=x onerror='window.struck=1'>"

# Plays worlds of a scenario with given actions; gives the bytes of all observations in base64.
PLAY = """([scenario, seed, actions]) => {
  const world = play.link.transport.rust.open(scenario, BigInt(seed));
  world.restart();
  const parts = [Float32Array.from(world.take("observations"))];
  for (const one of actions) {
    world.step(one.flat());
    parts.push(Float32Array.from(world.take("observations")));
  }
  world.close();
  const all = new Float32Array(parts.length * parts[0].length);
  parts.forEach((part, index) => all.set(part, index * part.length));
  const bytes = new Uint8Array(all.buffer), texts = [];
  for (let at = 0; at < bytes.length; at += 30000) {
    texts.push(String.fromCharCode(...bytes.subarray(at, at + 30000)));
  }
  return btoa(texts.join(""));
}"""

# Lets the team act; gives observations, logits, actions and attention of each step.
ACT = """(steps) => {
  const { given, rust, constructor: Inside } = play.link.transport;
  const inside = new Inside(rust, given);
  return inside.ask("sessions", {}).then(async ({ session }) => {
    const engine = inside.sessions.get(session), team = engine.policies.get("mixed"), found = [];
    for (let step = 0; step < steps; step++) {
      const { obs, actions, attention } = engine, robots = [...actions.keys()];
      const logits = robots.map((robot) => team.logits(robot, team.row(obs, robot)));
      found.push({ obs: [...obs], actions, attention, logits });
      engine.step();
    }
    return found;
  });
}"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "page.html"
    team = read_team("zoo:mixed")
    policies = {"mixed": team, "random": None}
    path.write_text(worlds_page("mixed", team.config.scenario, policies, SEED), "utf-8")
    return path


@pytest.fixture(scope="module")
def page(browser: Browser, file: Path) -> Iterator[Page]:
    """The page, paused."""
    with visit(browser, file) as seen:
        ready(seen.page)
        yield seen.page


def ready(page: Page) -> None:
    until(page, "Boolean(window.play)")
    page.get_by_role("button", name="Pause").click()
    until(page, "!play.link.busy")


def settle(page: Page) -> None:
    until(page, "!play.link.busy && !play.movesNow && !play.stale")


def drawn_actions(scenario: Scenario, steps: int) -> NDArray[Any]:
    """Random actions (steps, 1, R) or (steps, 1, R, 2)."""
    draws = np.random.default_rng(5)
    if scenario.actions == "continuous":
        return draws.uniform(-1, 1, (steps, 1, scenario.num_robots, 2)).astype(np.float32)
    return draws.integers(0, 5, (steps, 1, scenario.num_robots))


def same_worlds(page: Page, scenario: Scenario, steps: int) -> None:
    """Worlds in the page and in Python give the same observations, to the bit."""
    actions, seed = drawn_actions(scenario, steps), stream_seed(SEED, "evaluation")
    given = [scenario.model_dump_json(), str(seed), actions[:, 0].tolist()]
    there = np.frombuffer(base64.b64decode(page.evaluate(PLAY, given)), "<f4")
    with BatchEnv(scenario, 1, seed, num_threads=1) as env:
        here = [env.reset(), *(env.step(one).obs for one in actions)]
        assert env.episodes()[0] == steps // scenario.episode_steps
    assert there.tobytes() == np.concatenate(here).astype("<f4").tobytes()


def test_its_worlds_are_those_of_python(page: Page) -> None:
    same_worlds(page, Scenario.preset("mixed"), 10_000)


@pytest.mark.long
@pytest.mark.parametrize("name", preset_names("scenarios"))
def test_its_worlds_of_every_preset_are_those_of_python(page: Page, name: str) -> None:
    steps = 500 if name == "rescue-64" else 10_000  # a string of a browser has at most 0.5 GB
    same_worlds(page, Scenario.preset(name), steps)


@pytest.mark.long
def test_continuous_actions_do_the_same(page: Page) -> None:
    scenario = Scenario.preset("mixed").replace(actions="continuous", engine="discs")
    same_worlds(page, scenario, 2_000)


Played = tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.float64]]


def acted(page: Page, steps: int) -> Played:
    """Observations (T, R, D), actions (T, R) and logits (T, R, A) of the team in the page."""
    found = page.evaluate(ACT, steps)
    obs = np.array([one["obs"] for one in found], np.float32).reshape(steps, 4, -1)
    return obs, *(np.array([one[key] for one in found]) for key in ("actions", "logits"))


def like_those(expected: NDArray[np.float32], played: Played) -> None:
    """Logits differ by rounding alone, and actions only where two are as good."""
    _, actions, logits = played
    np.testing.assert_allclose(logits, expected, atol=2e-4, rtol=2e-5)
    best = np.sort(expected, -1)
    clear = best[..., -1] - best[..., -2] > 1e-3
    assert clear.mean() > 0.95
    np.testing.assert_array_equal(actions[clear], expected.argmax(-1)[clear])


def test_its_team_chooses_as_the_trained_one_does(page: Page) -> None:
    played = acted(page, 500)
    _, learner = load_policy(run_path("zoo:mixed"))
    actor = inner_actor(learner, Path("zoo:mixed"))
    like_those(logits_of(learner, actor, torch.tensor(played[0])), played)


@pytest.mark.long
def test_its_team_chooses_as_the_exported_one_does(page: Page, tmp_path: Path) -> None:
    played = acted(page, 500)
    export_run(run_path("zoo:mixed"), tmp_path / "export")
    team = Exported(tmp_path / "export", backend="numpy")
    robots = enumerate(team.robot_names)
    logits = [team.logits(name, played[0][:, robot]) for robot, name in robots]
    like_those(np.stack(logits, 1), played)


def test_its_attention_is_that_of_the_critic(page: Page) -> None:
    found = page.evaluate(ACT, 200)
    _, trained = load_trained("zoo:mixed")
    obs = np.array([one["obs"] for one in found], np.float32).reshape(200, 4, -1)
    weights = trained.attention(PolicyInput(obs), np.array([one["actions"] for one in found]))
    assert weights is not None
    np.testing.assert_allclose([one["attention"] for one in found], weights, atol=1e-4)
    assert np.ptp(weights, axis=0).max() > 0.5


@pytest.mark.parametrize("blocks", [pytest.param(False, marks=pytest.mark.long), True])
def test_it_answers_as_the_server_does(page: Page, blocks: bool) -> None:
    box = Obstacle(shape="box", half_extents_m=(0.3, 0.05), position_m=(0.0, 0.2))
    disc = Obstacle(shape="disc", radius_m=0.15)
    scenario = Scenario.preset("mixed").replace(obstacles=(box, disc) if blocks else ())
    messages = drawn_messages(60, "mixed")

    def make() -> InteractiveWorld:
        worlds = endless(scenario)
        return InteractiveWorld(worlds, {"mixed": load_trained("zoo:mixed", worlds)[1]}, SEED)

    given = page_document(scenario, {"mixed": read_team("zoo:mixed", scenario)}, SEED)
    theirs, ours = served(make, messages), page.evaluate(ANSWER, [given, messages])
    for message, one, other in zip([{}, *messages], ours, theirs, strict=True):
        like(one, other, f"{message}")
    refused = [one for one in theirs if "error" in one]
    assert 5 < len(refused) < len(theirs) / 4
    assert sum(len(one["rescues"]) for one in theirs if "rescues" in one) > 20
    assert any(one["handoffs"] for one in theirs if "handoffs" in one)
    assert any(any(one["blocked"]) for one in theirs if "blocked" in one)


@pytest.mark.parametrize("name", [*preset_names("scenarios"), "sensing"])
def test_it_shows_worlds_of_every_sort_as_the_server_does(page: Page, name: str) -> None:
    scenario = sensing() if name == "sensing" else Scenario.preset(name)

    def make() -> InteractiveWorld:
        worlds = endless(scenario)
        return InteractiveWorld(worlds, {"random": scripted_policy("random", worlds)}, SEED)

    given = page_document(scenario, {"random": None}, SEED)
    messages = [{"do": "restart"}, {"do": "move_robot", "robot": 1, "x": 0.4, "y": -0.3}]
    for one, other in zip(
        page.evaluate(ANSWER, [given, messages]), served(make, messages), strict=True
    ):
        like(one, other, name)


def plain_worlds() -> dict[str, Scenario]:
    """Worlds in which a page computes all its scripts."""
    mixed = Scenario.preset("mixed")
    swift = [robot.replace(drive="velocity") for robot in mixed.robots]
    many = mixed.replace(max_victims=8)
    starts = [[-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8], [0.0, 0.0]]
    lifters = [
        robot.replace(name=f"lifter_{at}", kind="lifter", abilities={"lift": 1.0}, start_m=start)
        for at, (robot, start) in enumerate(
            zip([*mixed.robots, mixed.robots[0]], starts, strict=True)
        )
    ]
    tasks = [{"name": str(count), "needs": ["lift"] * count} for count in (2, 3)]
    return {
        **{name: Scenario.preset(name) for name in ("mixed", "mixed-8", "mixed-sight")},
        "continuous": mixed.replace(actions="continuous"),
        "velocity": mixed.replace(robots=swift),
        "more needs than robots": many,
        "whole teams": mixed.replace(robots=lifters, tasks=tasks, max_victims=5),
    }


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.long if name.startswith("mixed-") else ())
        for name in plain_worlds()
    ],
)
def test_its_scripts_do_what_those_of_python_do(page: Page, name: str) -> None:
    scenario = plain_worlds()[name]
    scripts = ("hungarian", "greedy")
    assert page_scripts(scenario) == ("random", "greedy", "hungarian")

    def make() -> InteractiveWorld:
        worlds = endless(scenario)
        found = {one: scripted_policy(one, worlds) for one in scripts}
        return InteractiveWorld(worlds, found, SEED)

    messages: list[dict[str, Any]] = [{"do": "step"}] * 150
    messages += [{"do": "policy", "name": "greedy"}, *messages]
    given = page_document(scenario, dict.fromkeys(scripts), SEED)
    theirs, ours = served(make, messages), page.evaluate(ANSWER, [given, messages])
    for step, (one, other) in enumerate(zip(ours, theirs, strict=True)):
        like(one, other, f"answer {step}")
    assert theirs[150]["rescued"] > 10
    assert theirs[-1]["rescued"] > theirs[150]["rescued"] + 5


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
        assert not [one for one in said if not one.startswith("file:")]
        page.evaluate(
            "(async () => { for (let at = 0; at < 300; at++) await play.send({ do: 'step' }); })()"
        )
        page.keyboard.press("o")
        settle(page)
        assert page.evaluate("play.run.now.step") >= 300
        assert page.evaluate("play.run.now.rescued") > 10
        assert page.evaluate("play.run.now.faults[0]") == {"unavailable": 1}
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
        assert "4 robots rescue victims" in page.locator("#subtitle").inner_text()
        assert "show attention" in page.locator("#subtitle").inner_text()
        assert not [one for one in said if not one.startswith("file:")]


def test_a_seed_begins_the_same_world_again(page: Page) -> None:
    def begun(seed: int) -> Any:
        page.get_by_role("spinbutton", name="Seed").fill(str(seed))
        page.get_by_role("button", name="Start from it").click()
        settle(page)
        return page.evaluate("[play.run.now.positions, play.run.now.victims, play.run.now.step]")

    first = begun(3)
    page.keyboard.press(".")
    settle(page)
    assert page.evaluate("[play.run.now.episode, play.run.now.step]") == [0, 1]
    other = begun(4)
    assert other != first
    assert begun(3) == first
    assert first[2] == 0


def test_a_dragged_robot_is_where_it_was_dropped(page: Page) -> None:
    place = page.evaluate("play.scene.at(...play.run.now.positions[2])")
    end = page.evaluate("play.scene.at(0.3, -0.6)")
    box = page.locator("#arena").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + place[0], box["y"] + place[1])
    page.mouse.down()
    page.mouse.move(box["x"] + end[0], box["y"] + end[1], steps=4)
    page.mouse.up()
    settle(page)
    assert page.evaluate("play.run.now.positions[2]") == pytest.approx([0.3, -0.6], abs=0.01)


def test_text_of_others_is_only_text(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    scenario = Scenario.preset("mixed")
    path.write_text(worlds_page(HOSTILE, scenario, {"random": None}, SEED), "utf-8")
    with visit(browser, path) as seen:
        ready(seen.page)
        heading = seen.page.get_by_role("heading", level=1)
        assert heading.inner_text() == f"Play with {HOSTILE}"
        assert seen.page.evaluate("window.struck") is None
        assert seen.page.get_by_text("This policy shows no attention.").is_visible()


def test_the_file_is_small(file: Path) -> None:
    assert file.stat().st_size < 3_000_000


@pytest.mark.long
@pytest.mark.parametrize("size", [WIDE, PHONE])
def test_everybody_can_use_it(browser: Browser, file: Path, size: tuple[int, int]) -> None:
    with visit(browser, file, size) as seen:
        ready(seen.page)
        for summary in seen.page.locator("summary").all():
            summary.click()
        assert not Visit(seen.page).serious_faults()
