"""The learner of orders: its network beside numpy, and its gradient beside plain code."""

from pathlib import Path

import numpy as np
import pytest
import torch

from innerattn import _core
from innerattn.config.instances.draw import InstanceSort, draw_instance
from innerattn.errors import ConfigError, RunError
from innerattn.learn import orders as learner
from innerattn.nn.orders import OrderNetwork
from innerattn.policies.orders.learnt import learnt_order, read_network
from innerattn.policies.orders.network import PlainOrderNetwork
from innerattn.train.orders import OrderTraining, begun, train_orders
from innerattn.train.weights import write_weights

SORT = InstanceSort(skills=3, robots_per_skill=2, tasks=(3, 6))


def network(width: int = 8) -> OrderNetwork:
    torch.manual_seed(3)
    made = OrderNetwork(width)
    with torch.no_grad():
        for parameter in made.parameters():
            parameter += 0.1 * torch.randn(parameter.shape)
    return made


def test_numpy_scores_as_torch_does() -> None:
    made = network(16)
    plain = PlainOrderNetwork({name: t.numpy() for name, t in made.state_dict().items()})
    draws = torch.Generator().manual_seed(0)
    features = 4 * torch.randn(5, 7, _core.ORDER_FEATURES, generator=draws)
    relations = torch.rand(5, 7, 7, 2, generator=draws)
    is_open = torch.rand(5, 7, generator=draws) < 0.6
    is_open[0] = True
    found = plain.scores(features.numpy(), relations.numpy(), is_open.numpy())
    expected = made(features, relations, is_open).detach().numpy()
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-5)


def test_scores_depend_on_open_tasks_alone_and_not_on_their_order() -> None:
    made = network()
    draws = torch.Generator().manual_seed(0)
    features = torch.randn(1, 6, _core.ORDER_FEATURES, generator=draws)
    relations = torch.rand(1, 6, 6, 2, generator=draws)
    is_open = torch.tensor([[True, True, False, True, False, True]])
    scores = made(features, relations, is_open)
    features[:, ~is_open[0]] = 9.0
    relations[:, :, ~is_open[0]] = 9.0
    torch.testing.assert_close(made(features, relations, is_open), scores)
    turned = torch.tensor([5, 3, 1, 0, 2, 4])
    found = made(features[:, turned], relations[:, turned][:, :, turned], is_open[:, turned])
    torch.testing.assert_close(found, scores[:, turned])


def test_a_step_is_that_of_plain_reinforce() -> None:
    draws = np.random.default_rng(0)
    instances = [draw_instance(SORT, draws) for _ in range(3)]
    fast, plain = network(), network()
    orders, relations, is_open = begun(instances, 4)
    drawn = learner.draw_orders(fast, orders, relations, is_open, torch.Generator().manual_seed(1))
    rates = torch.optim.SGD(fast.parameters(), lr=0.5), torch.optim.SGD(plain.parameters(), lr=0.5)
    learner.reinforce(fast, rates[0], drawn, relations, 4)

    makespans = drawn.makespans.reshape(3, 4)
    gains = makespans.mean(axis=1, keepdims=True) - makespans
    gains /= np.sqrt((gains**2).mean())
    total, count = torch.zeros(()), 0
    for row in range(12):
        for step, task in enumerate(drawn.tasks[:, row].tolist()):
            if task >= 0:
                known = drawn.features[step, row], relations[row], drawn.is_open[step, row]
                scores = plain(*(table[None] for table in known))[0]
                chances = torch.softmax(scores[drawn.is_open[step, row]], 0)
                place = int(drawn.is_open[step, row, :task].sum())
                total = total - float(gains.flat[row]) * chances[place].log()
                count += 1
    (total / count).backward()
    torch.nn.utils.clip_grad_norm_(plain.parameters(), learner.MOST_NORM)
    rates[1].step()
    for found, expected in zip(fast.parameters(), plain.parameters(), strict=True):
        torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-6)


def test_training_shortens_orders_and_writes_a_policy_that_numpy_reads(tmp_path: Path) -> None:
    training = OrderTraining(
        out=tmp_path / "mine.safetensors",
        sort=InstanceSort(skills=2, robots_per_skill=1, tasks=(8, 8)),
        updates=40,
        instances=8,
        samples=8,
        learning_rate=5e-3,
        width=16,
        log_every=1,
    )
    told: list[float] = []
    made = train_orders(training, lambda measured: told.append(measured.makespan))
    assert sum(told[-5:]) / 5 < 0.99 * sum(told[:2]) / 2
    first = training.out.read_bytes()
    train_orders(training)
    assert training.out.read_bytes() == first
    instance = draw_instance(training.sort, np.random.default_rng(5))
    orders, relations, is_open = begun([instance], 1)
    learner.draw_orders(made, orders, relations, is_open, None)
    assert learnt_order(instance, read_network(training.out)) == orders.orders()[0]


def test_more_orders_are_never_longer() -> None:
    made = network()
    plain = PlainOrderNetwork({name: t.numpy() for name, t in made.state_dict().items()})
    draws = np.random.default_rng(2)
    for _ in range(10):
        instance = draw_instance(SORT, draws)
        orders = [learnt_order(instance, plain, samples, seed=4) for samples in (1, 16)]
        compiled = instance.compiled()
        one, more = (compiled.simulate(compiled.schedule(order))[2] for order in orders)
        assert more <= one


def test_wrong_values_and_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    for changed, told in (
        ({"updates": 0}, "updates = 0: must be 1 to"),
        ({"samples": 1}, "samples = 1: must be 2 to"),
        ({"width": 10}, "width = 10: must be a multiple of 4"),
    ):
        with pytest.raises(ConfigError, match=told):
            OrderTraining(out=path, **changed)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="tasks: the most = 3: must be 5 to 500"):
        InstanceSort(tasks=(5, 3))
    with pytest.raises(ConfigError, match="skills times robots_per_skill = 70: must be 1 to 64"):
        InstanceSort(skills=7, robots_per_skill=10)
    with pytest.raises(RunError, match=r"policy\.safetensors"):
        read_network(path)
    path.write_bytes(b"nothing of the sort")
    with pytest.raises(RunError, match=r"policy\.safetensors: no policy for instances"):
        read_network(path)
    tensors = network().state_dict()
    for name, value, told in (
        ("score.weight", None, "score.weight: is missing or unknown"),
        ("other.weight", torch.zeros(1), "other.weight: is missing or unknown"),
        ("last.bias", torch.zeros(9), r"last.bias: has shape \(9,\): must have \(8,\)"),
    ):
        changed_tensors = {k: t for k, t in tensors.items() if k != name}
        if value is not None:
            changed_tensors[name] = value
        write_weights(path, changed_tensors)
        with pytest.raises(RunError, match=told):
            read_network(path)
