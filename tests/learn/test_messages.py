"""The on-policy learner whose robots have messages: rollouts, updates, states, and a task."""

import pytest
import torch
from torch import Tensor

from innerattn.config import NetworkConfig, PPOConfig
from innerattn.learn import PPO, Team, Transitions
from innerattn.learn.clipped_update import recalls
from innerattn.learn.rollout import Rollout
from innerattn.nn import NUM_ELEMENTS, Hearing
from innerattn.nn.message import with_element

CPU = torch.device("cpu")
ROBOTS, OBS_WIDTH, ACTIONS, ENVS, STEPS, LENGTH, WIDTH = 3, 7, 3, 4, 6, 3, 4
SENDS, HEARD = 0, (1, 2)  # and the places of teammates at 3 and 5
NETWORK = {"hidden_width": 8, "attention_heads": 2, "message_width": WIDTH}
NUMBERS = {
    "rollout_steps": STEPS,
    "sequence_steps": LENGTH,
    "minibatch_size": 6,
    "epochs": 2,
    "gamma": 0.9,
    "gae_lambda": 0.8,
    "learning_rate": 0.01,
}


def make(delay: int = 0, network: dict | None = None, **extra) -> PPO:
    hearing = Hearing(SENDS, HEARD, ((3, 4), (5, 6)), delay=delay)
    return PPO(
        Team(ROBOTS, OBS_WIDTH, ACTIONS, hearing=hearing),
        NetworkConfig(**{**NETWORK, **(network or {})}),
        PPOConfig(**NUMBERS),
        **{"seed": 3, "device": CPU, "dtype": torch.float64, **extra},
    )


def seen_at(step: int, age: Tensor, delay: int, framed: bool) -> tuple[Tensor, Tensor | None]:
    """Observations of worlds whose episodes are ``age`` old, and elements that turned them."""
    source = torch.Generator().manual_seed(step)
    obs = torch.randn(ENVS, ROBOTS, OBS_WIDTH, generator=source)
    obs[..., SENDS] = (torch.rand(ENVS, ROBOTS, generator=source) < 0.8).float()
    heard = torch.rand(ENVS, ROBOTS, len(HEARD), generator=source) < 0.8
    obs[..., list(HEARD)] = (heard & (age >= delay).view(-1, 1, 1)).float()
    elements = torch.randint(NUM_ELEMENTS, (ENVS, ROBOTS), generator=source)
    return obs, elements if framed else None


def steps(learner: PPO, first: int, last: int, delay: int, framed: bool, acts: bool = True) -> None:
    """Control steps of worlds of which some end; learn after each where an update is due."""
    age = torch.zeros(ENVS, dtype=torch.int64)
    for step in range(last):
        source = torch.Generator().manual_seed(1_000 + step)
        ended = torch.rand(ENVS, generator=source) < 0.25
        obs, now = seen_at(step, age, delay, framed)
        # What follows is what is seen next, unless the episode ends.
        after, then = seen_at(step + 1, age + 1, delay, framed)
        age = torch.where(ended, 0, age + 1)
        reward = torch.randn(ENVS, ROBOTS, generator=source)
        if step < first:
            continue
        if acts:
            chosen = learner.act(obs, elements=now)
        else:
            chosen = torch.randint(ACTIONS, (ENVS, ROBOTS), generator=source)
        terminated = ended & (step % 2 == 0)
        batch = Transitions(
            obs, chosen, reward, after, terminated, elements=now, next_elements=then
        )
        learner.observe(batch, ended & ~terminated)
        if learner._buffer.full and last > STEPS:
            learner.learn()


CASES = {
    "at once": (0, False, {}),
    "mean, framed": (0, True, {"symmetry": "canonical", "message_pooling": "mean"}),
    "late": (2, False, {"message_pooling": "nearest"}),
    "late, framed": (1, True, {"symmetry": "canonical", "message_pooling": "max"}),
    "memory": (0, False, {"memory_width": 4}),
    "memory, late, framed": (2, True, {"symmetry": "canonical", "memory_width": 4}),
    "no attention": (1, True, {"symmetry": "canonical", "attention": "none"}),
}
cases = pytest.mark.parametrize(("delay", "framed", "network"), CASES.values(), ids=CASES)


