"""Writes new files from .vdag files: extracts, results of set operations, edited copies, copies in
another node order, and exports to the formats of other programs."""

import contextlib
import json
import operator
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any, Literal, Optional, SupportsIndex, Union, cast

from . import _native
from ._build import Scene, native_scene
from ._dag import Dag
from ._error import Error, Path, memory_text, path_text, thread_count
from ._progress import Progress, shown
from ._types import ExportReport, ExtractReport, NodeOrder, Region, ReorderReport

Operation = Literal["union", "minus", "and", "xor"]


def extract(
    path: Path,
    output: Path,
    *,
    region: Optional[Region] = None,
    level: Optional[int] = None,
    world: bool = False,
    crop: bool = False,
    majority: bool = False,
    memory: Union[int, str, None] = None,
    threads: int = 0,
    force: bool = False,
    progress: Progress = None,
) -> ExtractReport:
    """Writes a part of a .vdag file as a new .vdag file, and returns a report. The part is a
    region, a coarser grid, or a region of a coarser grid.

    path, output          the .vdag file to read, and the .vdag file to write
    region, level, world  select the part, as described in class Dag. The coarsest grid has 4 cells
                          per edge (level 2).
    crop                  if True, the grid of the new file is the smallest octree-aligned cube
                          around the region. By default, the new file has the complete grid.
    majority              if True, a cell of a coarser grid is set if at least half of its voxels
                          are set. So the volume of a solid hardly changes. By default, a cell is
                          set if any of its voxels is set.
    memory                memory limit, as a number of bytes or as text such as "8GiB". The default
                          is half of the machine's memory.
    threads               number of threads; 0 means all cores
    force                 if True, replaces an existing output
    progress              as in build()

    Raises Error if an argument is invalid, if the selected part is outside the grid, if the output
    exists, if the file has attributes and `majority` is True, or if the extract fails.
    """
    path, output = path_text(path), path_text(output)
    _check_output(path, [output], force)
    with Dag(path) as dag:
        low, high = dag._region(region, level, world)
        levels = dag._levels(level)
    with shown(progress) as callback:
        report = _native.extract(
            path,
            output,
            levels,
            low,
            high,
            crop,
            majority,
            memory_text(memory),
            thread_count(threads),
            force,
            callback,
        )
    return cast(ExtractReport, json.loads(report))


def export(
    path: Path,
    output: Path,
    *,
    to: Optional[str] = None,
    region: Optional[Region] = None,
    level: Optional[int] = None,
    world: bool = False,
    memory: Union[int, str, None] = None,
    gray: bool = False,
    up: Optional[str] = None,
    grid: Optional[str] = None,
    band: Optional[int] = None,
    compact: bool = False,
    outside: bool = False,
    watertight: bool = False,
    force: bool = False,
    progress: Progress = None,
) -> ExportReport:
    """Writes a .vdag file, or a part of it, in the format of another program, and returns a report.
    docs/export.md describes the formats.

    path, output          the .vdag file to read, and the file to write. Some formats write a second
                          file next to `output`.
    to                    name of the format, as in export_formats(). By default, the extension of
                          `output`, such as .ply or .vox, determines the format.
    region, level, world  select the part, as described in class Dag. The coarsest grid has 4 cells
                          per edge (level 2).
    memory                memory limit, as a number of bytes or as text such as "8GiB". The default
                          is half of the machine's memory.
    gray                  if True, omits the colors of the file
    up                    "y" or "z": the axis of the exported file that gets the y axis of the
                          .vdag file. The default is "z" for vox, and "y" for the other formats.
    grid                  for vdb and nvdb: "density" (the default), "mask", or "sdf", the distance
                          to the surface of a solid
    band                  with grid="sdf": the largest distance, in voxels, 1 to 16. The default is
                          3.
    compact               for npz: if True, omits the positions, which can be computed from the
                          cells
    outside               for glb: if True, writes only the faces that are visible from outside
    watertight            for glb: if True, writes a closed mesh without T-junctions
    force                 if True, replaces existing files
    progress              as in build()

    Raises Error if an argument is invalid, if the selected part is outside the grid, if an output
    exists, if the format cannot store the selected voxels, or if the export fails.
    """
    path, output = path_text(path), path_text(output)
    to = _format_of(output) if to is None else to
    options = {
        "up": up,
        "grid": grid,
        "band": band,
        "compact": bool(compact),
        "outside": bool(outside),
        "watertight": bool(watertight),
    }
    given = json.dumps({name: value for name, value in options.items() if value is not None})
    files = _native.export_paths(to, output)
    _check_output(path, files, force)
    with Dag(path) as dag:
        low, high = dag._region(region, level, world)
        levels = dag._levels(level)
    with shown(progress) as callback:
        report = _native.export(
            path, output, to, levels, low, high, memory_text(memory), gray, force, given, callback
        )
    return cast(ExportReport, {"files": files, **json.loads(report)})


