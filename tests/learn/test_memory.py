"""The on-policy learner with a memory, against the plain form and against loops over steps."""

from dataclasses import dataclass

import pytest
import torch
from reference_ppo import PlainPPO
from torch import Tensor, nn

from innerattn.config import NetworkConfig, PPOConfig
from innerattn.learn import PPO, Team, Transitions
from innerattn.learn.recall import Recall
from innerattn.learn.rollout import Rollout
from innerattn.nn import NUM_ELEMENTS, actions
from innerattn.nn.memory import turned_memory
from innerattn.nn.symmetry import inverse

CPU = torch.device("cpu")
ROBOTS, OBS_WIDTH, ACTIONS, ENVS, STEPS, LENGTH, WIDTH = 2, 5, 3, 4, 6, 3, 4
NETWORK = {"hidden_width": 8, "attention_heads": 2, "memory_width": WIDTH}
NUMBERS = {
    "rollout_steps": STEPS,
    "sequence_steps": LENGTH,
    "minibatch_size": 6,
    "epochs": 2,
    "gamma": 0.9,
    "gae_lambda": 0.8,
    "learning_rate": 0.01,
}


def make(network: dict | None = None, numbers: dict | None = None, **extra) -> PPO:
    return PPO(
        Team(ROBOTS, OBS_WIDTH, ACTIONS),
        NetworkConfig(**{**NETWORK, **(network or {})}),
        PPOConfig(**{**NUMBERS, **(numbers or {})}),
        **{"seed": 3, "device": CPU, "dtype": torch.float64, **extra},
    )


class Cells:
    """Torch's own units, one for each robot, with the parameters of a memory."""

    def __init__(self, state: dict[str, Tensor], name: str) -> None:
        self.cells = []
        for robot in range(ROBOTS):
            cell = nn.GRUCell(OBS_WIDTH, WIDTH, dtype=torch.float64)
            with torch.no_grad():
                for ours, theirs in (("of_input", "ih"), ("of_past", "hh")):
                    for part in ("weight", "bias"):
                        value = state[f"{name}.memory.{ours}.{part}"][robot]
                        getattr(cell, f"{part}_{theirs}").copy_(value)
            self.cells.append(cell)

    def __call__(self, obs: Tensor, past: Tensor, elements: Tensor | None) -> Tensor:
        """What is remembered (E, R, W) in the frames, from that (E, R, W) in the world."""
        if elements is not None:
            past = turned_memory(past, elements)
        found = [cell(obs[:, robot], past[:, robot]) for robot, cell in enumerate(self.cells)]
        return torch.stack(found, dim=1)


@dataclass
class Shown:
    """A rollout that was shown to a learner, with what its robots remembered beside it."""

    steps: list[tuple[Transitions, Tensor]]
    wide: list[tuple[Transitions, Tensor]]
    before: list[Tensor]


def show(learner: PPO, seed: int, framed: bool, before: Tensor | None = None) -> Shown:
    """Steps of worlds that go on, some of which end."""
    source = torch.Generator().manual_seed(seed)
    cells = [Cells(learner.state(), name) for name in ("actor", "critic")]
    zeros = torch.zeros(ENVS, ROBOTS, 2 * WIDTH, dtype=torch.float64)
    past = zeros if before is None else before
    obs = torch.randn(ENVS, ROBOTS, OBS_WIDTH, generator=source)
    shown = Shown([], [], [])

    def elements() -> Tensor | None:
        drawn = torch.randint(NUM_ELEMENTS, (ENVS, ROBOTS), generator=source)
        return drawn if framed else None

    @torch.no_grad()
    def wide(obs: Tensor, past: Tensor, turned: Tensor | None) -> tuple[Tensor, Tensor]:
        parts = [
            cell(obs.double(), part, turned)
            for cell, part in zip(cells, past.chunk(2, dim=2), strict=True)
        ]
        after = torch.cat(
            [one if turned is None else turned_memory(one, inverse(turned)) for one in parts], 2
        )
        return torch.cat([obs.double(), *parts], dim=2), after

    for step in range(STEPS):
        after = torch.randn(ENVS, ROBOTS, OBS_WIDTH, generator=source)
        terminated = torch.tensor([step == 1, False, False, step == 3])
        truncated = torch.tensor([False, step == 0, step == 2, False])
        now, then = elements(), elements()
        chosen = learner.act(obs, elements=now)
        batch = Transitions(
            obs,
            chosen,
            torch.randn(ENVS, ROBOTS, generator=source) + 0.3,
            after,
            terminated,
            elements=now,
            next_elements=then,
        )
        shown.before.append(past)
        seen, past = wide(obs, past, now)
        seen_after, _ = wide(after, past, then)
        shown.steps.append((batch, truncated))
        shown.wide.append((batch._replace(obs=seen, next_obs=seen_after), truncated))
        learner.observe(batch, truncated)
        ended = (terminated | truncated).view(-1, 1, 1)
        past = torch.where(ended, torch.zeros((), dtype=torch.float64), past)
        fresh = torch.randn(ENVS, ROBOTS, OBS_WIDTH, generator=source)
        obs = torch.where(ended, fresh, after)
    torch.testing.assert_close(learner._memories.now.transpose(0, 1), past)
    return shown


