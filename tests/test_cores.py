"""How threads share cores with other programs."""

import os
import subprocess
import sys

import pytest

from innerattn.cores import let_waiting_threads_sleep, usable_cores


def test_there_is_a_core() -> None:
    assert usable_cores() >= 1


def test_what_the_user_set_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_WAIT_POLICY", "ACTIVE")
    let_waiting_threads_sleep()
    assert os.environ["OMP_WAIT_POLICY"] == "ACTIVE"
    monkeypatch.delenv("OMP_WAIT_POLICY")
    let_waiting_threads_sleep()
    assert os.environ["OMP_WAIT_POLICY"] == "PASSIVE"


def test_the_command_says_so_before_torch_is_imported() -> None:
    code = (
        "import os, sys; from innerattn.cli.main import main; assert 'torch' not in sys.modules; "
        "main(['info']); assert os.environ['OMP_WAIT_POLICY'] == 'PASSIVE'"
    )
    clean = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"}
    subprocess.run([sys.executable, "-c", code], env=clean, check=True, capture_output=True)