def combine(
    a: Path,
    b: Path,
    operation: Operation,
    output: Optional[Path] = None,
    *,
    offset: Optional[tuple[int, int, int]] = None,
    clip: bool = False,
    fill_color: Optional[tuple[int, int, int]] = None,
    color_resolution: int = 0,
    no_attributes: bool = False,
    memory: Union[int, str, None] = None,
    threads: int = 0,
    force: bool = False,
    progress: Progress = None,
) -> Dag:
    """Combines two .vdag files into a new .vdag file, and returns its Dag. For two Dags, `a | b`,
    `a - b`, `a & b` and `a ^ b` do the same.

    a, b              two .vdag files, as paths or Dags. Without `offset`, they must have the same
                      grid. They must have been built with the same `hash_bits`. The result also has
                      colors and other attributes: a cell has the value of `a` if `a` has a voxel in
                      it, otherwise the value of `b`. For "union" and "xor", both files must have
                      the same attributes.
    operation         "union" sets the voxels that are set in `a` or in `b`, "minus" the voxels that
                      are set in `a` but not in `b`, "and" the voxels that are set in both files,
                      and "xor" the voxels that are set in exactly one of the files.
    output            the .vdag file to write. By default it is a temporary file, which is removed
                      when the Dag is closed or no longer used.
    offset            three integers. They move `b`, so that its voxel 0, 0, 0 comes to this voxel
                      of the grid of `a`. Then the grids may differ, but their voxels must have the
                      same size.
    clip              if True, drops the voxels of `b` that `offset` moves out of the grid of `a`.
                      By default, such voxels are an error.
    fill_color        for "union" and "xor", if only one file has colors: the color of the cells in
                      which this file has no voxel, as three integers from 0 to 255 (sRGB)
    color_resolution  maximum number of color cells per edge of the result's grid, a power of two; 0
                      means as many as the finest color cells of the files need
    no_attributes     if True, the result has no colors and other attributes
    memory            memory limit, as a number of bytes or as text such as "8GiB". The default is
                      half of the machine's memory.
    threads           number of threads; 0 means all cores
    force             if True, replaces an existing output
    progress          as in build()

    Raises Error if an argument is invalid, if `a` and `b` do not meet these conditions, if the
    output exists, or if the operation fails.
    """
    paths = path_text(a), path_text(b)
    moved = None if offset is None else _voxel_of(offset, "offset")
    fill = None if fill_color is None else _color_of(fill_color)
    cells = _cells_of(color_resolution)
    with _new_file(output, "combined.vdag") as new, shown(progress) as callback:
        _native.combine(
            *paths,
            operation,
            new.path,
            moved,
            clip,
            fill,
            cells,
            bool(no_attributes),
            memory_text(memory),
            thread_count(threads),
            force,
            callback,
        )
        return new.open()


