"""Reading maps: pictures, those of ROS's map_server with their YAML, and polygons in JSON."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from innerattn.config.untrusted import MOST_JSON_BYTES, parse_json, read_plain
from innerattn.errors import ConfigError, RunError, missing_library, one_line

if TYPE_CHECKING:
    from PIL.Image import Image

MOST_CELLS = 200
"""Most cells along one side."""
_MOST_BYTES = 64 << 20
_MOST_PIXELS = 1 << 26
_FINE = 8
"""Pixels along a side of each cell into which polygons are drawn."""
_KEYS = ("file", "cells", "layers")
_OCCUPIED, _FREE = 0.65, 0.196
"""The thresholds of map_server where its file gives none."""

Mask = NDArray[np.bool_]


class Grid(NamedTuple):
    """A picture of an arena."""

    solid: Mask
    """(height, width), from top to bottom."""
    resolution_m: float | None
    """Width of a pixel [m]; none where nothing says so."""


def with_map_file(scenario: dict[str, Any], path: str | Path) -> dict[str, Any]:
    """The keys of a scenario with the rows of the map in place of ``map.file``.

    Where the file knows the width of a cell, ``arena_half_width_m`` follows from it unless it is
    given. Pixels are taken together where there are more than ``map.cells`` along a side, and such
    a cell is solid if one of its pixels is.

    Args:
        scenario: the keys; they stay as they are.
        path: the file that they stand in; ``map.file`` counts from its folder.

    Raises:
        ConfigError: the file cannot be read, is no map, or has no free place.
        MissingLibraryError: Pillow or PyYAML is not installed.
    """
    given = scenario.get("map")
    if not isinstance(given, dict) or "file" not in given:
        return scenario
    try:
        return scenario | _read(given, Path(path).parent, scenario.get("arena_half_width_m"))
    except ConfigError as error:
        raise ConfigError(f"{path}: scenario.{error}") from error


def _read(given: dict[str, Any], folder: Path, half: Any) -> dict[str, Any]:
    """The keys that come of a map and the half width that is given, if it is."""
    if unknown := [key for key in given if key not in _KEYS]:
        raise ConfigError(f"map.{unknown[0]}: beside map.file stand only {' and '.join(_KEYS[1:])}")
    if not isinstance(given["file"], str):
        raise ConfigError(f"map.file = {given['file']!r}: must be the path of a file, as a text")
    cells = given.get("cells", MOST_CELLS)
    if isinstance(cells, bool) or not isinstance(cells, int) or not 2 <= cells <= MOST_CELLS:
        raise ConfigError(f"map.cells = {cells!r}: must be a whole number in 2..={MOST_CELLS}")
    path = folder / given["file"]
    try:
        grid = (
            _polygons(path, cells, 1.0 if half is None else half)
            if path.suffix == ".json"
            else _picture_or_ros(path)
        )
    except ModuleNotFoundError as error:
        if missing := missing_library(f"map.file = {given['file']!r}", error):
            raise missing from error
        raise
    except (OSError, RunError) as error:
        raise ConfigError(f"map.file: cannot read {one_line(error)}") from error
    solid, width_m = _square(grid, cells, path, crop=path.suffix != ".json")
    rows = ["".join("#" if cell else "." for cell in row) for row in solid.tolist()]
    found: dict[str, Any] = {"rows": rows}
    if "layers" in given:
        found["layers"] = given["layers"]
    if width_m is None or half is not None:
        return {"map": found}
    return {"map": found, "arena_half_width_m": round(width_m / 2.0, 9)}


def _square(grid: Grid, cells: int, path: Path, *, crop: bool) -> tuple[Mask, float | None]:
    """A square of at most ``cells`` cells along a side, and its width [m] if it is known."""
    solid = grid.solid
    if solid.all():
        raise ConfigError(f"map.file: {path} has no free place")
    if crop:
        solid = _largest_part(solid)
        inside = [np.flatnonzero(~solid.all(axis)) for axis in (1, 0)]
        rows, columns = (slice(found[0], found[-1] + 1) for found in inside)
        solid = solid[rows, columns]
    together = math.ceil(max(solid.shape) / cells)
    side = max(2, math.ceil(max(solid.shape) / together))
    square = np.ones((side * together, side * together), np.bool_)
    top, left = ((side * together - length) // 2 for length in solid.shape)
    square[top : top + solid.shape[0], left : left + solid.shape[1]] = solid
    coarse: Mask = np.any(square.reshape(side, together, side, together), (1, 3))
    if coarse.all():
        raise ConfigError(
            f"map.file: {path} has no free cell where {together} x {together} pixels are one; "
            "use a larger map.cells or a coarser picture"
        )
    resolution = grid.resolution_m
    width = None if resolution is None else resolution * side * together
    return _largest_part(coarse), width


def _largest_part(solid: Mask) -> Mask:
    """The same with all free cells solid that the largest free part is not connected to."""
    from scipy.ndimage import label

    parts, _ = label(~solid)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0  # the solid cells
    return np.asarray(parts != sizes.argmax())


def _picture_or_ros(path: Path) -> Grid:
    if path.suffix not in (".yaml", ".yml"):
        return Grid(_solid(path, negate=False, occupied=_OCCUPIED, free=_FREE), None)
    import yaml

    try:
        table = yaml.safe_load(read_plain(path, 1 << 16, follow_link=True))
    except yaml.YAMLError as error:
        raise ConfigError(f"map.file: {path} is not YAML: {error}") from error
    if not isinstance(table, dict) or not isinstance(table.get("image"), str):
        raise ConfigError(f"map.file: {path}: image: must name the picture of the map")
    if table.get("mode", "trinary") != "trinary":
        raise ConfigError(f"map.file: {path}: mode = {_shown(table['mode'])}: must be 'trinary'")
    negate = table.get("negate", 0)
    if negate not in (0, 1):
        raise ConfigError(f"map.file: {path}: negate = {_shown(negate)}: must be 0 or 1")
    occupied = _number(table, "occupied_thresh", _OCCUPIED, path, most=1.0)
    free = _number(table, "free_thresh", _FREE, path, most=1.0)
    resolution = _number(table, "resolution", None, path, most=100.0)
    picture = path.parent / table["image"]
    return Grid(_solid(picture, negate=bool(negate), occupied=occupied, free=free), resolution)


def _number(
    table: dict[str, Any], key: str, default: float | None, path: Path, most: float
) -> float:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value <= most:
        raise ConfigError(
            f"map.file: {path}: {key} = {_shown(value)}: must be a number above 0, at most {most:g}"
        )
    return float(value)


def _shown(value: object) -> str:
    """A plain value as Python writes it; YAML may hide a huge one behind a short text."""
    return repr(value)[:80] if isinstance(value, str | int | float) else type(value).__name__


def _solid(path: Path, *, negate: bool, occupied: float, free: float) -> Mask:
    """Pixels that are not free, as map_server reads them: unknown ones are solid, too."""
    shade = np.asarray(_opened(path), np.float64) / 255.0
    darkness = shade if negate else 1.0 - shade
    return np.asarray((darkness > occupied) | (darkness >= free))


def _opened(path: Path) -> Image:
    from PIL import Image, UnidentifiedImageError

    data = read_plain(path, _MOST_BYTES, follow_link=True)
    try:
        with Image.open(io.BytesIO(data)) as picture:
            if picture.width * picture.height > _MOST_PIXELS:
                raise ConfigError(
                    f"map.file: {path} has {picture.width} x {picture.height} pixels: at most "
                    f"{_MOST_PIXELS} are read"
                )
            flat = Image.new("RGBA", picture.size, "white")  # what is see-through is free
            flat.alpha_composite(picture.convert("RGBA"))
            return flat.convert("L")
    except UnidentifiedImageError as error:
        raise ConfigError(f"map.file: {path} is no picture that Pillow can read") from error
    except (Image.DecompressionBombError, SyntaxError, ValueError) as error:
        raise ConfigError(f"map.file: {path} is no picture: {error}") from error


def _polygons(path: Path, cells: int, half: Any) -> Grid:
    """Solid polygons [m] in an arena of half width ``half``, drawn finely."""
    from PIL import Image, ImageDraw

    if isinstance(half, bool) or not isinstance(half, int | float) or not 0.0 < half < math.inf:
        raise ConfigError(f"arena_half_width_m = {half!r}: must be a length [m]")
    given = parse_json(read_plain(path, MOST_JSON_BYTES, follow_link=True))
    if not isinstance(given, list):
        raise ConfigError(f"map.file: {path}: must be a list of polygons")
    side = cells * _FINE
    picture = Image.new("1", (side, side))
    draw = ImageDraw.Draw(picture)
    for index, polygon in enumerate(given):
        if not isinstance(polygon, list) or len(polygon) < 3 or not all(map(_is_place, polygon)):
            raise ConfigError(
                f"map.file: {path}: polygon {index}: must be a list of three places [x, y] or more"
            )
        draw.polygon(list(_pixels(polygon, side, float(half))), fill=1)
    return Grid(np.asarray(picture, np.bool_), None)


def _is_place(given: object) -> bool:
    return (
        isinstance(given, list)
        and len(given) == 2
        and all(
            isinstance(one, int | float) and not isinstance(one, bool) and abs(one) <= 1e6
            for one in given
        )
    )


def _pixels(
    polygon: Iterable[list[float]], side: int, half: float
) -> Iterable[tuple[float, float]]:
    for x, y in polygon:
        yield (x / half + 1.0) / 2.0 * side - 0.5, (1.0 - y / half) / 2.0 * side - 0.5
