"""`innerattn export`: a trained team as files and a contract, for robots."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from innerattn.cli.options import Command, UsageError
from innerattn.cli.runs import existing_run
from innerattn.config import Scenario
from innerattn.policies import SCRIPTS
from innerattn.zoo import in_zoo


@dataclass(kw_only=True)
class Export(Command):
    """Export a trained team for robots: ONNX files, weights for numpy, and a contract."""

    run_folder: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN")]
    """A run's folder or name."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder to make; None: export in the run's folder."""
    scenario: Path | None = None
    """TOML file with the team that a policy for any team is to serve; None: that of the run."""

    def run(self) -> int:
        """Export, check, print.

        Returns:
            The exit code, 0.

        Raises:
            InnerattnError: no such run, no weights, a folder that is already there, a library that
                is missing, or an exported policy that differs from the trained one.
            OSError: a file cannot be written.
        """
        if self.run_folder in SCRIPTS:
            raise UsageError(
                f"{self.run_folder}: is a script; only trained teams have weights to export"
            )
        run = existing_run(self.run_folder)
        if self.output is None and in_zoo(run):
            raise UsageError(f"{self.run_folder}: -o FOLDER must say where to write")
        from innerattn.train.export import export_run

        worlds = None if self.scenario is None else Scenario.from_toml(self.scenario)
        folder, contract = export_run(run, self.output, worlds)
        checked = contract.checked
        assert checked is not None  # as export_run always checks
        robots, actors = len(contract.robots), len(contract.actors)
        size = sum(entry.bytes for entry in contract.files.values()) / 1e6
        frame = "as the world is" if contract.network.frame is None else "canonical, in the files"
        has_onnx = any(name.endswith(".onnx") for name in contract.files)
        files = f"{actors} ONNX file{'s' * (actors > 1)}" if has_onnx else "for numpy alone"
        print(f"{folder}: {robots} robots, {files}, {size:.1f} MB")
        print(f"observation: {len(contract.observation)} columns; frame: {frame}")
        print(f"control period: {contract.control_period_s:g} s")
        ties = f", {checked.near_ties:,} near ties" if checked.near_ties else ""
        print(
            f"checked on {checked.observations:,} played observations: same greedy action in "
            f"{checked.same_greedy_action:,}{ties}"
        )
        differences = [("onnxruntime", checked.largest_difference_onnx)]
        differences.append(("numpy", checked.largest_difference_numpy))
        said = [f"{one:.1e} in {name}" for name, one in differences if one is not None]
        print(f"largest difference: {', '.join(said)}")
        if not has_onnx:
            print("pip install 'innerattn[deploy]' and export again for an ONNX file, too")
        return 0
