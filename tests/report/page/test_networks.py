"""Networks of all sorts in the page: their numbers are those of the learners, step by step."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from answers import ANSWER, drawn_messages, like, served
from browser import until, visit
from fresh_run import run_config
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page
from sensing import sensing

from innerattn.config import Battery, RunConfig, Scenario
from innerattn.config.communication import Communication
from innerattn.config.range_sensor import RangeSensor
from innerattn.config.scenario import Fault
from innerattn.envs import BatchEnv
from innerattn.evaluate.interactive import InteractiveWorld, endless
from innerattn.evaluate.trained import load_trained
from innerattn.learn.framed import unframed
from innerattn.nn.actions import mean_and_log_std
from innerattn.policies.plain_team import PlainTeam, read_plain_team
from innerattn.report.page.page import page_document, worlds_page
from innerattn.report.page.team import read_team
from innerattn.train import RunFolder, load_policy
from innerattn.train.build import build_learner

SEED = 12_345
POOLINGS = ("attention", "mean", "max", "nearest")

# Outputs and attention of a team in some episodes, each of observations and actions step by step.
FOLLOW = """async ([given, episodes]) => {
  const { rust, constructor: Inside } = play.link.transport;
  const inside = new Inside(rust, given), { session } = await inside.ask("sessions", {});
  const team = inside.sessions.get(session).policies.get("team");
  const found = episodes.map((steps) => {
    team.reset(1);
    return steps.map(([obs, actions]) => {
      const numbers = Float64Array.from(obs.flat());
      return [team.outputs(numbers), team.attention(numbers, actions)];
    });
  });
  inside.leave(`sessions/${session}`);
  return found;
}"""

# Draws of one policy for the same outputs.
DRAW = """([given, outputs, count]) => {
  const { rust, constructor: Inside } = play.link.transport;
  const inside = new Inside(rust, given);
  return inside.ask("sessions", {}).then(({ session }) => {
    const team = inside.sessions.get(session).policies.get("team");
    return Array.from({ length: count }, () => team.chosen(outputs));
  });
}"""


@pytest.fixture(scope="module")
def page(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    path = tmp_path_factory.mktemp("page") / "page.html"
    path.write_text(worlds_page("any", Scenario(), {"random": None}, SEED), "utf-8")
    yield from ready(browser, path)


def ready(browser: Browser, path: Path) -> Iterator[Page]:
    with visit(browser, path) as seen:
        until(seen.page, "Boolean(window.play)")
        seen.page.get_by_role("button", name="Pause").click()
        until(seen.page, "!play.link.busy")
        yield seen.page


def worlds(name: str) -> Scenario:
    """Worlds of some sort, with faults."""
    mixed, wheels = Scenario.preset("mixed"), Scenario.preset("mixed-wheels")
    around = RangeSensor(rays=8, range_m=0.9)
    ahead = RangeSensor(rays=5, range_m=0.9, field_of_view_deg=120.0)
    drives = ("unicycle", "differential") * 2

    def with_all(**values: Any) -> Scenario:
        return mixed.replace(robots=[robot.replace(**values) for robot in mixed.robots])

    rolling = [
        robot.replace(drive=drive, range_sensor=ahead)
        for robot, drive in zip(mixed.robots, drives, strict=True)
    ]
    found = {
        "mixed": mixed,
        "sight": Scenario.preset("mixed-sight"),
        "radio": Scenario.preset("mixed-radio"),
        "slow": mixed.replace(communication=Communication(delay_steps=1)),
        "slower": mixed.replace(communication=Communication(delay_steps=3, range_m=1.2)),
        "wheels": wheels,
        "rays": with_all(range_sensor=around),
        "rays ahead": mixed.replace(robots=rolling),
        "batteries": with_all(battery=Battery(capacity_j=1.0, idle_w=1.0)),
        "sensing": sensing(),
    }[name]
    kinds = ("unavailable", "blackout", "lost_communication")
    faults = [
        Fault(robot=robot.name, kind=kind, value=1.0, onset_step=8)
        for robot, kind in zip(found.robots, kinds, strict=False)
    ]
    return found.replace(faults=faults)


ENTITIES = {"network.encoder": "entities", "network.hidden_width": 64}
TURNED = {"network.symmetry": "canonical"}
SHARED = {"network.parameter_sharing": "kind"}
VECTORS = {"scenario.actions": "continuous"}
MEMORY, MESSAGES = {"network.memory_width": 8}, {"network.message_width": 8}
CASES: dict[str, tuple[str, str, dict[str, Any]]] = {
    **{
        f"entities, {pooling}": ("mixed", "td-inner", ENTITIES | {"network.pooling": pooling})
        for pooling in POOLINGS
    },
    **{
        f"entities in sight, {pooling}": (
            "sight",
            "ppo-inner",
            ENTITIES | TURNED | SHARED | {"network.pooling": pooling},
        )
        for pooling in POOLINGS
    },
    "masks": ("mixed", "ppo-inner", TURNED | {"network.mask_actions": True}),
    "masks and batteries": (
        "batteries",
        "td-uniform",
        ENTITIES | {"network.mask_actions": True, "network.mask_unavailable": True},
    ),
    "memory": ("mixed", "ppo-inner", MEMORY),
    "memory in frames": ("mixed", "ppo-inner", MEMORY | TURNED | SHARED),
    "memory of entities": ("sight", "ppo-inner", MEMORY | ENTITIES | {"network.pooling": "max"}),
    **{
        f"messages in {name}, {pooling}": (
            name,
            "ppo-inner",
            MESSAGES | {"network.message_pooling": pooling},
        )
        for name, pooling in zip(("mixed", "sight", "radio", "slow"), POOLINGS, strict=True)
    },
    **{
        f"turned messages, {pooling}": (
            name,
            "ppo-inner",
            MESSAGES | TURNED | {"network.message_pooling": pooling},
        )
        for name, pooling in zip(("slower", "radio", "sight", "sight"), POOLINGS, strict=True)
    },
    "all at once": ("slower", "ppo-inner", MESSAGES | MEMORY | ENTITIES | TURNED | SHARED),
    "vectors": ("mixed", "ppo-inner", VECTORS),
    "vectors in frames": ("mixed", "ppo-inner", VECTORS | TURNED | MEMORY),
    "vectors on wheels": ("wheels", "ppo-inner", VECTORS | TURNED | ENTITIES),
    "vectors of two drives": ("rays ahead", "ppo-inner", VECTORS | TURNED),
    "wheels in frames": ("wheels", "ppo-inner", TURNED | SHARED),
    "rays in frames": ("rays", "ppo-inner", TURNED),
    "rays ahead in frames": ("rays ahead", "ppo-inner", TURNED),
    "sensing": ("sensing", "ppo-frozen", MESSAGES | MEMORY),
}


def config_of(name: str) -> RunConfig:
    """The run of a case."""
    world, method, values = CASES[name]
    config = run_config(method, **{"network.hidden_width": 16, **values})
    scenario = worlds(world).replace(actions=config.scenario.actions)
    return RunConfig.model_validate(config.model_copy(update={"scenario": scenario}).model_dump())


def run_of(folder: Path, config: RunConfig) -> Path:
    """A run whose networks give numbers that differ, as trained ones do."""
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        learner = build_learner(config, env)
    networks = unframed(learner)
    draw = torch.Generator().manual_seed(3)
    with torch.no_grad():
        for network in (networks.actor, networks.critic):
            for parameter in network.parameters():
                parameter += 0.2 * torch.randn(parameter.shape, generator=draw)
    run = RunFolder.create(folder, config, threads=1)
    run.save_weights(learner.state(), 0)
    run.mark("done", 0, 0, 0.0)
    return folder


def driven(scenario: Scenario, steps: int) -> NDArray[np.float32]:
    """Observations (T, E, R, D); robots drive at random, and are blind at times."""
    rng = np.random.default_rng(2)
    with closing(BatchEnv(scenario, 4, seed=3, num_threads=1)) as env:
        found = [env.reset()]
        for _ in range(steps - 1):
            found.append(env.step(drawn(rng, scenario, found[-1].shape[:2])).obs)
    obs = np.stack(found)
    obs[rng.random(obs.shape[:3]) < 0.1] = 0.0
    return obs


def drawn(
    rng: np.random.Generator, scenario: Scenario, shape: tuple[int, ...]
) -> NDArray[np.int64] | NDArray[np.float32]:
    """Actions at random."""
    if scenario.actions == "continuous":
        return rng.uniform(-1.0, 1.0, (*shape, 2)).astype(np.float32)
    return rng.integers(0, 5, shape)


def in_world(outputs: torch.Tensor, obs: NDArray[np.float32], team: PlainTeam) -> Any:
    """Outputs (R, O, E) of a learner in its frames, as a page gives them: (E, R, O)."""
    if team.continuous:
        outputs = torch.cat(mean_and_log_std(outputs), dim=1)
    found = []
    for robot, one in enumerate(outputs.transpose(1, 2).numpy()):
        frame = team.frame_of(team.config.scenario.robots[robot].drive)
        rows = obs[:, robot]
        found.append(one if frame is None else frame.turn_back(one, frame.elements(rows)))
    return np.stack(found, axis=1)


SOON = (
    *("entities, nearest", "entities in sight, attention", "entities in sight, mean"),
    *("entities in sight, max", "masks and batteries", "memory in frames"),
    *("turned messages, attention", "all at once", "vectors on wheels", "rays ahead in frames"),
)
"""What is tried each time; the rest takes long together."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in SOON else pytest.mark.long) for name in CASES],
)
def test_it_gives_the_numbers_of_the_learner(page: Page, tmp_path: Path, name: str) -> None:
    config = config_of(name)
    run = run_of(tmp_path / "run", config)
    scenario, plain = config.scenario, read_plain_team(run)
    obs = driven(scenario, 25)
    taken = drawn(np.random.default_rng(5), scenario, obs.shape[:3])
    _, learner = load_policy(run)
    networks, expected = unframed(learner), []
    for now, actions in zip(obs, taken, strict=True):
        learner.act(torch.tensor(now), greedy=True)
        outputs = in_world(networks._acted[1], now, plain)
        weights = learner.attention(torch.tensor(now), torch.tensor(actions))
        assert weights is not None
        expected.append((outputs, weights.expand(len(now), -1, -1, -1).numpy()))
    episodes = [
        [[obs[step, env].tolist(), taken[step, env].tolist()] for step in range(len(obs))]
        for env in range(obs.shape[1])
    ]
    given = page_document(scenario, {"team": read_team(run)}, SEED)
    found = page.evaluate(FOLLOW, [given, episodes])
    for step, (outputs, weights) in enumerate(expected):
        for env in range(obs.shape[1]):
            ours, seen = (np.array(one) for one in found[env][step])
            hidden = outputs[env] < -1e30
            np.testing.assert_array_equal(ours <= -1e30, hidden)
            shown = np.where(hidden, 0.0, outputs[env])
            np.testing.assert_allclose(
                np.where(hidden, 0.0, ours), shown, atol=5e-4, rtol=1e-4, err_msg=f"step {step}"
            )
            np.testing.assert_allclose(seen, weights[env], atol=1e-4, err_msg=f"step {step}")
    every = np.stack([one for one, _ in expected])
    assert np.ptp(every, axis=(0, 1)).max() > 0.3
    assert "mask" not in name or (every < -1e30).any()


