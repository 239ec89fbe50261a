"""`innerattn replay`: episodes of policies, or a schedule, to watch as a page or a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from innerattn.cli.options import Command, UsageError, check_seed, check_target
from innerattn.cli.planners import check_planner, limit_ms
from innerattn.cli.runs import named_policy
from innerattn.config import EvaluateConfig, Scenario
from innerattn.config.files import write_whole
from innerattn.errors import RunError
from innerattn.policies import SCRIPTS
from innerattn.zoo import in_zoo

if TYPE_CHECKING:
    from innerattn.config.instances import Instance
    from innerattn.records import Record

SUFFIXES = (".html", ".gif", ".mp4")
_OF_WORLDS = ("episodes", "scenario", "episode", "robot", "attention", "moments")
"""Options that have no meaning for an instance."""


@dataclass(kw_only=True)
class Replay(Command):
    """Watch episodes in a browser, with attention drawn as arrows.

    Recorded episodes of a run are shown as they are. Scripts play in the worlds of the first run.
    With --episodes, --seed, --scenario or --instance all policies play anew, in the same worlds.
    """

    policies: Annotated[
        tyro.conf.Positional[list[str]], tyro.conf.arg(metavar="RUN|POLICY|FILE ...")
    ]
    """Runs, evaluation/episodes.parquet files, or random, greedy, hungarian, planner, oracle,
    greedy-seen; up to four, shown side by side. With --instance of points: planner (if none is
    named), greedy or random."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("replay.html")
    """File to write: .html is a page, .gif or .mp4 a moving picture of one episode."""
    episodes: int | None = None
    """Episodes to play; None: those that were recorded, or 20."""
    seed: int | None = None
    """Seed of the worlds to play in; None: as the first run says, or 12345. With --instance of
    points, of the planner; None: 0."""
    scenario: Path | None = None
    """TOML file with the scenario to play in; None: that of the first run, or mixed."""
    episode: int | None = None
    """Number of the episode in a moving picture; None: that with most handoffs and rescues."""
    robot: str | None = None
    """Robot whose attention a moving picture shows, or all; None: the first that hands over."""
    attention: Literal["critic", "actor"] | None = None
    """Whose attention a moving picture shows; None: of the critic, if it has any."""
    moments: Path | None = None
    """TOML file with moments that the page lists, with a text and a link for each."""
    instance: str | None = None
    """Show this instance instead: a JSON file, or ral or standard, and a name, as in ral:ral_03;
    without a name the first. Points are shown with a schedule, worlds with an episode."""
    time_limit_ms: int | None = None
    """How long planner and guided search for the instance [ms]; None: 1000."""
    engine: Literal["none", "discs", "rapier"] | None = None
    """With --instance of points: show how robots with bodies carry out the schedule in a world with
    these contacts, or none; None: the schedule itself."""

    def run(self) -> int:
        """Read or play, then write the file.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: no such run or policy, nothing recorded, or wrong options.
            OSError: the file cannot be written.
        """
        world: Scenario | None = None
        if self.instance is not None:
            from innerattn.config.instances import WorldInstance, named_instance

            instance = named_instance(self.instance)
            if not isinstance(instance, WorldInstance):
                return self._of_instance(instance)
            if self.scenario is not None:
                raise UsageError("--scenario: has no meaning with --instance")
            world = instance.scenario
        self._check()
        self.policies = [named_policy(one, SCRIPTS) for one in self.policies]
        names = _names(self.policies)
        if world is not None:
            self.episodes = 1 if self.episodes is None else self.episodes
        anew = world is not None or self._plays_anew()
        records = self._played(world) if anew else self._recorded()
        if self.output.suffix == ".html":
            from innerattn.report.replay import read_moments, replay_page

            moments = read_moments(self.moments, records, names) if self.moments else []
            page = replay_page(records, names, moments)
            write_whole(self.output, page.encode(errors="backslashreplace"))
        else:
            from innerattn.report.replay.picture import moving_picture

            data = moving_picture(
                records,
                names,
                self.output.suffix,
                episode=self.episode,
                robot=self.robot,
                attention=self.attention,
            )
            write_whole(self.output, data)
        size = self.output.stat().st_size / 1e6
        count = records[0].num_episodes
        noun = "episode" if count == 1 else "episodes"
        print(f"{self.output}: {count} {noun}, {size:.1f} MB")
        return 0

    def _of_instance(self, instance: Instance) -> int:
        """Plan for an instance and write the page of the schedule."""
        from innerattn.policies.scripted.planner import schedule_by
        from innerattn.report.schedule import schedule_page
        from innerattn.report.tables.instances import schedule_line

        if len(self.policies) > 1:
            raise UsageError(f"{len(self.policies)} policies: with --instance must be one")
        policy = self.policies[0] if self.policies else "planner"
        check_planner(policy, "--instance")
        for name in _OF_WORLDS:
            if getattr(self, name) is not None:
                raise UsageError(f"--{name}: has no meaning with --instance")
        if self.output.suffix != ".html":
            raise UsageError(f"-o {self.output}: with --instance must end in .html")
        limit = limit_ms(self.time_limit_ms)
        check_seed(self.seed)
        check_target(self.output)
        schedule = schedule_by(policy, instance, limit / 1000, self.seed or 0)
        line = schedule_line(instance, schedule)
        if self.engine is None:
            page = schedule_page(instance, schedule, policy)
        else:
            from innerattn.evaluate.played_schedule import record_schedule
            from innerattn.report.replay import replay_page

            record = record_schedule(instance, schedule, self.engine)
            page = replay_page([record], [policy])
            makespan = record.scenario.episode_steps * record.scenario.dt_s
            line = f"{line}; with {self.engine} {makespan:.2f}"
        write_whole(self.output, page.encode(errors="backslashreplace"))
        print(f"{self.output}: {instance.name}, {policy}, {line}")
        return 0

    def _check(self) -> None:
        if self.time_limit_ms is not None:
            needs = "needs --instance" if self.instance is None else "has no meaning in worlds"
            raise UsageError(f"--time-limit-ms: {needs}")
        if self.engine is not None:
            needs = "needs --instance" if self.instance is None else "has no meaning in worlds"
            raise UsageError(f"--engine: {needs}")
        if not 1 <= len(self.policies) <= 4:
            raise UsageError(f"{len(self.policies)} policies: must be 1 to 4 of RUN|POLICY|FILE")
        if self.output.suffix not in SUFFIXES:
            raise UsageError(f"-o {self.output}: must end in one of {', '.join(SUFFIXES)}")
        chosen = self.episode, self.robot, self.attention
        if self.output.suffix == ".html" and chosen != (None, None, None):
            raise UsageError(
                "--episode, --robot, --attention: are for .gif and .mp4; a page has all of them"
            )
        if self.output.suffix != ".html" and self.moments is not None:
            raise UsageError(f"--moments: needs a page, not {self.output}")
        check_seed(self.seed)
        check_target(self.output)

    def _plays_anew(self) -> bool:
        given = (self.episodes, self.seed, self.scenario)
        unrecorded = [one in SCRIPTS or in_zoo(one) for one in self.policies]
        return given != (None, None, None) or all(unrecorded)

    def _recorded(self) -> list[Record]:
        """What was recorded; scripts play in the same worlds."""
        found = {one: recorded(one) for one in self.policies if one not in SCRIPTS}
        model = next(iter(found.values()))
        return [
            found[one] if one in found else _play(one, model.scenario, model.num_episodes, model)
            for one in self.policies
        ]

    def _played(self, world: Scenario | None = None) -> list[Record]:
        """New episodes; ``world`` is what they are in, if it is fixed."""
        from innerattn.records.run_folder import read_config

        runs = [one for one in self.policies if one not in SCRIPTS]
        for one in runs:
            if Path(one).is_file():
                raise UsageError(f"{one}: holds records, which cannot play; name the run's folder")
        config = read_config(runs[0]) if runs else None
        settings = config.evaluate if config else EvaluateConfig()
        if world is not None:
            scenario = world
        elif self.scenario is not None:
            scenario = Scenario.from_toml(self.scenario)
        else:
            scenario = config.scenario if config else Scenario.preset("mixed")
        if self.seed is not None:
            settings = settings.replace(seed=self.seed)
        episodes = 20 if self.episodes is None else self.episodes
        if episodes < 1 or episodes > 1000:
            raise UsageError(f"--episodes {episodes}: must be 1 to 1000")
        return [_play(one, scenario, episodes, settings.seed) for one in self.policies]