def widened(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """Networks without a memory, for [observation, actor's memory, critic's memory]."""
    found = {}
    for name, value in state.items():
        whole, network, key = name.partition(".network.")
        if not network:
            continue
        width, remembered = OBS_WIDTH, OBS_WIDTH + WIDTH
        nothing = torch.zeros(*value.shape[:2], WIDTH, dtype=value.dtype)
        if name == "actor.network.first.weight":
            value = torch.cat([value, nothing], dim=2)
        elif key in ("state_encoder.weight", "action_encoder.weight", "first.weight"):
            if key == "first.weight":  # a joint critic takes all robots' observations
                parts = value.split(remembered, dim=2)
                parts = [torch.cat([p[..., :width], nothing, p[..., width:]], 2) for p in parts]
                value = torch.cat(parts, dim=2)
            else:
                value = torch.cat([value[..., :width], nothing, value[..., width:]], dim=2)
        found[f"{whole}.{key}"] = value
    return found


@pytest.mark.parametrize("framed", [False, True])
@pytest.mark.parametrize(
    ("attention", "advantage"),
    [("inner", "counterfactual"), ("uniform", "value"), ("none", "value")],
)
def test_rollouts_agree_with_the_plain_form(
    attention: str, advantage: str, framed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    learner = make({"attention": attention}, {"advantage": advantage})
    network = NetworkConfig(**{**NETWORK, "memory_width": 0}, attention=attention)
    plain = PlainPPO(widened(learner.state()), network, learner._config, ACTIONS)
    drawn: list[Tensor] = []
    original = actions.sample_actions

    def recording(logits: Tensor, noise: Tensor) -> Tensor:
        drawn.append(original(logits, noise))
        return drawn[-1]

    monkeypatch.setattr(actions, "sample_actions", recording)
    before = None
    for round_ in range(2):  # the second begins in the middle of episodes
        shown = show(learner, round_, framed, before)
        rollout = learner._rollout()
        learner._buffer.clear()
        expected = plain.rollout(shown.wide, drawn[-1])
        for name in ("advantage", "target"):
            in_order = expected[name].view(ROBOTS, -1, LENGTH, ENVS).transpose(1, 2).flatten(1)
            torch.testing.assert_close(getattr(rollout, name), in_order)
        assert isinstance(rollout.recall, Recall)
        stored = torch.stack([shown.before[0], shown.before[LENGTH]]).flatten(0, 1)
        torch.testing.assert_close(rollout.recall.remembered.transpose(0, 1), stored)
        before = learner._memories.now.transpose(0, 1)
        assert bool(before.abs().max() > 0)


def by_loops(learner: PPO, rows: Rollout, kind: str) -> Tensor:
    """The networks' outputs (R, A, B) of rows, step by step, with gradients to the memory."""
    net = getattr(learner, kind)
    recall = rows.recall
    count, which = recall.begins.shape[1], ("actor", "critic").index(kind)
    past = recall.remembered.chunk(2, dim=2)[which]
    found = []
    for step in range(LENGTH):
        chosen = slice(step * count, (step + 1) * count)
        past = past * (~recall.begins[step]).double().view(1, -1, 1)
        if recall.turns is not None:
            past = turned_memory(past, recall.turns[:, chosen])
        own = []
        for robot in range(ROBOTS):
            read, back = net.memory.of_input, net.memory.of_past
            inputs = rows.obs[robot, chosen] @ read.weight[robot].T + read.bias[robot]
            recalled = past[robot] @ back.weight[robot].T + back.bias[robot]
            (ir, iz, i_n), (hr, hz, h_n) = inputs.chunk(3, 1), recalled.chunk(3, 1)
            r, z = torch.sigmoid(ir + hr), torch.sigmoid(iz + hz)
            own.append((1 - z) * torch.tanh(i_n + r * h_n) + z * past[robot])
        past = torch.stack(own)
        inputs = torch.cat([rows.obs[:, chosen], past], dim=2)
        if kind == "actor":
            found.append(net.network(inputs))
        else:
            found.append(net.network(inputs, rows.actions[:, chosen]).q)
    return torch.cat(found, dim=2)


@pytest.mark.parametrize("framed", [False, True])
def test_gradients_go_back_through_the_steps_of_a_sequence(framed: bool) -> None:
    learner = make()
    show(learner, 0, framed)
    rows = learner._rollout().take(torch.tensor([6, 1, 3]))
    assert rows.obs.shape[1] == 3 * LENGTH
    assert rows.recall.begins.any()
    assert (rows.recall.turns is not None) == framed
    weight = torch.tensor(0.01, dtype=torch.float64)
    of_actor, of_critic = ((part, *rows.recall[1:]) for part in rows.recall[0].chunk(2, dim=2))
    nets = learner._networks

    with torch.enable_grad():
        log_prob = by_loops(learner, rows, "actor").log_softmax(dim=1)
        taken = log_prob.gather(1, rows.actions.unsqueeze(1)).squeeze(1)
        ratio = (taken - rows.log_prob).exp()
        clipped = ratio.clamp(0.8, 1.2) * rows.advantage
        surrogate = -torch.minimum(ratio * rows.advantage, clipped).mean(dim=1).sum()
        entropy = -(log_prob.exp() * log_prob).sum(dim=1).mean(dim=1).sum()
        (surrogate - weight * entropy).backward()
    torch.testing.assert_close(ratio, torch.ones_like(ratio))  # of the policy that acted
    found, _ = learner._actor_gradients(
        nets, rows.obs, rows.actions, rows.log_prob, rows.advantage, weight, of_actor
    )
    for name, parameter in learner.actor.named_parameters():
        torch.testing.assert_close(found[name], parameter.grad)
    assert found["memory.of_past.weight"].abs().max() > 0

    with torch.enable_grad():
        q = by_loops(learner, rows, "critic")
        fitted = q.gather(1, rows.actions.unsqueeze(1)).squeeze(1)
        (fitted - rows.target).square().mean(dim=1).sum().backward()
    found, _ = learner._critic_gradients(nets, rows.obs, rows.actions, rows.target, of_critic)
    for name, parameter in learner.critic.named_parameters():
        torch.testing.assert_close(found[name], parameter.grad)
    assert found["memory.of_past.weight"].abs().max() > 0


def test_every_sequence_is_used_once_a_pass() -> None:
    learner = make()
    show(learner, 0, False)
    sizes = []
    update = learner.update
    learner.update = lambda rows: sizes.append(rows.obs.shape[1]) or update(rows)
    assert learner.learn() is not None
    assert sizes == [2 * LENGTH] * 8  # 24 rows, 6 at a time, twice


def test_a_robot_remembers_until_its_episode_ends() -> None:
    learner = make()
    source = torch.Generator().manual_seed(0)
    first, second = (torch.randn(ENVS, ROBOTS, OBS_WIDTH, generator=source) for _ in range(2))

    def logits(obs: Tensor) -> Tensor:
        learner.act(obs)
        return learner._acted[1].clone()

    fresh = logits(second)
    learner.forget()
    logits(first)
    later = logits(second)
    assert not torch.equal(later, fresh)
    learner.forget()
    assert torch.equal(logits(second), fresh)
    assert torch.equal(logits(second[:2])[0], fresh[0, :, :2])  # other worlds: all begin anew

    learner.forget()
    chosen = learner.act(first)
    ended = torch.tensor([True, False, True, False])
    batch = Transitions(first, chosen, torch.ones(ENVS, ROBOTS), second, ended & False)
    learner.observe(batch, ended)
    found = logits(second)
    assert torch.equal(found[:, :, ended], fresh[:, :, ended])
    torch.testing.assert_close(found[:, :, ~ended], later[:, :, ~ended])


def test_attention_is_that_of_a_critic_that_remembers() -> None:
    learner = make()
    source = torch.Generator().manual_seed(0)
    first, second = (torch.randn(ENVS, ROBOTS + 1, OBS_WIDTH, generator=source) for _ in range(2))
    learner = PPO(
        Team(ROBOTS + 1, OBS_WIDTH, ACTIONS),
        NetworkConfig(**NETWORK),
        PPOConfig(**NUMBERS),
        seed=1,
        device=CPU,
    )
    chosen = learner.act(second)
    fresh = learner.attention(second, chosen)
    learner.forget()
    learner.act(first)
    learner.act(second)
    later, before = learner.attention(second, chosen), learner.remembered()
    assert not torch.equal(later, fresh)
    learner.forget()
    assert torch.equal(learner.attention(second, chosen, before), later)
    assert torch.equal(learner.attention(second, chosen, torch.zeros_like(before)), fresh)


@pytest.mark.parametrize("after", [2, 4])
def test_it_goes_on_from_a_state(after: int) -> None:
    """In the middle of a rollout, and of an episode."""

    def steps(learner: PPO, first: int, last: int) -> None:
        for step in range(first, last):
            source = torch.Generator().manual_seed(step)
            obs, then = (torch.randn(ENVS, ROBOTS, OBS_WIDTH, generator=source) for _ in range(2))
            elements = torch.randint(NUM_ELEMENTS, (2, ENVS, ROBOTS), generator=source)
            chosen = learner.act(obs, elements=elements[0])
            ended = torch.rand(ENVS, generator=source) < 0.3
            reward = torch.randn(ENVS, ROBOTS, generator=source)
            batch = Transitions(
                obs, chosen, reward, then, ended & False, None, None, elements[0], elements[1]
            )
            learner.observe(batch, ended)
            learner.learn()

    whole, cut, other = make(), make(), make(seed=8)
    steps(whole, 0, 14)
    steps(cut, 0, after)
    other.load(cut.state())
    other.load_resume_state({key: one.clone() for key, one in cut.resume_state().items()})
    steps(other, after, 14)
    for name, tensor in whole.state().items():
        assert torch.equal(tensor, other.state()[name]), name


def test_a_damaged_state_is_refused() -> None:
    learner = make()
    show(learner, 0, True)
    state = learner.resume_state()
    for name, value in (
        ("memories.now", torch.full_like(state["memories.now"], 1.5)),
        ("buffer.recalled.elements", torch.full_like(state["buffer.recalled.elements"], 8)),
        ("buffer.recalled.after", state["buffer.recalled.after"][:, 1:]),
    ):
        with pytest.raises(ValueError, match=name.rpartition(".")[2]):
            make().load_resume_state({**state, name: value})


def shares_of_hits(width: int, rollouts: int) -> list[float]:
    """How often robots say at an episode's end what they saw only at its beginning, by rollout."""
    length, envs = 5, 64
    learner = PPO(
        Team(2, 5, 5, kinds=("a", "a")),
        NetworkConfig(
            hidden_width=32, attention_heads=4, memory_width=width, parameter_sharing="kind"
        ),
        PPOConfig(
            rollout_steps=2 * length,
            sequence_steps=length,
            minibatch_size=320,
            learning_rate=0.003,
            gamma=0.95,
        ),
        seed=0,
        device=CPU,
    )
    source = torch.Generator().manual_seed(1)
    shares = []
    for _ in range(rollouts):
        for _ in range(2):
            cue = torch.randint(0, 4, (envs, 2), generator=source)
            for step in range(length):
                last = step == length - 1
                obs = torch.zeros(envs, 2, 5)
                if step == 0:
                    obs.scatter_(2, cue.unsqueeze(2), 1.0)
                obs[:, :, 4] = float(last)
                chosen = learner.act(obs)
                hits = ((chosen == cue) & last).float()
                ended = torch.full((envs,), last)
                learner.observe(
                    Transitions(obs, chosen, hits, torch.zeros_like(obs), ended), ended & False
                )
        shares.append(float(hits.mean()))
        learner.learn()
    return shares


@pytest.mark.long
def test_a_memory_learns_what_cannot_be_seen() -> None:
    assert sum(shares_of_hits(16, 40)[-5:]) / 5 > 0.9
    assert sum(shares_of_hits(0, 20)[-10:]) / 10 < 0.4  # one of four by chance
