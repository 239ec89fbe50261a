"""Maps from pictures, ROS's YAML and polygons, against what was drawn."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from innerattn.config import Map, Scenario, load_run_config
from innerattn.errors import ConfigError, MissingLibraryError

ROOM = ["#####", "#...#", "#.#.#", "#...#", "#####"]


def picture(path: Path, rows: list[str], shades: dict[str, int], scale: int = 1) -> Path:
    """A grey picture with a pixel, or a square of them, for each cell."""
    cells = np.array([[shades[cell] for cell in row] for row in rows], np.uint8)
    Image.fromarray(cells.repeat(scale, 0).repeat(scale, 1)).save(path)
    return path


def scenario_file(folder: Path, text: str) -> Path:
    path = folder / "world.toml"
    path.write_text(text)
    return path


def ros(folder: Path, **keys: object) -> str:
    table = {"image": "plan.png", "resolution": 0.5, "origin": [0.0, 0.0, 0.0], "negate": 0} | keys
    lines = [f"{key}: {json.dumps(value)}" for key, value in table.items() if value is not None]
    (folder / "plan.yaml").write_text("\n".join(lines))
    return 'map = { file = "plan.yaml" }\n'


def test_a_map_of_ros_is_read_to_scale(tmp_path: Path) -> None:
    """Unknown cells are solid, and what lies outside of all that is free is cut off."""
    rows = ["???????", "?#####?", "?#...#?", "?#.#.#?", "?#...#?", "?#####?", "???????"]
    picture(tmp_path / "plan.png", rows, {"?": 205, "#": 0, ".": 254}, scale=4)
    read = Scenario.from_toml(
        scenario_file(tmp_path, ros(tmp_path, occupied_thresh=0.65, free_thresh=0.196))
    )
    assert read.map is not None
    assert read.arena_half_width_m == 3.0, "12 pixels of 0.5 m"
    fine = np.array([[cell == "#" for cell in row] for row in ["...", ".#.", "..."]])
    np.testing.assert_array_equal(read.map.solid, fine.repeat(4, 0).repeat(4, 1))
    assert len(read.map_boxes) == 1
    assert read.map_boxes[0].position_m == (0.0, 0.0)
    assert read.map_boxes[0].half_extents_m == (1.0, 1.0)
    # The same scenario comes back from its own text, without the files.
    assert Scenario.model_validate_json(read.model_dump_json()) == read


def test_a_given_width_scales_the_map(tmp_path: Path) -> None:
    picture(tmp_path / "plan.png", ROOM, {"#": 0, ".": 255})
    text = ros(tmp_path) + "arena_half_width_m = 1.5\n"
    assert Scenario.from_toml(scenario_file(tmp_path, text)).arena_half_width_m == 1.5


@pytest.mark.parametrize("negate", [0, 1])
def test_a_picture_alone_covers_the_arena(tmp_path: Path, negate: int) -> None:
    shades = {"#": 255, ".": 0} if negate else {"#": 0, ".": 255}
    picture(tmp_path / "plan.png", ROOM, shades)
    text = (
        ros(tmp_path, negate=1) if negate else 'map = { file = "plan.png", layers = ["ground"] }\n'
    )
    text += "arena_half_width_m = 2.0\n"
    read = Scenario.from_toml(scenario_file(tmp_path, text))
    assert read.map is not None
    assert read.map.rows == ("...", ".#.", "...")
    assert read.map.layers == (None if negate else ("ground",))


def test_pixels_are_taken_together_and_one_that_is_solid_suffices(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    solid = rng.random((90, 90)) < 0.01
    solid[:, 40:43] = True
    solid[[0, -1, 44], 41] = False
    solid[44, 40:43] = False
    solid[0] = solid[-1] = False
    Image.fromarray(np.where(solid, 0, 255).astype(np.uint8)).save(tmp_path / "plan.png")
    text = 'map = { file = "plan.png", cells = 30 }\n'
    read = Scenario.from_toml(scenario_file(tmp_path, text))
    assert read.map is not None
    coarse = np.zeros((30, 30), bool)
    for row, column in np.argwhere(solid):
        coarse[row // 3, column // 3] = True
    free = ~read.map.solid
    assert not (free & coarse).any()
    # All that is free hangs together, and the rest is cut off from it.
    reached = np.zeros_like(free)
    left = [tuple(np.argwhere(free)[0])]
    while left:
        row, column = left.pop()
        inside = 0 <= row < 30 and 0 <= column < 30
        if inside and not coarse[row, column] and not reached[row, column]:
            reached[row, column] = True
            left += [(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)]
    np.testing.assert_array_equal(reached, free)
    assert 2 * free.sum() > (~coarse).sum()


def test_a_narrow_picture_stands_in_the_middle_of_a_square(tmp_path: Path) -> None:
    picture(tmp_path / "plan.png", ["......", "......"], {".": 255})
    read = Scenario.from_toml(scenario_file(tmp_path, 'map = { file = "plan.png" }\n'))
    assert read.map is not None
    assert read.map.rows == ("######", "######", "......", "......", "######", "######")


def test_what_is_see_through_is_free(tmp_path: Path) -> None:
    pixels = np.zeros((4, 4, 4), np.uint8)
    pixels[0, 0] = (0, 0, 0, 255)
    Image.fromarray(pixels).save(tmp_path / "plan.png")
    read = Scenario.from_toml(scenario_file(tmp_path, 'map = { file = "plan.png" }\n'))
    assert read.map is not None
    assert read.map.rows == ("#...", "....", "....", "....")


def test_polygons_are_drawn_into_the_arena(tmp_path: Path) -> None:
    square = [[-1.0, -1.0], [-0.5, -1.0], [-0.5, -0.5], [-1.0, -0.5]]
    triangle = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
    (tmp_path / "plan.json").write_text(json.dumps([square, triangle]))
    text = 'map = { file = "plan.json", cells = 20 }\n'
    read = Scenario.from_toml(scenario_file(tmp_path, text))
    assert read.map is not None
    solid = read.map.solid
    assert solid.shape == (20, 20)
    assert read.arena_half_width_m == 1.0
    for row in range(20):
        for column in range(20):
            x, y = (column + 0.5) / 10 - 1.0, 1.0 - (row + 0.5) / 10
            inside = max(x, y) < -0.5 or (y > 0.0 and x > y)
            near = min(abs(x + 0.5), abs(y + 0.5), abs(y), abs(x - y)) < 0.11
            assert near or solid[row, column] == inside, (x, y)
            assert not inside or solid[row, column], (x, y)


def test_a_run_keeps_the_cells(tmp_path: Path) -> None:
    """In a file of a scenario and in the section of a run's file."""
    picture(tmp_path / "plan.png", ROOM, {"#": 0, ".": 255})
    plain = scenario_file(tmp_path, 'map = { file = "plan.png" }\n')
    config = tmp_path / "run.toml"
    config.write_text('[scenario.map]\nfile = "plan.png"\n\n[network]\nsymmetry = "none"\n')
    given = {"network.symmetry": "none"}
    one = load_run_config("mixed", "ppo-inner", "quick", None, given, scenario_file=plain)
    other = load_run_config("mixed", "ppo-inner", "quick", config)
    assert one.scenario == other.scenario
    assert one.scenario.map is not None
    assert one.scenario.map.rows == ("...", ".#.", "...")