def edit(
    path: Path,
    output: Optional[Path] = None,
    *,
    cut: Union[str, Sequence[str]] = (),
    add: Optional[Scene] = None,
    paste: Sequence[tuple[Path, tuple[int, int, int]]] = (),
    dilate: SupportsIndex = 0,
    erode: SupportsIndex = 0,
    outside_set: bool = False,
    clip: bool = False,
    fill_color: Optional[tuple[int, int, int]] = None,
    color_resolution: int = 0,
    no_attributes: bool = False,
    memory: Union[int, str, None] = None,
    threads: int = 0,
    force: bool = False,
    progress: Progress = None,
) -> Dag:
    """Writes a changed copy of a .vdag file, and returns its Dag. The edits are applied in this
    order: cut, add, paste, dilate or erode. Unless the file is only dilated or eroded, its nodes
    must have the order "hash".

    path, output      the .vdag file to read, and the .vdag file to write. By default, the output is
                      a temporary file, which is removed when the Dag is closed or no longer used.
    cut               a shape, or a list of shapes. All voxels whose centers are in a shape are
                      removed. A shape is a string: "sphere:X,Y,Z,R" with multiples of 0.5, or
                      "box:X0,Y0,Z0,X1,Y1,Z1" with whole numbers, both in voxels of the grid. The
                      center of voxel 0, 0, 0 is 0.5, 0.5, 0.5. A box does not contain the voxels of
                      its high corner.
    add               a scene to add, in one of the forms that build() takes. It is built with the
                      grid and the attributes of the file. Triangles outside the grid are left out.
    paste             a list of pairs (file, (x, y, z)). The voxels of the file, a path or a Dag,
                      are added, so that its voxel 0, 0, 0 comes to the voxel x, y, z. The voxels of
                      both files must have the same size.
    dilate, erode     a number of voxels N, at most 2^20; 0 means no change. See Dag.dilate() and
                      Dag.erode(). Only one of them can be given.
    outside_set       with `erode`: if True, voxels outside the grid count as set
    clip              if True, drops voxels that `paste` puts outside the grid. By default, such
                      voxels are an error.
    fill_color        if only one of the files has colors: the color of the cells in which this file
                      has no voxel, as three integers from 0 to 255 (sRGB)
    color_resolution  maximum number of color cells per edge of the grid, a power of two; 0 means as
                      many as the finest color cells of the files need
    no_attributes     if True, the result has no colors and other attributes
    memory            memory limit, as a number of bytes or as text such as "8GiB". The default is
                      half of the machine's memory.
    threads           number of threads; 0 means all cores
    force             if True, replaces an existing output
    progress          as in build()

    Raises Error if no edit is given, if an argument is invalid, if a file cannot be pasted, if the
    output exists, or if the edit fails.
    """
    path = path_text(path)
    shapes = [cut] if isinstance(cut, str) else [str(shape) for shape in cut]
    parts = [(path_text(part), _voxel_of(offset, "paste")) for part, offset in _pairs_of(paste)]
    fill = None if fill_color is None else _color_of(fill_color)
    cells = _cells_of(color_resolution)
    distances = distance_of(dilate, "dilate"), distance_of(erode, "erode")
    with Dag(path) as dag:
        with_colors = bool(dag.attributes) and not no_attributes
    with _new_file(output, "edited.vdag") as new:
        las_prefix = f"{new.path}.laz-"
        scene = native_scene(() if add is None else add, with_colors, las_prefix)
        with scene as scene_parts, shown(progress) as callback:
            _native.edit(
                path,
                new.path,
                shapes,
                *scene_parts,
                parts,
                *distances,
                bool(outside_set),
                clip,
                fill,
                cells,
                bool(no_attributes),
                memory_text(memory),
                thread_count(threads),
                force,
                callback,
            )
        return new.open()


def reorder(
    path: Path,
    output: Path,
    *,
    order: NodeOrder = "first-parent",
    memory: Union[int, str, None] = None,
    threads: int = 0,
    force: bool = False,
    progress: Progress = None,
) -> ReorderReport:
    """Writes a copy of a .vdag file with its nodes in another order, and returns a report. The copy
    has the same voxels, colors and other attributes, and the same size.

    path, output  the .vdag file to read, and the .vdag file to write
    order         "first-parent" or "hash". Files in the order "first-parent" are faster to read:
                  rays, lookups, pictures and exports. combine() needs files in the order "hash",
                  which build() writes by default.
    memory        memory limit, as a number of bytes or as text such as "8GiB". The default is half
                  of the machine's memory.
    threads       number of threads; 0 means all cores
    force         if True, replaces an existing output
    progress      as in build()

    Raises Error if an argument is invalid, if the output exists, or if the file is damaged.
    """
    path, output = path_text(path), path_text(output)
    _check_output(path, [output], force)
    with shown(progress) as callback:
        report = _native.reorder(
            path, output, order, memory_text(memory), thread_count(threads), force, callback
        )
    return cast(ReorderReport, json.loads(report))


