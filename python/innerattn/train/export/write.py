"""Writes the folder of an exported team, whole or not at all, once it is checked."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from innerattn.config import RunConfig, Scenario
from innerattn.config.files import sync_folder, write_whole
from innerattn.envs import BatchEnv
from innerattn.errors import ExportError, MissingLibraryError, missing_library
from innerattn.learn.types import Learner
from innerattn.policies.exported.backend import onnx_mark
from innerattn.policies.exported.contract import (
    NAME,
    WEIGHTS,
    Checked,
    Contract,
    contract_in,
    contract_text,
    digest_of,
)
from innerattn.policies.exported.team import Exported
from innerattn.records.run_files import RunFiles, amend
from innerattn.records.run_folder import config_of
from innerattn.train.columns import entity_columns
from innerattn.train.export.actors import OnnxForm, OnnxVectorForm, inner_actor, team_actors
from innerattn.train.export.check import check_export, check_pairs
from innerattn.train.export.document import contract_document, frame_in, network_of
from innerattn.train.export.onnx_file import onnx_files, view_file
from innerattn.train.export.view_form import ViewForm
from innerattn.train.policy import NewestPolicy, load_newest
from innerattn.train.teams.policy import TeamPolicy
from innerattn.train.weights import write_weights

FORMAT = "innerattn.actors"
ANY = "any"
"""Name of the actor that serves any team."""
_LIBRARIES = ("onnx", "onnxscript", "onnxruntime")


def needed_libraries() -> None:
    """Refuse in time to export where a library is missing.

    Raises:
        MissingLibraryError: one is; the message says how to install it.
    """
    if (name := _missing_library()) is not None:
        error = ModuleNotFoundError(name=name)
        missing: MissingLibraryError | None = missing_library("innerattn export", error)
        assert missing is not None
        raise missing


def _missing_library() -> str | None:
    """The first library of ONNX that is not installed; None: all are."""
    return next((name for name in _LIBRARIES if find_spec(name) is None), None)


def export_run(
    run: str | Path, out: str | Path | None = None, scenario: Scenario | None = None
) -> tuple[Path, Contract]:
    """Export the newest policy of a run, and check it on observations that it plays.

    Args:
        run: the run folder.
        out: the folder to make; None: ``export`` in the run folder.
        scenario: the worlds of the team that a policy for any team is to serve; None: those of the
            run.

    Returns:
        The folder, and its contract.

    Raises:
        MissingLibraryError: a library of the extra ``deploy`` is not installed.
        ExportError: the folder is already there or cannot be made, the run's policy is not one of
            this package, it is for one team and ``scenario`` is given, or the exported one differs
            from it.
        RunError, ConfigError: there is no readable run, it holds no weights, or a policy for any
            team does not know what ``scenario`` has.
        OSError: the run's manifest cannot be written.
    """
    source = Path(run)
    target = source / "export" if out is None else Path(out)
    if os.path.lexists(target):
        raise ExportError(f"{target}: is already there; -o names another folder")
    config = config_of(RunFiles(source))
    if not config.algorithm.for_any_team:
        needed_libraries()
        if scenario is not None:
            raise ExportError(
                f"{run}: method {config.train.method!r} is of one team: it cannot be exported for "
                "another scenario, as policies for any team can"
            )
    newest = load_newest(source, scenario=scenario)
    if not target.parent.is_dir():
        raise ExportError(f"{target.parent}: no such folder")
    partial = target.with_name(f".{target.name}.{os.getpid()}.{secrets.token_hex(8)}")
    try:
        partial.mkdir()
        made_by = _origin_of(source, newest)
        if isinstance(newest.learner, TeamPolicy):
            worlds = newest.config.scenario if scenario is None else scenario
            team = newest.config.model_copy(update={"scenario": worlds})
            contract = _write_pairs(team, newest.learner, made_by, partial)
        else:
            contract = _write(source, newest.config, newest.learner, made_by, partial)
        os.rename(partial, target)
    except BaseException as error:
        shutil.rmtree(partial, ignore_errors=True)
        if isinstance(error, OSError):  # the user knows no partial folder
            raise ExportError(f"{target}: cannot be made ({error.strerror})") from error
        raise
    sync_folder(target.parent)
    if target.resolve().is_relative_to(source.resolve()):
        amend(source, target.resolve().relative_to(source.resolve()).as_posix())
    return target, contract


def _origin_of(run: Path, newest: NewestPolicy) -> dict[str, str | int | None]:
    """Where an exported policy comes from."""
    return {
        "method": newest.config.train.method,
        "seed": newest.config.train.seed,
        "env_steps": newest.env_steps,
        "config_sha256": newest.config.digest(),
        "weights_sha256": RunFiles(run).info.weights_sha256,
    }


def _write_pairs(
    config: RunConfig, policy: TeamPolicy, made_by: Mapping[str, str | int | None], out: Path
) -> Contract:
    """Fill a folder with a policy for any team, for the team of ``config``, and check it.

    It has an ONNX file where the libraries for it are installed.
    """
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        names = env.observation_names()
    network = network_of(config, names, None)  # refuses what cannot be exported
    tensors = {f"{ANY}.{name}": one.detach() for name, one in policy.actor.state_dict().items()}
    weights_sha256 = write_weights(out / WEIGHTS, tensors, FORMAT)
    file = WEIGHTS
    if _missing_library() is None:
        file = f"{ANY}.onnx"
        scenario_sha256 = digest_of(config.scenario.model_dump(mode="json"))
        mark = onnx_mark(weights_sha256, scenario_sha256, ANY)
        write_whole(out / file, view_file(ViewForm(policy.actor), mark))
    document = contract_document(
        config,
        names,
        network,
        of_robot=[ANY] * len(config.scenario.robots),
        actors={ANY: file},
        weights_sha256=weights_sha256,
        run=made_by,
        files={name: (out / name).read_bytes() for name in dict.fromkeys((WEIGHTS, file))},
    )
    write_whole(out / NAME, contract_text(document))
    plain = Exported(out, backend="numpy")
    onnx = None if file == WEIGHTS else Exported(out, backend="onnxruntime")
    return _sealed(document, check_pairs(config.scenario, policy, plain, onnx), out)


def _sealed(document: dict[str, Any], checked: Checked, out: Path) -> Contract:
    """Write the contract once more, with what the check found."""
    data = contract_text({**document, "checked": asdict(checked)})
    write_whole(out / NAME, data)
    return contract_in(data)


def _write(
    run: Path,
    config: RunConfig,
    learner: Learner,
    made_by: Mapping[str, str | int | None],
    out: Path,
) -> Contract:
    """Fill a folder, and check what is in it."""
    with closing(BatchEnv(config.scenario, 1, num_threads=1)) as env:
        names = env.observation_names()
    if config.network.memory_width:
        raise ExportError(
            f"{run}: network.memory_width = {config.network.memory_width}: exported policies have "
            "no memory"
        )
    if config.network.message_width:
        raise ExportError(
            f"{run}: network.message_width = {config.network.message_width}: must be 0; exported "
            "policies send no messages"
        )
    entities = entity_columns(names) if config.network.encoder == "entities" else None
    actor = inner_actor(learner, run)
    team = team_actors(config, actor, entities)
    weights_sha256 = write_weights(out / WEIGHTS, team.tensors(), FORMAT)
    files = {name: f"{name}.onnx" for name in team.actors}
    network = network_of(config, names, entities)
    continuous = config.scenario.actions == "continuous"
    form = OnnxVectorForm if continuous else OnnxForm
    scenario_sha256 = digest_of(config.scenario.model_dump(mode="json"))
    drives = {
        name: robot.drive for name, robot in zip(team.of_robot, config.scenario.robots, strict=True)
    }
    forms = {
        name: form(one, frame_in(network, len(names), drives[name], continuous))
        for name, one in team.actors.items()
    }
    marks = {name: onnx_mark(weights_sha256, scenario_sha256, name) for name in forms}
    for name, data in onnx_files(forms, len(names), marks).items():
        write_whole(out / files[name], data)
    document = contract_document(
        config,
        names,
        network,
        of_robot=team.of_robot,
        actors=files,
        weights_sha256=weights_sha256,
        run=made_by,
        files={name: (out / name).read_bytes() for name in (WEIGHTS, *files.values())},
    )
    write_whole(out / NAME, contract_text(document))
    onnx, plain = Exported(out, backend="onnxruntime"), Exported(out, backend="numpy")
    return _sealed(document, check_export(config, learner, actor, onnx, plain), out)