def write_replay(run: Path) -> Path:
    """Write ``replay.html`` of a run's recorded episodes into its folder, and give its path.

    Raises:
        RunError: no episode was recorded step by step.
        OSError: the file cannot be written.
    """
    from innerattn.report.replay import replay_page

    path = run / "replay.html"
    write_whole(
        path,
        replay_page([recorded(str(run))], _names([str(run)])).encode(errors="backslashreplace"),
    )
    return path


def recorded(name: str) -> Record:
    """The episodes that an evaluation recorded step by step.

    Args:
        name: a run's folder, a folder of records, or the file ``episodes.parquet`` in one.

    Raises:
        RunError: there are none, or they cannot be read.
    """
    from innerattn.records import read_records

    path = Path(name)
    if path.is_file():
        if path.name != "episodes.parquet":
            raise RunError(
                f"{path}: must be named episodes.parquet, with rescues.parquet beside it"
            )
        folder = path.parent
    else:
        folder = path if (path / "episodes.parquet").is_file() else path / "evaluation"
    if not (folder / "episodes.parquet").is_file():
        raise RunError(
            f"{path}: holds no recorded episodes (evaluation/episodes.parquet); "
            "--episodes N plays some"
        )
    for record in read_records(folder):
        if "positions" in record.steps:
            return record
    raise RunError(f"{folder}: no episode was recorded step by step; --episodes N plays some")


def _play(name: str, scenario: Scenario, episodes: int, worlds: Record | int) -> Record:
    """Episodes of a script or a run, in the worlds of a record or of a seed."""
    from innerattn.evaluate import run_episodes, scripted_policy
    from innerattn.records import FIELDS

    seed, first = (worlds, 0) if isinstance(worlds, int) else (worlds.seed, worlds.first_episode)
    if name in SCRIPTS:
        policy = scripted_policy(name, scenario, seed)
    else:
        from innerattn.evaluate import load_trained  # with torch, which scripts do without

        policy = load_trained(name, scenario)[1]
    return run_episodes(policy, scenario, episodes, seed, first_episode=first, record=FIELDS)


def _names(policies: Sequence[str]) -> list[str]:
    """What to call each; the name of a folder, or the whole path where two are alike."""
    short = []
    for one in policies:
        path = Path(one).resolve()
        folder = path.parent if path.is_file() else path
        folder = folder.parent if folder.name == "evaluation" else folder
        short.append(one if one in SCRIPTS else folder.name)
    return [a if short.count(a) == 1 else b for a, b in zip(short, policies, strict=True)]
