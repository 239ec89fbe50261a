"""What an installed package must do, tried where nothing else is installed: `make smoke` runs it.

It takes the extras that are there as an argument, e.g. "gym", and needs no test library.
"""

import os
import pickle
import subprocess
import sys
import sysconfig
import time
from pathlib import Path
from tempfile import TemporaryDirectory

EXTRAS = sys.argv[1].split(",") if len(sys.argv) > 1 else []
SMALL = (
    *("--train.env-steps", "1000", "--train.num-envs", "16", "--network.hidden-width", "16"),
    *("--evaluate.episodes", "4", "--evaluate.score-episodes", "8"),
    *("--evaluate.long-episodes", "4"),
)
"""Options of a training of seconds."""
STUDY = """
question = "Does Ray start workers?"
[grid]
methods = ["ppo-inner"]
seeds = "0..1"
train.env_steps = [1_000]
train.num_envs = [16]
network.hidden_width = [16]
evaluate.episodes = [4]
evaluate.score_episodes = [8]
evaluate.long_episodes = [4]
"""


def command(*arguments: str) -> "subprocess.CompletedProcess[str]":
    path = Path(sysconfig.get_path("scripts")) / "innerattn"
    return subprocess.run([path, *arguments], capture_output=True, text=True, check=False)


def worlds_scripts_records_and_statistics() -> None:
    import numpy as np

    from innerattn.config import Scenario
    from innerattn.envs import BatchEnv
    from innerattn.evaluate import read_records, run_episodes, scripted_policy, write_records
    from innerattn.measures.registry import measures_of
    from innerattn.records.record import FIELDS
    from innerattn.stats.student import student_interval

    env = BatchEnv("mixed", 8, seed=1)
    env.reset()
    for _ in range(40):
        step = env.step(np.ones((8, 4), int))
    assert np.isfinite(step.obs).all()
    assert pickle.loads(pickle.dumps(env)).state().tobytes() == env.state().tobytes()
    scenario = Scenario.preset("mixed-8")  # more robots than are assigned without scipy
    record = run_episodes(scripted_policy("hungarian", scenario), scenario, 4, 0, record=FIELDS)
    with TemporaryDirectory() as folder:
        write_records([record], Path(folder))
        (again,) = read_records(Path(folder))
    assert measures_of(again) == measures_of(record)
    assert student_interval([1.0, 2.0, 4.0]).low < 2.3
    versions = f"Python {sys.version.split()[0]}, numpy {np.__version__}"
    print(f"{versions}: worlds, scripts, records, statistics,", end=" ")
    assert "torch" not in sys.modules


def the_command() -> None:
    from innerattn import __version__

    assert command("--version").stdout == f"innerattn {__version__}\n"
    if "train" not in EXTRAS:
        done = command("train")
        assert done.returncode == 1, done
        assert done.stderr.endswith("pip install 'innerattn[train]'\n"), done.stderr
        assert done.stderr.count("\n") == 1, done.stderr
        with TemporaryDirectory() as folder:
            page = Path(folder) / "demo.html"
            done = command("demo", "--no-open", "-o", str(page))
            assert done.returncode == 0, done.stderr
            assert "zoo:mixed (trained)" in done.stdout
            assert page.stat().st_size > 1_000_000


def views() -> None:
    import gymnasium
    from gymnasium.utils.env_checker import check_env
    from pettingzoo.test import api_test, parallel_api_test

    from innerattn.envs import env, parallel_env

    parallel_api_test(parallel_env(), num_cycles=30)
    api_test(env(), num_cycles=30)
    many = gymnasium.make_vec("innerattn/Rescue-v0", num_envs=3)
    many.reset(seed=0)
    many.step(many.action_space.sample())
    check_env(gymnasium.make("innerattn/Rescue-v0").unwrapped)