@pytest.mark.parametrize(
    "name",
    [
        "all at once",
        pytest.param("masks", marks=pytest.mark.long),
        pytest.param("vectors in frames", marks=pytest.mark.long),
        pytest.param("rays ahead in frames", marks=pytest.mark.long),
        pytest.param("sensing", marks=pytest.mark.long),
    ],
)
def test_it_plays_as_the_server_does(page: Page, tmp_path: Path, name: str) -> None:
    run = run_of(tmp_path / "run", config_of(name))
    scenario = endless(read_plain_team(run).config.scenario)
    messages = drawn_messages(20, "team")

    def make() -> InteractiveWorld:
        policy = load_trained(run, scenario, greedy=True)[1]
        return InteractiveWorld(scenario, {"team": policy}, SEED)

    given = page_document(scenario, {"team": read_team(run, scenario)}, SEED)
    ours = page.evaluate(ANSWER, [given, messages])
    for message, one, other in zip([{}, *messages], ours, served(make, messages), strict=True):
        if scenario.has_wheels:  # of which a page does not say who is blocked
            for answer in (one, other):
                answer.pop("blocked", None)
        like(one, other, f"{message}", 2e-3 if scenario.actions == "continuous" else 2e-5)


def test_vectors_are_drawn_as_often_as_they_should_be(page: Page, tmp_path: Path) -> None:
    config = config_of("vectors")
    team = read_team(run_of(tmp_path / "run", config))
    team.document["greedy"] = False
    given = page_document(config.scenario, {"team": team}, SEED)
    outputs = [0.4, -0.7, -1.0, 0.2]
    found = np.arctanh(np.array(page.evaluate(DRAW, [given, outputs, 20_000])))
    np.testing.assert_allclose(found.mean(axis=0), outputs[:2], atol=0.04)
    np.testing.assert_allclose(found.std(axis=0), np.exp(outputs[2:]), rtol=0.03)
    assert abs(np.corrcoef(found.T)[0, 1]) < 0.03


def test_a_team_that_remembers_and_speaks_plays_without_a_word_in_the_console(
    page: Page, tmp_path: Path
) -> None:
    team = read_team(run_of(tmp_path / "run", config_of("all at once")))
    path = tmp_path / "page.html"
    path.write_text(worlds_page("all", team.config.scenario, {"all": team}, SEED), "utf-8")
    assert path.stat().st_size < 3_000_000
    browser, said = page.context.browser, []
    assert browser is not None
    for seen in ready(browser, path):
        seen.on("console", lambda message: said.append(message.text))
        play = "async (steps) => { while (steps--) await play.send({ do: 'step' }); }"
        seen.evaluate(play, 200)
        seen.keyboard.press("o")
        seen.get_by_role("button", name="New start").click()
        until(seen, "!play.link.busy && !play.movesNow && !play.stale")
        seen.evaluate(play, 50)
        assert seen.evaluate("play.run.now.step") >= 50
        assert np.ptp(np.array(seen.evaluate("play.run.now.attention"))) > 0.1
    assert not said
