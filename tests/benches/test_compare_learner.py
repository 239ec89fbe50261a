"""The comparison with MAAC's public code: its checkout, its calls and its tables."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import compare_learner
import learner_update
import maac_agreement
import maac_checkout
import pytest
import torch
from maac_learner import PublicCode

from innerattn.config import NetworkConfig, TDConfig
from innerattn.learn import TD, Team, Transitions
from innerattn.nn import action_noise, sample_actions

# A learner with the calls of the public code, which writes down what it is told.
LEARNER = """
import torch
from utils.misc import names

class AttentionSAC:
    def __init__(self, agents, sizes, **numbers):
        self.made = agents, sizes, numbers
        self.critic, self.policies = torch.nn.Linear(2, 3), [torch.nn.Linear(1, 1)] * 2
        self.calls = names()
    def prep_training(self, device):
        self.calls.append(("prep_training", device))
    def update_critic(self, sample, logger):
        logger.add_scalars("attention", {}, 0)
        self.calls.append(("update_critic", sample))
    def update_policies(self, sample, logger):
        logger.add_scalar("entropy", 0.0, 0)
        self.calls.append(("update_policies", sample))
    def update_all_targets(self):
        self.calls.append(("update_all_targets", None))
"""
BUFFER = """
class ReplayBuffer:
    def __init__(self, *sizes):
        self.sizes, self.pushed = sizes, []
    def push(self, *parts):
        self.pushed.append(parts)
    def sample(self, count):
        return count
"""


def git(folder: Path, *words: str) -> str:
    author = ["-c", "user.name=A", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
    command = ["git", "-C", str(folder), *author, *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A git checkout with files where the public code has them."""
    folder = tmp_path / "maac"
    files = {
        "algorithms/attention_sac": LEARNER,
        "utils/buffer": BUFFER,
        "utils/misc": "names=list",
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).with_suffix(".py").write_text(text)
    git(tmp_path, "init", "--quiet", str(folder))
    git(folder, "add", ".")
    git(folder, "commit", "--quiet", "--message", "All")
    return folder


