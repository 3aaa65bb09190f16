"""Makes files from finished .vdag files: extracts, set operations, and exports to formats of other
programs."""

import json
import os
import shutil
import tempfile
from collections.abc import Sequence
from typing import Literal, Optional, Union, cast

from . import _native
from ._dag import Dag
from ._error import Error, Path, memory_text, path_text, thread_count
from ._progress import Progress, shown
from ._types import ExportReport, ExtractReport, Region

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
    """Writes a part of a .vdag file as a new .vdag file: a region, a coarser grid, or a region of a
    coarser grid.

    path, output          the .vdag file to read, and the .vdag file to write
    region, level, world  the part to write, as in Dag
    crop                  make the smallest octree-aligned cube around the region the new grid
    majority              set a cell of a coarser level if at least half of its voxels are set, not
                          if any is; the volume of a solid hardly changes
    memory                limit of the memory in bytes, or text such as "8GiB"; by default half of
                          the machine's memory
    threads               number of threads; 0 means all cores
    force                 replace an existing output
    progress              as in build()

    Returns counts, bounds and the SHA-256 of the new file. Raises Error.
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
    force: bool = False,
    progress: Progress = None,
) -> ExportReport:
    """Writes a .vdag file, or a part of it, in the format of another program (docs/export.md).

    path, output          the .vdag file to read, and the file to write
    to                    the format, one of export_formats(); by default the ending of `output`
                          names it, such as .ply or .vox
    region, level, world  the part to write, as in Dag
    memory                limit of the memory in bytes, or text such as "8GiB"; by default half of
                          the machine's memory
    gray                  leave out the colors that the file may have
    force                 replace existing files
    progress              as in build()

    Returns a dict: "files", the written files; "bytes", their total size; "voxels", the number of
    voxels; "notes", sentences on how to use the files. Raises Error.
    """
    path, output = path_text(path), path_text(output)
    to = _format_of(output) if to is None else to
    files = _native.export_paths(to, output)
    _check_output(path, files, force)
    with Dag(path) as dag:
        low, high = dag._region(region, level, world)
        levels = dag._levels(level)
    with shown(progress) as callback:
        report = _native.export(
            path, output, to, levels, low, high, memory_text(memory), gray, force, callback
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
    memory: Union[int, str, None] = None,
    threads: int = 0,
    force: bool = False,
    progress: Progress = None,
) -> Dag:
    """Writes the union, difference, intersection or symmetric difference of two .vdag files of the
    same grid as a new .vdag file, and returns its Dag. `a | b`, `a - b`, `a & b` and `a ^ b` do the
    same for two Dags.

    a, b       .vdag files or Dags without colors and other attributes
    operation  "union", "minus", "and" or "xor"
    output     the .vdag file to write; by default a temporary file, which is removed when the Dag
               is closed or no longer used
    offset     the voxel of a's grid to which voxel 0, 0, 0 of b comes; then only the sizes of the
               voxels must be equal
    clip       drop the voxels that `offset` moves out of the grid; by default they are an error
    memory     limit of the memory in bytes, or text such as "8GiB"; by default half of the
               machine's memory
    threads    number of threads; 0 means all cores
    force      replace an existing output
    progress   as in build()

    Raises Error.
    """
    paths = path_text(a), path_text(b)
    moved = None if offset is None else _voxel_of(offset)
    folder = tempfile.mkdtemp(prefix="voxdag-") if output is None else None
    path = f"{folder}/combined.vdag" if output is None else path_text(output)
    try:
        with shown(progress) as callback:
            _native.combine(
                *paths,
                operation,
                path,
                moved,
                clip,
                memory_text(memory),
                thread_count(threads),
                force,
                callback,
            )
        return Dag(path) if folder is None else Dag._temporary(path, folder)
    except BaseException:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
        raise


def export_formats() -> dict[str, str]:
    """Returns the names of the formats of export(), with a description of each."""
    return {name: summary for name, summary, _ in _native.export_formats()}


def _format_of(output: str) -> str:
    """Returns the format that the ending of a file's name names."""
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


def _voxel_of(offset: tuple[int, int, int]) -> tuple[int, int, int]:
    try:
        x, y, z = (int(number.__index__()) for number in offset)
    except (AttributeError, TypeError, ValueError):
        raise Error(f"offset={offset!r}: expected three integers", "invalid_input") from None
    return x, y, z