@cases
def test_rollouts_say_what_was_said(delay: int, framed: bool, network: dict) -> None:
    """An update makes the messages anew, and finds the policy that acted."""
    learner = make(delay, network)
    steps(learner, 0, STEPS, delay, framed)
    known = learner._buffer.steps().log_probs
    assert known is not None
    rollout = learner._rollout()
    outputs = learner.actor(rollout.obs, *recalls(rollout.recall)[0])
    taken = outputs.log_softmax(dim=1).gather(1, rollout.actions.unsqueeze(1)).squeeze(1)
    torch.testing.assert_close(taken, rollout.log_prob)
    deaf = rollout.obs.clone()
    deaf[..., list(HEARD)] = 0.0
    others = learner.actor(deaf, *recalls(rollout.recall)[0])
    assert not torch.allclose(outputs, others)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_rows_hold_what_was_seen_when_it_was_said(delay: int) -> None:
    learner = make(delay, {"symmetry": "canonical"})
    shown: list[Tensor] = []
    for step in range(STEPS):
        obs, now = seen_at(step, torch.full((ENVS,), 9), delay, True)
        after, then = seen_at(step + 1, torch.full((ENVS,), 9), delay, True)
        chosen = learner.act(obs, elements=now)
        ended = torch.tensor([False, step == 2, False, False])
        batch = Transitions(obs, chosen, torch.ones(ENVS, ROBOTS), after, ended & False)
        learner.observe(batch._replace(elements=now, next_elements=then), ended)
        assert now is not None
        shown.append(with_element(obs.double().transpose(0, 1), now.t()))
        final = with_element(after.double().transpose(0, 1), then.t())
    held = learner._buffer.steps()
    rows = held.obs.unflatten(1, (STEPS, ENVS))
    nothing = torch.zeros_like(shown[0])
    for step in range(STEPS):
        assert torch.equal(rows[:, step, :, : OBS_WIDTH + 1], shown[step])
        if delay:
            then = shown[step - delay] if step >= delay else nothing
            assert torch.equal(rows[:, step, :, OBS_WIDTH + 1 :], then)
    assert held.after.shape[1] == 1 + ENVS
    assert torch.equal(held.after[:, 1:, : OBS_WIDTH + 1], final)
    if delay:
        assert torch.equal(
            held.after[:, 0, OBS_WIDTH + 1 :], (shown[3 - delay] if delay < 4 else nothing)[:, 1]
        )
        assert torch.equal(held.after[:, 1:, OBS_WIDTH + 1 :], shown[STEPS - delay])


@cases
def test_updates_follow_gradients_to_those_who_said(
    delay: int, framed: bool, network: dict
) -> None:
    """The gradient of an update is that of a plain loss of the same rows, whole worlds each."""
    learner = make(delay, network)
    steps(learner, 0, STEPS, delay, framed)
    rollout: Rollout = learner._rollout()
    rows = rollout.take(torch.arange(rollout.units).flip(0))
    recall = recalls(rows.recall)[0]
    weight = torch.tensor(0.01, dtype=torch.float64)
    found, _ = learner._actor_gradients(
        learner._networks, rows.obs, rows.actions, rows.log_prob, rows.advantage, weight, recall
    )
    with torch.enable_grad():
        log_prob = learner.actor(rows.obs, *recall).log_softmax(dim=1)
        taken = log_prob.gather(1, rows.actions.unsqueeze(1)).squeeze(1)
        ratio = (taken - rows.log_prob).exp()
        clipped = ratio.clamp(0.8, 1.2) * rows.advantage
        surrogate = -torch.minimum(ratio * rows.advantage, clipped).mean(dim=1).sum()
        entropy = -(log_prob.exp() * log_prob).sum(dim=1).mean(dim=1).sum()
        (surrogate - weight * entropy).backward()
    for name, parameter in learner.actor.named_parameters():
        torch.testing.assert_close(found[name], parameter.grad)
    assert all(found["messages.output.weight"].flatten(1).any(dim=1))
    before = learner.state()["actor.messages.output.weight"]
    learner.update(rows)
    assert not torch.equal(learner.state()["actor.messages.output.weight"], before)


@cases
@pytest.mark.parametrize("after", [4, *(pytest.param(n, marks=pytest.mark.long) for n in (2, 8))])
def test_it_goes_on_from_a_state(delay: int, framed: bool, network: dict, after: int) -> None:
    """In the middle of a rollout, of an episode, and with messages on their way."""
    whole, cut, other = (make(delay, network, seed=seed) for seed in (3, 3, 8))
    steps(whole, 0, 14, delay, framed)
    steps(cut, 0, after, delay, framed)
    if after > STEPS:
        assert cut.updates
    other.load(cut.state())
    other.load_resume_state({key: one.clone() for key, one in cut.resume_state().items()})
    steps(other, after, 14, delay, framed)
    for name, tensor in whole.state().items():
        assert torch.equal(tensor, other.state()[name]), name


def test_it_goes_on_in_the_middle_of_an_update() -> None:
    whole, cut, other = (make(1, seed=seed) for seed in (3, 3, 8))
    for learner in (whole, cut):
        steps(learner, 0, STEPS, 1, False)
    whole.learn()

    class StopError(Exception): ...

    class Interrupted:
        left = 3

        def check(self) -> None:
            self.left -= 1
            if not self.left:
                raise StopError

    cut.interruptions = Interrupted()
    with pytest.raises(StopError):
        cut.learn()
    other.load(cut.state())
    other.load_resume_state({key: one.clone() for key, one in cut.resume_state().items()})
    other.learn()
    assert other.updates == whole.updates > cut.updates > 0
    for name, tensor in whole.state().items():
        assert torch.equal(tensor, other.state()[name]), name


def test_a_damaged_state_is_refused() -> None:
    learner = make(2)
    steps(learner, 0, 3, 2, True)
    state = learner.resume_state()
    past, obs = state["messages.past"], state["buffer.obs"]
    assert past.shape == (2, ROBOTS, ENVS, OBS_WIDTH + 1)
    for name, value in (
        ("messages.past", past[1:]),
        ("messages.past", torch.full_like(past, torch.inf)),
        ("buffer.obs", obs[..., 1:]),
    ):
        with pytest.raises(ValueError, match=name.rpartition(".")[2]):
            make(2).load_resume_state({**state, name: value})


