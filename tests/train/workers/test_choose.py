"""How many workers a training has where nobody says it."""

from collections.abc import Callable

import pytest

from innerattn.config import RunConfig, load_run_config
from innerattn.train.workers import choose
from innerattn.train.workers.choose import with_number_of_workers


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch) -> Callable[..., int | str]:
    """The number of workers by cores, method and other values."""

    def of(cores: int, method: str = "ppo-inner", budget: str = "fast", **values: object) -> object:
        monkeypatch.setattr(choose, "usable_cores", lambda: cores)
        given = {"train.workers": "auto", "train.method": method, **values}
        config = with_number_of_workers(load_run_config("mixed", budget=budget, overrides=given))
        return config.train.workers

    return of


def test_as_many_as_there_are_cores_for_and_enough_rows(chosen: Callable[..., int]) -> None:
    assert [chosen(cores) for cores in (1, 2, 4, 16)] == [1, 2, 4, 4]  # 512 rows an update
    assert [chosen(cores, "td-inner") for cores in (1, 2, 4, 16)] == [1, 2, 4, 8]
    assert [chosen(cores, "team-inner") for cores in (1, 2, 4, 16)] == [1, 2, 4, 8]  # 1,024 worlds
    assert chosen(16, "team-inner", **{"team.teams": 12, "train.num_envs": 1_152}) == 6


def test_shares_are_equal(chosen: Callable[..., int]) -> None:
    assert chosen(3) == 2  # 1,024 worlds
    assert chosen(4, **{"train.num_envs": 999}) == 3
    assert chosen(4, **{"train.num_envs": 997}) == 1


@pytest.mark.parametrize(
    "values",
    [
        {"train.env_steps": 100_000},
        {"train.threads": 1},
        {"train.threads": 2},
        {"train.device": "cuda"},
    ],
)
def test_one_where_more_do_not_pay_or_are_not_asked_for(
    chosen: Callable[..., int], values: dict[str, object]
) -> None:
    assert chosen(4, **values) == 1


def test_a_number_stays(chosen: Callable[..., int]) -> None:
    assert chosen(2, **{"train.workers": 8}) == 8
    config = RunConfig()
    assert with_number_of_workers(config) is config
