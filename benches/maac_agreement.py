"""Whether MAAC's public code and ours do the same update, apart from the differences we name.

`python benches/maac_agreement.py PATH` gives both the same weights, batch and drawn actions, in
double precision. It undoes the differences that `docs/paper.md` lists and that change one update:
three in the public code, and one by our `td.policy_gradient = "sampled"`. Printed is the largest
difference of a parameter after some updates, without them and with each one left in.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import torch
from learner_update import TEAM, random_transitions
from maac_checkout import describe_checkout
from maac_learner import PublicCode
from page import table
from torch import Tensor, nn

from innerattn.config import load_run_config
from innerattn.learn import TD, Transitions
from innerattn.nn import action_noise

BATCH = 256
UPDATES = 3
AGREEMENT = 1e-12
DOUBLE = torch.float64
DIFFERENCES = (
    "normalised inputs",
    "state-action encoders divided by N",
    "regularised policy logits",
    "policy gradient",
)


def actor_pairs(ours: nn.Module, theirs: list[Any]) -> list[tuple[Tensor, Tensor]]:
    """Parameters of all actors: ours of one robot, and the public code's."""
    names = {"first": "fc1", "second": "fc2", "output": "fc3"}
    return [
        (getattr(getattr(ours, own), part)[robot], getattr(getattr(policy, other), part))
        for robot, policy in enumerate(theirs)
        for own, other in names.items()
        for part in ("weight", "bias")
    ]


def critic_pairs(ours: Any, theirs: Any) -> list[tuple[Tensor, Tensor]]:
    """Parameters of a critic: ours of one robot or head, and the public code's."""
    layers = [
        (ours.action_encoder, [one.enc_fc1 for one in theirs.critic_encoders]),
        (ours.state_encoder, [one.s_enc_fc1 for one in theirs.state_encoders]),
        (ours.hidden, [one.critic_fc1 for one in theirs.critics]),
        (ours.output, [one.critic_fc2 for one in theirs.critics]),
    ]
    pairs = [
        (getattr(layer, part)[robot], getattr(one, part))
        for layer, ones in layers
        for robot, one in enumerate(ones)
        for part in ("weight", "bias")
    ]
    values = [one[0] for one in theirs.value_extractors]
    heads = [
        (ours.attention.query, [one.weight for one in theirs.selector_extractors]),
        (ours.attention.key, [one.weight for one in theirs.key_extractors]),
        (ours.attention.value, [one.weight for one in values]),
        (ours.attention.value_bias, [one.bias for one in values]),
    ]
    for full, ones in heads:
        pairs += zip(full.chunk(len(ones)), ones, strict=True)
    return pairs


def undo(model: Any, left_in: str) -> None:
    """Undo the differences that are in the public code, but one."""
    policies = [*model.policies, *model.target_policies]
    if left_in != "normalised inputs":
        for critic in (model.critic, model.target_critic):
            for one in critic.critic_encoders:
                one.enc_bn = nn.Identity()
            for one in critic.state_encoders:
                one.s_enc_bn = nn.Identity()
        for policy in policies:
            policy.in_fn = nn.Identity()
    if left_in != "state-action encoders divided by N":
        model.critic.shared_modules.remove(model.critic.critic_encoders)
    if left_in != "regularised policy logits":
        for policy in policies:
            policy.forward = without_regularisation(policy.forward)


def without_regularisation(forward: Any) -> Any:
    """A policy's forward pass, with no term where the update asks for the regularisation."""

    def changed(obs: Tensor, regularize: bool = False, **asked: bool) -> Any:
        found = forward(obs, **asked)
        if regularize:
            found.insert(3, [])  # after action, probabilities and log-probability
        return found

    return changed


def draw_from(noise: list[Tensor]) -> Any:
    """The public code's draw of actions, from noise (A, B) of one robot after the other."""

    def categorical_sample(probs: Tensor, **_: object) -> tuple[Tensor, Tensor]:
        actions = (probs.log() - noise.pop(0).t()).argmax(dim=1, keepdim=True)
        return actions, torch.zeros_like(probs).scatter_(1, actions, 1.0)

    return categorical_sample


def their_batch(batch: Transitions, ours: TD) -> tuple[list[Tensor], ...]:
    """A batch as the public code takes it: a list by robot of each part, rewards normalised."""
    reward = (batch.reward.double() - ours.replay.reward_mean) / ours.replay.reward_std
    one_hot = torch.eye(TEAM.num_actions, dtype=DOUBLE)[batch.actions]
    done = batch.terminated.double().unsqueeze(1).expand_as(reward)
    parts = (batch.obs.double(), one_hot, reward, batch.next_obs.double(), done)
    return tuple(list(part.unbind(dim=1)) for part in parts)


def largest_difference(checkout: Path, left_in: str) -> tuple[float, float]:
    """The largest difference of a parameter of the critics, and of the actors."""
    numbers: dict[str, object] = {"td.batch_size": BATCH, "td.replay_capacity": 4 * BATCH}
    if left_in != "policy gradient":
        numbers["td.policy_gradient"] = "sampled"
    config = load_run_config(budget="paper", overrides=numbers)
    ours = TD(TEAM, config.network, config.td, seed=0, device=torch.device("cpu"), dtype=DOUBLE)
    ours.replay.add(random_transitions(4 * BATCH))
    public = PublicCode(checkout, TEAM, config.network, config.td)
    model = public.model
    for module in (model.critic, model.target_critic, *model.policies, *model.target_policies):
        module.double()
    critics = critic_pairs(ours.critic, model.critic)
    critics += critic_pairs(ours.target_critic, model.target_critic)
    actors = actor_pairs(ours.actor, model.policies)
    actors += actor_pairs(ours.target_actor, model.target_policies)
    with torch.no_grad():
        for own, their in critics + actors:
            their.copy_(own)
    undo(model, left_in)
    generator = torch.Generator().manual_seed(0)
    shape = (TEAM.num_robots, TEAM.num_actions, BATCH)
    for _ in range(UPDATES):
        batch = ours.replay.sample(BATCH)
        noises = [action_noise(shape, generator, DOUBLE) for _ in range(2)]
        by_robot = [one for noise in noises for one in noise]
        sys.modules["utils.policies"].categorical_sample = draw_from(by_robot)
        ours._draw = lambda _, left=noises: left.pop(0)
        ours.update(batch)
        public.update(their_batch(batch, ours))

    def largest(pairs: list[tuple[Tensor, Tensor]]) -> float:
        return max(float((own - their).detach().abs().max()) for own, their in pairs)

    return largest(critics), largest(actors)


def main(words: list[str]) -> None:
    """Print the differences."""
    if len(words) != 1:
        sys.exit("usage: python benches/maac_agreement.py PATH, a checkout of MAAC's public code")
    checkout = Path(words[0]).expanduser().resolve()
    try:
        print(f"MAAC's public code: {describe_checkout(checkout)}. {UPDATES} updates.\n")
    except ValueError as error:
        sys.exit(str(error))
    found = {}
    for left_in in ("none", *DIFFERENCES):
        torch.manual_seed(0)
        found[left_in] = largest_difference(checkout, left_in)
    rows = [[name, *(f"{value:.1e}" for value in pair)] for name, pair in found.items()]
    print(table(["difference left in", "critics", "actors"], rows))
    if max(found["none"]) > AGREEMENT:
        sys.exit(f"without the named differences more than {AGREEMENT} is left")


if __name__ == "__main__":
    main(sys.argv[1:])
