"""`python -m robot run EXPORT` drives a team; `python -m robot table EXPORT` measures links."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from innerattn.config.files import write_whole
from innerattn.errors import InnerattnError
from innerattn.policies import Exported
from robot.hardware import Drive, Outcome, drive, drive_directly
from robot.link import LinkSettings

LATENCIES_MS = (0.0, 50.0, 100.0)
LOSSES = (0.0, 0.1, 0.3)


def main() -> int:
    """Run the command; its exit code."""
    arguments = _parser().parse_args()
    settings = Drive(
        export=arguments.export,
        episodes=arguments.episodes,
        episode_steps=arguments.episode_steps,
        scale=arguments.time_scale,
        seed=arguments.seed,
        backend=arguments.backend,
    )
    skew_s = arguments.skew_ms / 1000
    try:
        if arguments.command == "run":
            link = LinkSettings(arguments.latency_ms / 1000, arguments.loss, skew_s)
            _run(settings, link)
        else:
            _table(settings, skew_s, arguments.output)
    except KeyboardInterrupt:
        return 130
    except (InnerattnError, OSError, RuntimeError) as error:
        print(f"robot: error: {error}", file=sys.stderr)
        return 1
    return 0


def _run(settings: Drive, link: LinkSettings) -> None:
    """Drive once, and say beside it what the team does without processes and links."""
    team = Exported(settings.export, backend="numpy")
    period_ms = 1000 * team.contract.control_period_s / settings.scale
    names = ", ".join(team.robot_names)
    print(f"{names}: a process each, an action every {period_ms:g} ms", flush=True)
    outcome, direct = drive(settings, link), drive_directly(settings)
    print(f"rescues in {outcome.episodes} episodes: {outcome.rescues}")
    print(f"rescues of the same team in one process: {direct.rescues}")
    print(f"teammates heard: {outcome.heard_share:.0%}")
    print(f"commands: {outcome.commands} in time, {outcome.late} late")
    print(f"control periods that began late: {outcome.overruns}")


def _table(settings: Drive, skew_s: float, output: Path | None) -> None:
    """Drive once for each latency and loss, in the same worlds."""
    direct = drive_directly(settings)
    lines = [
        f"{settings.episodes} episodes each, seed {settings.seed}, time scale {settings.scale:g}, "
        f"clocks off by up to {skew_s * 1000:g} ms. In one process, where every robot knows "
        f"everything at once: {direct.rescues_per_episode:.2f} rescues per episode.",
        "",
        "| latency [ms] | loss | rescues per episode | lost | teammates heard | late commands |",
        "|---:|---:|---:|---:|---:|---:|",
    ]
    print("\n".join(lines), flush=True)
    for latency_ms in LATENCIES_MS:
        for loss in LOSSES:
            found = drive(settings, LinkSettings(latency_ms / 1000, loss, skew_s))
            lines.append(_row(latency_ms, loss, found, direct))
            print(lines[-1], flush=True)
    if output is not None:
        write_whole(output, ("\n".join(lines) + "\n").encode())


def _row(latency_ms: float, loss: float, found: Outcome, direct: Outcome) -> str:
    lost = "" if direct.rescues == 0 else f"{1 - found.rescues / direct.rescues:.0%}"
    late = found.late / (found.late + found.commands)
    cells = [
        f"{latency_ms:g}",
        f"{loss:.0%}",
        f"{found.rescues_per_episode:.2f}",
        lost,
        f"{found.heard_share:.0%}",
        f"{late:.1%}",
    ]
    return f"| {' | '.join(cells)} |"


def _number(low: float, high: float) -> Callable[[str], float]:
    def read(text: str) -> float:
        value = float(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text}: must be {low:g} to {high:g}")
        return value

    return read


def _count(text: str) -> int:
    value = int(text)
    if not 1 <= value <= 1_000_000:
        raise argparse.ArgumentTypeError(f"{text}: must be 1 to 1000000")
    return value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="robot", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, text in (("run", "drive a team"), ("table", "measure what links cost a team")):
        one = commands.add_parser(name, help=text)
        one.add_argument("export", type=Path, help="folder that innerattn export wrote")
        one.add_argument("--episodes", type=_count, default=4)
        one.add_argument("--episode-steps", type=_count, help="none: as in the scenario")
        one.add_argument(
            "--time-scale",
            type=_number(0.01, 100),
            default=1.0,
            help="world seconds in a second; 1: real time",
        )
        one.add_argument("--seed", type=int, default=0)
        one.add_argument("--backend", choices=("onnxruntime", "numpy"))
        one.add_argument(
            "--skew-ms", type=_number(0, 1e5), default=0.0, help="most error of a robot's clock"
        )
        if name == "run":
            one.add_argument("--latency-ms", type=_number(0, 1e5), default=0.0)
            one.add_argument("--loss", type=_number(0, 1), default=0.0, help="share of messages")
        else:
            one.add_argument("-o", "--output", type=Path, help="file for the table, too")
    return parser


if __name__ == "__main__":
    sys.exit(main())
