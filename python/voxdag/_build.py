"""Builds DAGs of scenes, which are files or meshes in memory, and estimates the cost of builds."""

from __future__ import annotations

import json
import operator
import os
import tempfile
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Callable, SupportsIndex, Union

import numpy as np

from . import _native
from ._error import Error, Path, path_text
from ._laz import decompressed
from ._options import PATHS, BuildOptions

if TYPE_CHECKING:
    from typing_extensions import Unpack

# Vertices, (N, 3) numbers, and triangles, (M, 3) integers: the indexes of their three vertices.
Mesh = tuple[Any, Any]
Scene = Union[Path, Sequence[Path], Mesh]
# A function that is called with the stage's name, the number of units done, the total number of
# units (0 if unknown) and the unit's name, such as "triangles".
Progress = Callable[[str, int, int, str], None]
_Arrays = tuple[np.ndarray, np.ndarray]


def build(
    scene: Scene,
    *,
    resolution: SupportsIndex,
    output: Path,
    progress: Progress | None = None,
    **options: Unpack[BuildOptions],
) -> dict[str, Any]:
    """Builds the DAG of a scene, or resumes an interrupted build, and returns its report.

    scene             one file, several files that are one scene together, or a mesh in memory: a
                      tuple of vertices (N, 3), which keep the precision of float32 or float64,
                      and triangles (M, 3), the indexes of their vertices; do not change these
                      arrays before build() returns. A LAZ file is decompressed to a temporary LAS
                      file next to the output, which needs laspy and lazrs
    resolution        voxels per edge of the grid, a power of two from 4 to 2^20
    output            the .vdag file to write
    progress          called up to 20 times a second; if it raises an exception, build() cancels
                      the build and raises the exception

    The report has the same names as the JSON of `voxdag build --json`. Raises Error. Further
    options:

    """
    output = path_text(output)
    las_prefix = f"{output}.laz-"
    return _call(_native.build, scene, resolution, output, progress, options, las_prefix)


def plan(
    scene: Scene,
    *,
    resolution: SupportsIndex,
    output: Path | None = None,
    progress: Progress | None = None,
    **options: Unpack[BuildOptions],
) -> dict[str, Any]:
    """Estimates the cost of a build and creates no files. The arguments are the arguments of
    build(); `output` is optional. The estimate has the same names as the JSON of
    `voxdag plan --json`. Further options:

    """
    output = "voxdag-plan" if output is None else path_text(output)
    with tempfile.TemporaryDirectory(prefix="voxdag-") as folder:
        return _call(_native.plan, scene, resolution, output, progress, options, f"{folder}/")


for _function in (build, plan):
    _options_text = (BuildOptions.__doc__ or "").partition("\n\n")[2]
    _function.__doc__ = (_function.__doc__ or "").rstrip() + "\n\n" + _options_text


def _call(
    function: Callable[..., str],
    scene: Scene,
    resolution: SupportsIndex,
    output: str,
    progress: Progress | None,
    options: BuildOptions,
    las_prefix: str,
) -> Any:
    resolution = operator.index(resolution)
    if not 0 < resolution < 1 << 63:
        raise Error(
            f"resolution={resolution}: expected a power of two from 4 to 2^20", "invalid_input"
        )
    if progress is not None and not callable(progress):
        raise TypeError(f"progress={progress!r}: expected a function or None")
    given: dict[str, Any] = {**options, "output": output}
    if given.get("bounds") is not None:
        given["bounds"] = [float(number) for number in given["bounds"]]
    if isinstance(given.get("solid"), bool):  # True is the recommended rule
        given["solid"] = "winding" if given["solid"] else None
    for name in PATHS:
        if given.get(name) is not None:
            given[name] = path_text(given[name])
    files, mesh = _parts_of(scene)
    with decompressed(files, las_prefix) as readable:
        return json.loads(function(readable, mesh, resolution, progress, given))


def _parts_of(scene: Scene) -> tuple[list[str], _Arrays | None]:
    """Returns the paths of a scene's files and None, or an empty list and the scene's mesh."""
    if isinstance(scene, (str, bytes, os.PathLike)):
        return [path_text(scene)], None
    if _is_mesh(scene):
        return [], _mesh_arrays(*scene)
    return [path_text(file) for file in scene], None


def _is_mesh(scene: Scene) -> bool:
    return (
        isinstance(scene, (tuple, list))
        and len(scene) == 2
        and not any(isinstance(part, (str, bytes, os.PathLike)) for part in scene)
    )


def _mesh_arrays(vertices: Any, triangles: Any) -> _Arrays:
    """Checks a mesh. Returns its arrays with the types that the native module requires."""
    vertices, triangles = np.asarray(vertices), np.asarray(triangles)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or vertices.dtype.kind not in "fiu":
        raise Error(
            f"the vertices are an array {vertices.shape} of {vertices.dtype}: "
            "expected (N, 3) numbers",
            "invalid_input",
        )
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise Error(
            f"the triangles are an array {triangles.shape} of {triangles.dtype}: "
            "expected (M, 3) integers",
            "invalid_input",
        )
    if len(vertices) > (1 << 32) - 2:
        raise Error(f"the mesh has {len(vertices)} vertices: expected at most 2^32 - 2", "limit")
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(vertices)):
        bad = np.flatnonzero(((triangles < 0) | (triangles >= len(vertices))).any(axis=1))[0]
        raise Error(
            f"triangle {bad} has the vertices {triangles[bad].tolist()}: expected numbers from 0 "
            f"to below {len(vertices)}, the number of vertices",
            "invalid_input",
        )
    is_float = vertices.dtype == np.float32
    return (
        np.ascontiguousarray(vertices, dtype=np.float32 if is_float else np.float64),
        np.ascontiguousarray(triangles, dtype=np.uint32),
    )