def export_formats() -> dict[str, str]:
    """Returns a dict from the name of each export format to its description. It has only the
    formats whose libraries this copy of voxdag contains."""
    return {name: summary for name, summary, _ in _native.export_formats()}


def _format_of(output: str) -> str:
    """Returns the name of the format whose extension the file name `output` has."""
    endings = {name: suffix or f".{name}" for name, _, suffix in _native.export_formats()}
    for name, ending in endings.items():
        if output.endswith(ending):
            return name
    raise Error(
        f"{output}: expected a name that ends with one of {', '.join(endings.values())}, or to=",
        "invalid_input",
    )


def _check_output(path: str, outputs: Sequence[str], force: bool) -> None:
    for output in outputs:
        if not os.path.lexists(output):
            continue
        if os.path.exists(output) and os.path.exists(path) and os.path.samefile(path, output):
            raise Error(f"{output} is the input: expected another file", "invalid_input")
        if not force and not (os.path.isfile(output) and os.path.getsize(output) == 0):
            raise Error(f"{output} exists: expected another file, or force=True", "invalid_input")


class _NewFile:
    """The .vdag file that a function writes. Without an output, it is a temporary file."""

    def __init__(self, output: Optional[Path], name: str) -> None:
        self._folder = tempfile.mkdtemp(prefix="voxdag-") if output is None else None
        self.path = f"{self._folder}/{name}" if output is None else path_text(output)

    def open(self) -> Dag:
        return Dag(self.path) if self._folder is None else Dag._temporary(self.path, self._folder)

    def remove(self) -> None:
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)


@contextlib.contextmanager
def _new_file(output: Optional[Path], name: str) -> Iterator[_NewFile]:
    """Provides a _NewFile, whose temporary folder is removed if the context raises an exception."""
    new = _NewFile(output, name)
    try:
        yield new
    except BaseException:
        new.remove()
        raise


def distance_of(voxels: SupportsIndex, name: str, least: int = 0) -> int:
    """Returns the distance of a dilation or an erosion, the argument `name`, as an int. Raises
    Error if it is less than `least` or too large."""
    distance = operator.index(voxels)
    if not least <= distance <= 1 << 20:
        raise Error(f"{name}={distance}: expected {least} to 2^20", "invalid_input")
    return distance


def _pairs_of(paste: Sequence[tuple[Path, tuple[int, int, int]]]) -> list[tuple[Any, Any]]:
    try:
        return [(part, offset) for part, offset in paste]
    except (TypeError, ValueError):
        raise Error(
            f"paste={paste!r}: expected a list of pairs (file, (x, y, z))", "invalid_input"
        ) from None


def _cells_of(color_resolution: int) -> int:
    cells = operator.index(color_resolution)
    if not 0 <= cells <= 1 << 20:
        raise Error(f"color_resolution={cells}: expected at most 2^20", "invalid_input")
    return cells


def _voxel_of(offset: tuple[int, int, int], name: str) -> tuple[int, int, int]:
    try:
        x, y, z = (int(number.__index__()) for number in offset)
    except (AttributeError, TypeError, ValueError):
        raise Error(f"{name}={offset!r}: expected three integers", "invalid_input") from None
    if any(abs(number) >= 1 << 63 for number in (x, y, z)):
        raise Error(f"{name}={offset!r}: expected integers of 64 bits", "invalid_input")
    return x, y, z


def _color_of(color: tuple[int, int, int]) -> tuple[int, int, int]:
    try:
        r, g, b = (int(channel.__index__()) for channel in color)
    except (AttributeError, TypeError, ValueError):
        r = g = b = -1
    if not all(0 <= channel <= 255 for channel in (r, g, b)):
        raise Error(f"fill_color={color!r}: expected three integers from 0 to 255", "invalid_input")
    return r, g, b