def a_team() -> None:
    """Train, export, measure and show a team, each by the command."""
    with TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        calls = [("train", "--run-dir", run, "--method", "ppo-inner", *SMALL)]
        if "deploy" in EXTRAS:
            calls.append(("export", run))
        if "report" in EXTRAS:
            calls.append(("replay", run, "-o", run.with_suffix(".html")))
            calls.append(("report", run, "-o", run.with_suffix(".report.html")))
        for words in calls:
            done = command(*map(str, words))
            assert done.returncode == 0, done.stderr
        if "deploy" in EXTRAS:
            from innerattn.policies import Exported

            for backend in ("numpy", "onnxruntime"):
                team = Exported(run / "export", backend=backend)  # type: ignore[arg-type]
                assert team.decide("food_0", [0.0] * 44).action in range(5)


def a_map_and_a_proposal() -> None:
    """Read a map as ROS stores it, and ask Optuna for the first trial of a search."""
    from innerattn.studies.search.optuna import propose
    from innerattn.studies.space import Search

    search = Search.model_validate({"ppo": {"epochs": {"low": 1, "high": 4}}})
    assert propose(search, [], 1)["ppo.epochs"] in range(1, 5)
    from PIL import Image

    with TemporaryDirectory() as folder:
        picture = Image.new("L", (40, 40), 254)
        picture.paste(0, (10, 20, 20, 30))
        picture.save(Path(folder) / "map.png")
        (Path(folder) / "map.yaml").write_text(
            "image: map.png\nresolution: 0.05\norigin: [-1.0, -1.0, 0.0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
        )
        world = Path(folder) / "world.toml"
        world.write_text('map = { file = "map.yaml" }\n')
        done = command("info", "--scenario", str(world))
        assert done.returncode == 0, done.stderr


def loggers() -> None:
    """Let each library follow a training, without a network."""
    from innerattn.loggers import LOGGERS

    with TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "mlflow").mkdir()
        os.environ |= {
            "WANDB_MODE": "offline",
            "WANDB_DIR": folder,
            "MLFLOW_TRACKING_URI": (place / "mlflow").as_uri(),
            "MLFLOW_ALLOW_FILE_STORE": "true",
            "TRACKIO_DIR": str(place / "trackio"),
        }
        own = ("--method", "ppo-inner", "--ppo.rollout-steps", "20", "--ppo.minibatch-size", "80")
        done = command("train", "--run-dir", str(place / "run"), *own, *SMALL, "--log", *LOGGERS)
        assert done.returncode == 0, done.stderr
        for file in ("run/tensorboard/*", "wandb/offline-run-*", "mlflow/*", "trackio/*.db"):
            assert list(place.glob(file)), (file, done.stderr)


def workers_of_ray() -> None:
    """Run a study by workers that Ray starts on this machine."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "study.toml"
        file.write_text(STUDY)
        where = ("--out", str(Path(folder) / "out"))
        done = command("study", "run", str(file), *where, "--workers", "2", "--ray", "local")
        assert done.returncode == 0, done.stderr
        assert len(list(Path(folder).glob("out/runs/*/run.json"))) == 2


def the_view_of_torchrl() -> None:
    from torchrl.envs.utils import check_env_specs

    from innerattn.envs import RescueTorchRLEnv

    env = RescueTorchRLEnv("mixed", 3)
    check_env_specs(env, seed=0)
    assert env.rollout(4).shape == (3, 4)


def missing_views() -> None:
    said = "nothing"
    try:
        from innerattn.envs import parallel_env  # noqa: F401
    except ImportError as error:
        said = str(error)
    assert said.endswith("pip install 'innerattn[gym]'"), said


if __name__ == "__main__":
    before = time.perf_counter()
    import innerattn.envs

    seconds = time.perf_counter() - before
    assert not {"gymnasium", "numpy", "torch"} & set(sys.modules), innerattn.envs.__file__
    worlds_scripts_records_and_statistics()
    the_command()
    (views if "gym" in EXTRAS else missing_views)()
    if "train" in EXTRAS:
        a_team()
    if {"maps", "search"} <= set(EXTRAS):
        a_map_and_a_proposal()
    if "log" in EXTRAS:
        loggers()
    if "torchrl" in EXTRAS:
        the_view_of_torchrl()
    if "ray" in EXTRAS:
        workers_of_ray()
    print(f"command{', views' if 'gym' in EXTRAS else ''}; import innerattn.envs: {seconds:.3f} s")
