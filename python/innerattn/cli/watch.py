"""`innerattn watch`: trainings in the browser while they go on."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from innerattn.cli.options import Command, UsageError
from innerattn.cli.runs import named_run

if TYPE_CHECKING:
    from innerattn.records import Record

SCRIPTS = ("hungarian", "greedy")
SCRIPT_EPISODES = 200


@dataclass(kw_only=True)
class Watch(Command):
    """Watch trainings in a browser on this machine while they go on; Ctrl-C ends it."""

    runs: Annotated[tyro.conf.Positional[list[str]], tyro.conf.arg(metavar="RUN [RUN ...]")]
    """Folders of runs, such as those that --seeds makes."""
    port: int = 0
    """Port of 127.0.0.1; 0: any that is free."""
    episodes: int = 4
    """Episodes of the newest policy to play for each checkpoint."""

    def run(self) -> int:
        """Serve until Ctrl-C.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: no such run, the port is taken, or plotly is not installed.
        """
        self._check()
        from innerattn.experiments.live import read_live
        from innerattn.report.local_server import LocalServer
        from innerattn.report.watch.pages import watch_pages

        folders = [named_run(run) for run in self.runs]
        for folder in folders:
            read_live(folder)
        pages = watch_pages(folders, _scripts_beside(folders[0]), self._play)
        server = LocalServer(pages, self.port)
        greeting = f"Watch at {server.address}\nCtrl-C ends it."
        try:
            server.serve(partial(print, greeting, flush=True))
        except KeyboardInterrupt:
            print()
        return 0

    def _check(self) -> None:
        if not self.runs:
            raise UsageError("RUN: at least one run is needed")
        if not 0 <= self.port < 65536:
            raise UsageError(f"--port {self.port}: must be 0 to 65,535")
        if not 1 <= self.episodes <= 100:
            raise UsageError(f"--episodes {self.episodes}: must be 1 to 100")

    def _play(self, folder: Path) -> Record:
        from innerattn.evaluate import load_trained, run_episodes
        from innerattn.records import FIELDS
        from innerattn.train.build import torch_threads

        config, policy = load_trained(folder)
        worlds, seed = config.scenario, config.evaluate.seed
        with torch_threads(1):  # training has the others
            return run_episodes(policy, worlds, self.episodes, seed, record=FIELDS, num_threads=1)


def _scripts_beside(folder: Path) -> dict[str, float]:
    """Rescues per episode of scripts in the worlds that a run trains in."""
    from innerattn.evaluate.training_score import training_rescues
    from innerattn.records.run_folder import read_config

    config = read_config(folder)
    return {name: training_rescues(config, name, SCRIPT_EPISODES, 1) for name in SCRIPTS}
