"""One update by each learner, timed in turn in this process.

`python benches/learner_update.py BATCH THREADS [CHECKOUT]` prints milliseconds by name as JSON.
`compare_learner.py` runs it and says what the names mean.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import numpy as np
import torch
from maac_learner import PublicCode
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from innerattn.config import NetworkConfig, TDConfig, load_run_config
from innerattn.learn import TD, Team, Transitions
from innerattn.train.matmul_backend import chosen_matmul_backend, onednn

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "learn"))
from reference import PlainTD

TEAM = Team(num_robots=4, obs_width=44, num_actions=5)
NUM_ENVS = 64
REPLAY = 200_000
REPEATS = 25


def random_transitions(count: int) -> Transitions:
    shape = (count, TEAM.num_robots)
    return Transitions(
        torch.randn(*shape, TEAM.obs_width),
        torch.randint(TEAM.num_actions, shape),
        torch.randn(shape),
        torch.randn(*shape, TEAM.obs_width),
        torch.zeros(count, dtype=torch.bool),
    )


def draw(log_prob: list[Tensor]) -> Tensor:
    return torch.cat([torch.multinomial(x.detach().exp(), 1) for x in log_prob], dim=1)


def median_ms(actions: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Medians over calls in turn, so that a busy machine burdens all alike."""
    times: dict[str, list[float]] = {name: [] for name in actions}
    for repeat in range(-2, repeats):  # the first two warm up
        for name, action in actions.items():
            start = time.perf_counter()
            action()
            if repeat >= 0:
                times[name].append(1e3 * (time.perf_counter() - start))
    return {name: statistics.median(taken) for name, taken in times.items()}


def multiplied_by(
    library: Callable[[], AbstractContextManager[object]], action: Callable[[], object]
) -> Callable[[], object]:
    """An action for which a library multiplies matrices."""

    def act() -> object:
        with library():
            return action()

    return act


def products(batch: int) -> Callable[[], Tensor]:
    """The product that an update has most of: layers of width 128 of four robots."""
    weights, inputs = torch.randn(4, 128, 128), torch.randn(4, 128, batch)
    return lambda: torch.bmm(weights, inputs)


def build(
    network: NetworkConfig, td: TDConfig, checkout: Path | None
) -> tuple[TD, TD, PublicCode | None]:
    """The eager and the compiled learner, and the public code, with full replay memories.

    Raises:
        ValueError: The public code's networks have another size.
    """
    public = PublicCode(checkout, TEAM, network, td) if checkout else None
    eager, compiled = (TD(TEAM, network, td, seed=0, device=torch.device("cpu")) for _ in range(2))
    ours = sum(one.numel() for net in (eager.actor, eager.critic) for one in net.parameters())
    if public and public.parameters != ours:
        raise ValueError(f"the public code has {public.parameters} parameters, must have {ours}")
    compiled.replay = eager.replay
    compiled.compile()
    for _ in range(10):
        some = random_transitions(td.replay_capacity // 10)
        eager.replay.add(some)
        if public:
            public.add(some)
    return eager, compiled, public


def measure(
    batch: int, network: NetworkConfig, td: TDConfig, checkout: Path | None, repeats: int
) -> dict[str, float]:
    """Milliseconds by name: updates of one batch, draws of a batch, actions, matrix products.

    Ours multiply as `innerattn train` does, the others by PyTorch's default. Where the two are
    different libraries, the public code is measured with both.
    """
    with chosen_matmul_backend("auto") as chosen:
        own = onednn if chosen.startswith("onednn") else nullcontext
    eager, compiled, public = build(network, td, checkout)
    plain = PlainTD(eager.state(), network, td)
    mean, std = eager.replay.reward_mean.float(), eager.replay.reward_std.float()
    drawn, obs = eager.replay.sample(batch), random_transitions(NUM_ENVS).obs
    actions: dict[str, Callable[[], object]] = {}
    if public:
        theirs = public.sample(batch)
        actions["public code"] = lambda: public.update(theirs)
        actions["draw, public code"] = lambda: public.sample(batch)
        if own is onednn:
            actions["public code, oneDNN"] = multiplied_by(own, actions["public code"])
    actions |= {
        "stand-in": lambda: plain.update(drawn, mean, std, draw),
        "eager": multiplied_by(own, lambda: eager.update(drawn)),
        "compiled": multiplied_by(own, lambda: compiled.update(drawn)),
        "products": multiplied_by(own, products(batch)),
        "draw, ours": lambda: eager.replay.sample(batch),
        "act": multiplied_by(own, lambda: eager.act(obs)),
    }
    with FlopCounterMode(display=False) as counter:
        eager.update(drawn)
    taken = median_ms(actions, repeats)
    flops = 2 * 4 * 128 * 128 * batch  # of the product that was timed
    return taken | {"products": taken["products"] * counter.get_total_flops() / flops}


def main(words: list[str]) -> None:
    """Measure and print."""
    batch, threads = int(words[0]), int(words[1])
    checkout = Path(words[2]) if len(words) > 2 else None
    torch.set_num_threads(threads)
    torch.manual_seed(0)
    np.random.seed(0)
    sizes = {"td.batch_size": batch, "td.replay_capacity": REPLAY}
    config = load_run_config(budget="paper", overrides=sizes)
    print(json.dumps(measure(batch, config.network, config.td, checkout, REPEATS)))


if __name__ == "__main__":
    main(sys.argv[1:])
