"""What a notebook shows: a picture, a replay or a table; and an example that really runs."""

import base64
import io
import json
import re
import sys
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from watched import watched

from innerattn.config import Scenario
from innerattn.envs import BatchEnv
from innerattn.evaluate import Evaluation
from innerattn.experiments.run import FinishedRun
from innerattn.report.notebook import MOST_EPISODES, html_of

NOTEBOOK = Path(__file__).parents[2] / "examples" / "notebooks" / "watch_a_team.ipynb"


def picture(html: str) -> np.ndarray:
    (found,) = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(found))).convert("RGB"))


def replayed(html: str) -> dict[str, Any]:
    (page,) = re.findall(r'srcdoc="(.*?)"', html, flags=re.DOTALL)
    (found,) = re.findall(r'id="data">(.*?)</script>', unescape(page), flags=re.DOTALL)
    return dict(json.loads(found))


def test_a_scenario_shows_a_start_its_team_and_its_tasks() -> None:
    html = Scenario.preset("mixed")._repr_html_()
    assert picture(html).shape[0] == 420
    for words in ("medical_0", "information", "task_2"):
        assert words in html


def test_worlds_show_their_present_state() -> None:
    with BatchEnv("mixed", 3, seed=1) as env:
        env.reset()
        before = picture(env._repr_html_())
        env.step(np.ones((3, 4), np.int64))
        html = env._repr_html_()
    assert "3 worlds, the first of them: episode 0, step 1" in html
    assert (picture(html) != before).any()


def test_a_record_is_replayed_or_counted() -> None:
    record = watched(episodes=MOST_EPISODES + 3)
    found = replayed(record._repr_html_())
    assert found["worlds"]["episodes"] == MOST_EPISODES
    bare = replace(record, steps={})._repr_html_()
    assert "<iframe" not in bare
    assert f">{len(record.rescues)}<" in bare


def test_a_run_and_an_evaluation(runs: list[FinishedRun]) -> None:
    run = runs[0]
    html = run._repr_html_()
    assert f"{run.folder.name} (seed {run.seed})" in html
    assert replayed(html)["runs"][0]["policy"] == run.method
    shown = Evaluation(None, run.scored)._repr_html_()  # type: ignore[arg-type]
    assert replayed(shown)["data"] == replayed(html)["data"]


def test_without_matplotlib_there_is_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert "pip install matplotlib" in Scenario.preset("mixed")._repr_html_()


def test_other_things_have_no_picture() -> None:
    with pytest.raises(TypeError, match="int: has no picture"):
        html_of(1)


def test_the_example_runs_as_it_was_run() -> None:
    cells = json.loads(NOTEBOOK.read_text("utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["outputs"] for cell in code)
    assert not [out for cell in code for out in cell["outputs"] if out["output_type"] == "error"]
    names: dict[str, Any] = {}
    for cell in code:
        exec(compile("".join(cell["source"]), str(NOTEBOOK), "exec"), names)
