"""Seeds as they are written: what is read, and what is refused."""

import pytest

from innerattn.cli.main import main
from innerattn.cli.seeds import parse_seeds


@pytest.mark.parametrize(
    ("text", "seeds"),
    [
        ("3", (3,)),
        ("0..4", (0, 1, 2, 3, 4)),
        ("7..7", (7,)),
        ("0,3,7", (0, 3, 7)),
        ("5, 0..2", (5, 0, 1, 2)),
        ("9223372036854775807", (2**63 - 1,)),
        ("1..1000", tuple(range(1, 1001))),
    ],
)
def test_seeds_are_read(text: str, seeds: tuple[int, ...]) -> None:
    assert parse_seeds(text) == seeds


@pytest.mark.long
@pytest.mark.parametrize(
    "text",
    [
        *("", ",", "0,", "0..", "..3", "0...3", "0-3", "-1", "-1..3", "1.5", "a", "٣"),
        *("4..0", "0,0", "0..3,2", "0..1000", "0..500,501..1001", "0..99999999999999999999"),
    ],
)
def test_what_is_no_list_of_seeds_is_one_line(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["train", f"--seeds={text}"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"innerattn: error: --seeds = {text!r}: ")
    assert "must be" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("seed", ["--seed=0", "--train.seed=0", "--seed=3"])
def test_seed_and_seeds_contradict(seed: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "--seeds", "0..1", seed]) == 2
    out, err = capsys.readouterr()
    number = seed.split("=")[1]
    assert (out, err) == (
        "",
        f"innerattn: error: --seed {number}, --seeds 0..1: must be one of the two\n",
    )


def test_a_seed_out_of_range_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "--seeds", "9223372036854775808"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("innerattn: error: train.seed = 9223372036854775808: must be less than")
