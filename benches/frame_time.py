"""Script time of a frame of the replay page and of the page to play with, in headless Chromium.

`python benches/frame_time.py` prints medians and longest times over a few hundred frames, with four
robots (a team of the zoo) and with sixteen (a team that has hardly trained) and all their arrows.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from page import machine, table
from playwright.sync_api import Page, sync_playwright

from innerattn.cli.main import main

FRAMES = 300
SIXTEEN = (
    *("--preset", "mixed-16", "--method", "ppo-inner", "--quiet"),
    *("--train.env-steps", "2000", "--evaluate.score-episodes", "20", "--evaluate.episodes", "20"),
    *("--evaluate.long-episodes", "2"),
)


@contextmanager
def played(team: str) -> Iterator[str]:
    """The address of `innerattn play` for a team."""
    command = [sys.executable, "-m", "innerattn", "play", team, "--seed", "5"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            found = re.search(r"http\S+", process.stdout.readline())
            assert found is not None, "innerattn play has not named its address"
            yield found.group(0)
        finally:
            process.terminate()


def frame_times(page: Page, address: str, app: str) -> list[float]:
    """Milliseconds of script for each of `FRAMES` frames or more, all robots' arrows drawn."""
    page.goto(address)
    while not page.evaluate(f"Boolean(window.{app})"):  # the page itself evaluates no text
        page.wait_for_timeout(20)
    page.get_by_label("arrows of all robots").check()
    page.get_by_label("weight at least").fill("0")
    if app == "replay":
        page.get_by_role("button", name="Play", exact=True).click()
    page.evaluate(f"{app}.times.length = 0")
    while page.evaluate(f"{app}.times.length") < FRAMES:
        if app == "replay" and not page.evaluate("replay.playing"):
            page.get_by_role("button", name="Next episode").click()
            page.get_by_role("button", name="Play", exact=True).click()
        page.wait_for_timeout(100)
    return list(page.evaluate(f"{app}.times"))


def measure() -> None:
    """Print the table."""
    path = shutil.which("chromium-headless-shell") or shutil.which("chromium")
    rows = []
    with TemporaryDirectory() as work, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        sixteen = Path(work) / "sixteen"
        main(["train", *SIXTEEN, "--run-dir", str(sixteen)])
        for robots, team in ((4, "zoo:mixed"), (16, str(sixteen))):
            file = Path(work) / f"{robots}.html"
            main(["replay", team, "--episodes", "20", "-o", str(file)])
            times = {"replay": frame_times(page, file.as_uri(), "replay")}
            with played(team) as address:
                times["play"] = frame_times(page, address, "play")
            rows += [
                [name, str(robots), str(len(one)), f"{median(one):.1f}", f"{max(one):.1f}"]
                for name, one in times.items()
            ]
        browser.close()
    print(machine())
    print(table(["page", "robots", "frames", "median [ms]", "longest [ms]"], rows))


if __name__ == "__main__":
    measure()