@pytest.fixture
def pinned(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same, taken for the pinned commit."""
    monkeypatch.setattr(maac_checkout, "COMMIT", git(checkout, "rev-parse", "HEAD"))
    return checkout


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Gives options that must be refused, and returns the message."""

    def message(*words: object) -> str:
        with pytest.raises(SystemExit) as exit_:
            compare_learner.options([str(word) for word in words])
        assert exit_.value.code == 2
        return capsys.readouterr().err

    return message


def test_without_the_public_code_the_page_says_so() -> None:
    given = compare_learner.options([])
    assert given.maac is None
    assert "was not given" in given.state


def test_the_page_says_how_to_get_the_public_code() -> None:
    page = Path(compare_learner.__file__).parents[1] / "docs" / "performance.md"
    assert f"```sh\n{maac_checkout.GET_IT}\n```" in page.read_text("utf-8")


def test_the_pinned_commit_is_taken_and_named(pinned: Path) -> None:
    given = compare_learner.options(["--maac", str(pinned)])
    assert given.maac == pinned
    assert given.state == f"MAAC's public code: commit {maac_checkout.COMMIT}."


def test_another_commit_is_refused_unless_asked_for(
    checkout: Path, refused: Callable[..., str]
) -> None:
    found = git(checkout, "rev-parse", "HEAD")
    message = refused("--maac", checkout)
    assert f"at commit {found}, must be at {maac_checkout.COMMIT}" in message
    given = compare_learner.options(["--maac", str(checkout), "--any-maac-commit"])
    assert given.state.endswith(f"commit {found}, other than the pinned one.")


def test_changed_files_are_refused_unless_asked_for(
    pinned: Path, refused: Callable[..., str]
) -> None:
    (pinned / "utils" / "misc.py").write_text("names = tuple")
    message = refused("--maac", pinned)
    assert "has changed files" in message
    assert "utils/misc.py" in message
    given = compare_learner.options(["--maac", str(pinned), "--any-maac-commit"])
    assert given.state.endswith(f"commit {maac_checkout.COMMIT}, with changed files.")


def test_what_is_no_checkout_is_refused(
    checkout: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    message = refused("--maac", tmp_path)
    assert "not a checkout of MAAC" in message
    assert f"git -C MAAC checkout {maac_checkout.COMMIT}" in message
    inner = checkout / "copied"
    (checkout / "algorithms").rename(inner.with_name("algorithms_"))
    inner.mkdir()
    (checkout / "algorithms_").rename(inner / "algorithms")
    assert "copied/ in another one" in refused("--maac", inner)
    (tmp_path / "algorithms").mkdir()
    (tmp_path / "algorithms" / "attention_sac.py").touch()
    assert "its commit is unknown" in refused("--maac", tmp_path, "--any-maac-commit")
    assert "needs --maac PATH" in refused("--any-maac-commit")


@pytest.fixture
def importing() -> Iterator[None]:
    """Undoes what importing the public code changes in this process."""
    path, bytecode = [*sys.path], sys.dont_write_bytecode
    yield
    sys.path[:], sys.dont_write_bytecode = path, bytecode
    for name in [*sys.modules]:
        if name.split(".")[0] in ("algorithms", "utils"):
            del sys.modules[name]


TEAM = Team(num_robots=2, obs_width=3, num_actions=4)
NETWORK = NetworkConfig(hidden_width=8, attention_heads=2)
TD_CONFIG = TDConfig(batch_size=8, replay_capacity=40, gamma=0.9)


@pytest.mark.usefixtures("importing")
def test_the_public_code_is_called_as_its_main_program_calls_it(checkout: Path) -> None:
    public: Any = PublicCode(checkout, TEAM, NETWORK, TD_CONFIG)
    agents, sizes, numbers = public.model.made
    assert agents == [{"num_in_pol": 3, "num_out_pol": 4}] * 2
    assert sizes == [(3, 4)] * 2
    assert numbers["gamma"] == 0.9
    assert (numbers["critic_hidden_dim"], numbers["attend_heads"]) == (8, 2)
    assert public._replay.sizes == (40, 2, [3, 3], [4, 4])
    assert public.parameters == 2 * 3 + 3 + 2 * (1 + 1)
    public.update(public.sample(5))
    assert public.model.calls == [
        ("prep_training", "cpu"),
        ("update_critic", 5),
        ("update_policies", 5),
        ("update_all_targets", None),
    ]


@pytest.mark.usefixtures("importing")
def test_the_public_code_gets_the_same_transitions(checkout: Path) -> None:
    public: Any = PublicCode(checkout, TEAM, NETWORK, TD_CONFIG)
    shape = (6, 2)
    batch = Transitions(
        torch.randn(*shape, 3),
        torch.randint(4, shape),
        torch.randn(shape),
        torch.randn(*shape, 3),
        torch.rand(6) > 0.5,
    )
    public.add(batch)
    ((obs, actions, reward, next_obs, dones),) = public._replay.pushed
    assert (obs == batch.obs.numpy()).all()
    assert (next_obs == batch.next_obs.numpy()).all()
    assert (reward == batch.reward.numpy()).all()
    assert [one.sum(axis=1).tolist() for one in actions] == [[1.0] * 6] * 2
    assert [one.argmax(axis=1).tolist() for one in actions] == batch.actions.t().tolist()
    assert dones.tolist() == [[done, done] for done in batch.terminated.tolist()]


def test_the_public_code_can_be_made_to_draw_our_actions() -> None:
    shape = (3, 4, 50)
    log_prob = torch.randn(shape, dtype=torch.float64).log_softmax(dim=1)
    noise = action_noise(shape, torch.Generator().manual_seed(0), torch.float64)
    categorical_sample = maac_agreement.draw_from([*noise])
    for robot, wanted in enumerate(sample_actions(log_prob, noise)):
        actions, one_hot = categorical_sample(log_prob[robot].t().exp())
        assert (actions.squeeze(1) == wanted).all()
        assert (one_hot == torch.eye(4, dtype=torch.float64)[wanted]).all()


@pytest.mark.usefixtures("importing")
def test_a_package_of_the_same_name_is_not_timed_for_the_public_code(checkout: Path) -> None:
    other = ModuleType("utils.buffer")
    other.__file__ = "elsewhere.py"
    sys.modules["utils.buffer"] = other
    with pytest.raises(ImportError, match=r"utils\.buffer is elsewhere\.py"):
        PublicCode(checkout, TEAM, NETWORK, TD_CONFIG)


@pytest.mark.usefixtures("importing")
def test_a_public_code_of_another_size_is_not_timed(checkout: Path) -> None:
    with pytest.raises(ValueError, match="the public code has 13 parameters, must have"):
        learner_update.build(NETWORK, TD_CONFIG, checkout)


def test_everything_but_the_public_code_is_measured_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(TD, "compile", lambda _: None)  # takes long
    found = learner_update.measure(8, NETWORK, TD_CONFIG, None, repeats=1)
    names = ["stand-in", "eager", "compiled", "products", "draw, ours", "act"]
    assert list(found) == names
    assert min(found.values()) > 0.0


@pytest.mark.long
def test_a_failed_measurement_ends_the_comparison(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="No module named 'algorithms'"):
        compare_learner.one_round((8, 1), tmp_path)


def test_medians_are_of_calls_in_turn() -> None:
    called: list[str] = []
    actions = {name: lambda name=name: called.append(name) for name in "ab"}
    found = learner_update.median_ms(actions, 3)
    assert called == list("ab") * 5  # two of them to warm up
    assert list(found) == ["a", "b"]


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("| ").split("|")]


ROUND = {
    "public code": 200.0,
    "draw, public code": 5.0,
    "stand-in": 300.0,
    "eager": 100.0,
    "compiled": 50.0,
    "products": 40.0,
    "draw, ours": 0.5,
    "act": 0.25,
}


def test_ratios_are_to_the_public_code_and_to_the_stand_in() -> None:
    rounds = [ROUND, ROUND | {"compiled": 40.0}, ROUND | {"compiled": 80.0, "public code": 240.0}]
    updates, _, ratios, beside = compare_learner.update_tables({(256, 2): rounds}).split("\n\n")
    head, _, row = map(cells, updates.splitlines())
    assert dict(zip(head, row, strict=True)) == {
        "batch": "256",
        "threads": "2",
        "public code, ms": "200.0",
        "stand-in, ms": "300.0",
        "eager, ms": "100.0",
        "compiled, ms": "50.0",
        "products, ms": "40.0",
    }
    head, _, row = map(cells, ratios.splitlines())
    assert dict(zip(head[2:], row[2:], strict=True)) == {
        "eager vs public code": "2.00 (2.00 to 2.40)",
        "compiled vs public code": "4.00 (3.00 to 5.00)",
        "eager vs stand-in": "3.00 (3.00 to 3.00)",
        "compiled vs stand-in": "6.00 (3.75 to 7.50)",
    }
    head, _, row = map(cells, beside.splitlines())
    assert head[2:] == ["draw, public code, ms", "draw, ours, ms", "act, ms"]
    assert row[2:] == ["5.00", "0.50", "0.25"]


def test_tables_without_the_public_code_have_no_column_of_it() -> None:
    found = {name: ms for name, ms in ROUND.items() if "public code" not in name}
    text = compare_learner.update_tables({(256, 1): [found], (256, 2): [found]})
    assert "public code" not in text
    assert text.count("6.00 (6.00 to 6.00)") == 2