@pytest.mark.parametrize("delay", [0, 2])
def test_steps_that_others_acted_in_are_said_too(delay: int) -> None:
    one, other = make(delay), make(delay)
    steps(one, 0, 4, delay, True)
    steps(other, 0, 4, delay, True, acts=False)
    assert torch.equal(one._messages.now, other._messages.now)


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_what_was_said_is_forgotten_with_the_episode(delay: int) -> None:
    learner = make(delay)
    always = torch.full((ENVS,), 9)
    first, second = (seen_at(step, always, delay, False)[0] for step in (0, 1))

    def logits(obs: Tensor) -> Tensor:
        learner.act(obs)
        return learner._acted[1].clone()

    fresh = logits(second)
    learner.forget()
    logits(first)
    later = logits(second)
    assert torch.equal(later, fresh) == (delay != 1)
    learner.forget()
    assert torch.equal(logits(second), fresh)
    learner.act(first)
    torch.testing.assert_close(logits(second[:2]), fresh[..., :2])  # other worlds: all begin anew


def test_actions_do_not_depend_on_who_shares_a_batch() -> None:
    whole, parts = make(1), [make(1), make(1)]
    for step in range(5):
        obs, elements = seen_at(step, torch.full((ENVS,), step), 1, True)
        whole.act(obs, elements=elements)
        for k, learner in enumerate(parts):
            some = slice(2 * k, 2 * k + 2)
            learner.act(obs[some], elements=elements[some])
            torch.testing.assert_close(learner._acted[1], whole._acted[1][..., some])


def test_without_messages_nothing_changes() -> None:
    plain = make(0, {"message_width": 0})
    assert not any("messages" in name for name in plain.state())
    known = PPO(
        Team(ROBOTS, OBS_WIDTH, ACTIONS),
        NetworkConfig(hidden_width=8, attention_heads=2),
        PPOConfig(**NUMBERS),
        seed=3,
        device=CPU,
        dtype=torch.float64,
    )
    for learner in (plain, known):
        steps(learner, 0, 14, 0, False)
    for name, tensor in known.state().items():
        assert torch.equal(tensor, plain.state()[name]), name


def shares_of_hits(width: int, rollouts: int, pooling: str = "attention", delay: int = 0):
    """How often a robot does what only its teammate sees, by rollout.

    One robot sees a cue, which another is to name; a third one sees another cue, which is of no
    use. With a delay, the cue was seen so many steps before.
    """
    envs, cues = 128, 4
    # whether it sends, whom it hears, their places, the cue, and whether it is the right one
    robots, obs_width = 3, 1 + 2 + 4 + cues + 1
    hearing = Hearing(0, (1, 2), ((3, 4), (5, 6)), delay=delay)
    learner = PPO(
        Team(robots, obs_width, cues, hearing=hearing),
        NetworkConfig(
            hidden_width=32, attention_heads=4, message_width=width, message_pooling=pooling
        ),
        PPOConfig(rollout_steps=4, minibatch_size=512, learning_rate=0.005, gamma=0.0),
        seed=0,
        device=CPU,
    )
    source = torch.Generator().manual_seed(1)
    shares = []
    drawn = [torch.randint(cues, (envs, 2), generator=source) for _ in range(delay)]
    for _ in range(rollouts):
        for _ in range(4):
            cue = torch.randint(cues, (envs, 2), generator=source)
            drawn.append(cue)
            right = drawn.pop(0)[:, 0]
            obs = torch.zeros(envs, robots, obs_width)
            obs[..., :3] = 1.0
            obs[:, 0, 3:5], obs[:, 0, 5:7] = 0.5, 1.0  # its informant is the nearest
            obs[:, 1:, 7:11] = torch.nn.functional.one_hot(cue, cues).float()
            obs[:, 1, 11] = 1.0
            chosen = learner.act(obs)
            hits = (chosen[:, 0] == right).float()
            reward = torch.zeros(envs, robots)
            reward[:, 0] = hits
            nothing = torch.zeros(envs, dtype=torch.bool)
            learner.observe(Transitions(obs, chosen, reward, obs, nothing), nothing)
            shares.append(float(hits.mean()))
        learner.learn()
    return shares


@pytest.mark.parametrize(
    "pooling",
    [
        "attention",
        *(pytest.param(one, marks=pytest.mark.long) for one in ("mean", "max", "nearest")),
    ],
)
def test_robots_learn_what_to_say(pooling: str) -> None:
    assert sum(shares_of_hits(8, 24, pooling)[-16:]) / 16 > 0.9


def test_robots_learn_what_to_say_early() -> None:
    assert sum(shares_of_hits(8, 24, delay=2)[-16:]) / 16 > 0.9


def test_without_messages_they_guess() -> None:
    assert sum(shares_of_hits(0, 20)[-40:]) / 40 < 0.35  # one of four by chance