def test_frames_are_refused() -> None:
    from innerattn.envs import BatchEnv
    from innerattn.train.build import build_learner

    given = {"network.symmetry": "canonical"}
    config = load_run_config("mixed", "ppo-inner", "quick", None, given).replace(
        scenario=Scenario(map=Map(rows=("#.", "..")))
    )
    with (
        BatchEnv(config.scenario, 1) as env,
        pytest.raises(ConfigError, match=r"scenario\.map: network\.symmetry must be 'none'"),
    ):
        build_learner(config, env)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('map = { file = "none.png" }', "map.file: cannot read {folder}/none.png: missing"),
        ('map = { file = "text.png" }', "text.png is no picture that Pillow can read"),
        ('map = { file = "black.png" }', "has no free place"),
        ('map = { file = "thin.png", cells = 2 }', "no free cell where 3 x 3 pixels are one"),
        ('map = { file = 3 }', "map.file = 3: must be the path of a file"),
        ('map = { file = "room.png", cells = 1 }', "map.cells = 1: must be a whole number in"),
        ('map = { file = "room.png", rows = ["#."] }', "map.rows: beside map.file stand only"),
        ('map = { file = "list.yaml" }', "image: must name the picture"),
        ('map = { file = "scale.yaml" }', "mode = 'scale': must be 'trinary'"),
        ('map = { file = "far.yaml" }', "resolution = -0.5: must be a number above 0"),
        ('map = { file = "broken.yaml" }', "is not YAML"),
        ('map = { file = "word.json" }', "must be a list of polygons"),
        ('map = { file = "line.json" }', "polygon 0: must be a list of three places"),
    ],
)  # fmt: skip
def test_wrong_files_are_refused_in_one_line(tmp_path: Path, text: str, expected: str) -> None:
    picture(tmp_path / "room.png", ROOM, {"#": 0, ".": 255})
    picture(tmp_path / "black.png", ["##", "##"], {"#": 0})
    picture(tmp_path / "thin.png", ["#.#" * 2] * 6, {"#": 0, ".": 255})
    (tmp_path / "text.png").write_text("a picture")
    (tmp_path / "list.yaml").write_text("- 1\n")
    (tmp_path / "scale.yaml").write_text("image: room.png\nresolution: 1\nmode: scale\n")
    (tmp_path / "far.yaml").write_text("image: room.png\nresolution: -0.5\n")
    (tmp_path / "broken.yaml").write_text("image: [\n")
    (tmp_path / "word.json").write_text('"word"')
    (tmp_path / "line.json").write_text("[[[0, 0], [1, 1]]]")
    with pytest.raises(ConfigError) as raised:
        Scenario.from_toml(scenario_file(tmp_path, text))
    assert expected.replace("{folder}", str(tmp_path)) in str(raised.value)
    assert str(raised.value).startswith(f"{tmp_path / 'world.toml'}: scenario.map")


def test_a_value_that_unfolds_to_a_huge_one_is_not_written_out(tmp_path: Path) -> None:
    """Each line names the one before ten times: written out, the last would fill any memory."""
    lines = [
        f"a{depth}: &a{depth} [{', '.join([f'*a{depth - 1}'] * 10)}]" for depth in range(1, 20)
    ]
    text = "\n".join(["a0: &a0 [1]", *lines, "image: room.png", "mode: *a19"])
    (tmp_path / "bomb.yaml").write_text(text)
    with pytest.raises(ConfigError, match="mode = list: must be 'trinary'"):
        Scenario.from_toml(scenario_file(tmp_path, 'map = { file = "bomb.yaml" }\n'))


def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ros(tmp_path)
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'innerattn\[maps\]'"):
        Scenario.from_toml(scenario_file(tmp_path, 'map = { file = "plan.yaml" }\n'))
