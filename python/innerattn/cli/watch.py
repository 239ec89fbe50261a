"""`innerattn watch`: trainings, or a study, in the browser while they go on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from innerattn.cli.options import Command, UsageError
from innerattn.cli.runs import existing_run, runs_within
from innerattn.errors import InnerattnError, RunError

if TYPE_CHECKING:
    from innerattn.records import Record
    from innerattn.report.local_server import Answer

SCRIPTS = ("hungarian", "greedy")
SCRIPT_EPISODES = 200


@dataclass(kw_only=True)
class Watch(Command):
    """Watch trainings or a study in a browser on this machine while they go on; Ctrl-C ends it."""

    runs: Annotated[tyro.conf.Positional[list[str]], tyro.conf.arg(metavar="RUN [RUN ...]")]
    """Folders of runs, such as those that --seeds makes, or a folder that holds runs, with those
    that begin later; or the folder of one study."""
    port: int = 0
    """Port of 127.0.0.1; 0: any that is free."""
    episodes: int = 4
    """Episodes of the newest policy to play for each checkpoint."""

    def run(self) -> int:
        """Serve until Ctrl-C.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: no such run, or the port is taken.
        """
        self._check()
        from innerattn.report.local_server import LocalServer

        server = LocalServer(self._pages(), self.port)
        greeting = f"Watch at {server.address}\nCtrl-C ends it."
        try:
            server.serve(partial(print, greeting, flush=True))
        except KeyboardInterrupt:
            print()
        return 0

    def _pages(self) -> Mapping[str, Callable[[], Answer]]:
        """The pages of a study, or of runs."""
        if len(self.runs) == 1 and (Path(self.runs[0]) / "study.toml").is_file():
            from innerattn.report.watch.study import study_pages
            from innerattn.studies.folder import open_study

            return study_pages(open_study(Path(self.runs[0])))
        from innerattn.report.watch.pages import watch_pages

        folders = self._folders()
        return watch_pages(folders, _scripts_beside(folders), self._play, self._there)

    def _check(self) -> None:
        if not self.runs:
            raise UsageError("RUN: at least one run is needed")
        if not 0 <= self.port < 65536:
            raise UsageError(f"--port {self.port}: must be 0 to 65,535")
        if not 1 <= self.episodes <= 100:
            raise UsageError(f"--episodes {self.episodes}: must be 1 to 100")

    def _folders(self) -> list[Path]:
        """The runs that were named, and those in folders that were; each once."""
        from innerattn.experiments.live import read_live

        found: dict[Path, Path] = {}
        for name in self.runs:
            folder = existing_run(name)
            for run in runs_within(folder) or [folder]:
                try:
                    read_live(run)
                except InnerattnError as error:
                    if run == folder:
                        raise
                    print(f"innerattn: left out: {error}", file=sys.stderr)
                else:
                    found.setdefault(run.resolve(), run)
        if not found:
            raise RunError(f"{', '.join(self.runs)}: no run in it can be read")
        return list(found.values())

    def _there(self) -> list[Path]:
        """The runs in the folders that were named, as they are now."""
        return [run for name in self.runs for run in runs_within(existing_run(name))]

    def _play(self, folder: Path) -> Record:
        from innerattn.evaluate import load_trained, run_episodes
        from innerattn.records import FIELDS
        from innerattn.train.build import torch_threads

        config, policy = load_trained(folder)
        worlds, seed = config.scenario, config.evaluate.seed
        with torch_threads(1):  # training has the others
            return run_episodes(policy, worlds, self.episodes, seed, record=FIELDS, num_threads=1)


def _scripts_beside(folders: Sequence[Path]) -> dict[str, float]:
    """Rescues per episode of scripts in the worlds of training; none where these are several."""
    from innerattn.evaluate.training_score import training_rescues
    from innerattn.records.run_folder import read_config

    configs = [read_config(folder) for folder in folders]
    same = all(one.training_scenario == configs[0].training_scenario for one in configs)
    if not same or any(one.family is not None for one in configs):
        return {}
    return {name: training_rescues(configs[0], name, SCRIPT_EPISODES, 1) for name in SCRIPTS}
