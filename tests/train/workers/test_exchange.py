"""What workers exchange: all values by rank, equal to the bit, whatever the timing."""

import threading
import time

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from worker_threads import Together, exchanges

from innerattn.learn import workers
from innerattn.train.workers import exchange
from innerattn.train.workers.exchange import WorkerEndedError

pytestmark = pytest.mark.timeout(60)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_everybody_gets_the_values_of_all(together: Together, count: int) -> None:
    def work(rank: int) -> list[torch.Tensor]:
        source = torch.Generator().manual_seed(rank)
        pause = np.random.default_rng(rank)
        found = []
        for length in (1, 7, 1000, 3, 100_000):
            time.sleep(pause.uniform(0, 0.003))
            own = torch.randn(length, generator=source)
            found.append(workers.gathered(own).clone())
        return found

    results = together(count, work)
    for call in range(5):
        for rank in range(count):
            assert torch.equal(results[rank][call], results[0][call])
    sources = [torch.Generator().manual_seed(rank) for rank in range(count)]
    for call, length in enumerate((1, 7, 1000, 3, 100_000)):
        own = torch.stack([torch.randn(length, generator=source) for source in sources])
        assert torch.equal(results[0][call], own)


def test_values_longer_than_a_slot_go_in_parts(
    together: Together, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exchange, "SLOT_BYTES", 1024)
    found = together(2, lambda rank: workers.gathered(torch.arange(1000) + rank).clone())
    assert torch.equal(found[0], torch.stack([torch.arange(1000), torch.arange(1000) + 1]))
    assert torch.equal(found[0], found[1])


def test_a_result_stays_until_the_exchange_after_the_next(together: Together) -> None:
    def work(rank: int) -> bool:
        first = workers.gathered(torch.full((5,), float(rank)))
        workers.gathered(torch.full((5,), 9.0))
        return first.tolist() == [[0.0] * 5, [1.0] * 5]

    assert together(2, work) == [True, True]


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6, width=32), min_size=4, max_size=4))
def test_sums_means_and_largest(values: list[float]) -> None:
    everybody = exchanges(4)
    found: list[object] = [None] * 4

    def one(each: exchange.Exchange) -> None:
        rows = each.gather(torch.tensor([values[each.rank]], dtype=torch.float32)).clone()
        found[each.rank] = rows

    threads = [threading.Thread(target=one, args=(each,)) for each in everybody]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=30)
    for each in everybody:
        each.close()
    for rows in found:
        assert isinstance(rows, torch.Tensor)
        assert rows[:, 0].tolist() == [float(np.float32(value)) for value in values]


def test_statistics_of_all(together: Together) -> None:
    def work(rank: int) -> tuple[float, float, float, float]:
        own = torch.tensor(float(rank + 1))
        numbers = workers.total(own), workers.mean(own), workers.largest(own), workers.of_first(own)
        return tuple(map(float, numbers))

    assert together(4, work) == [(10.0, 2.5, 4.0, 1.0)] * 4


def test_an_error_of_one_reaches_the_first_with_its_words(together: Together) -> None:
    def work(rank: int) -> None:
        if rank == 2:
            workers._present.here.exchange.fail("it is cold")
            raise RuntimeError("it is cold")
        workers.gathered(torch.zeros(1))

    first, second, third = together(3, work)
    assert isinstance(first, WorkerEndedError)
    assert first.rank == 2
    assert str(first) == "worker 2: it is cold"
    assert isinstance(second, WorkerEndedError)  # the first one is gone then
    assert isinstance(third, RuntimeError)


@pytest.mark.parametrize("gone", [0, 1, 2])
def test_nobody_waits_for_a_worker_that_is_gone(together: Together, gone: int) -> None:
    def work(rank: int) -> None:
        if rank != gone:
            workers.gathered(torch.zeros(1))

    found = together(3, work)
    assert all(isinstance(found[rank], WorkerEndedError) for rank in range(3) if rank != gone)


def test_workers_that_are_out_of_step_are_told(together: Together) -> None:
    found = together(2, lambda rank: workers.gathered(torch.zeros(1 + rank)))
    assert all(isinstance(one, RuntimeError) for one in found)
    assert "out of step" in str(found[0])


def test_alone_nothing_is_exchanged() -> None:
    values = torch.tensor([1.0, 2.0])
    for same in (workers.total, workers.mean, workers.largest, workers.of_first):
        assert same(values) is values
    assert workers.gathered(values).tolist() == [[1.0, 2.0]]
    assert (workers.rank(), workers.count(), workers.share_of(7)) == (0, 1, 7)
