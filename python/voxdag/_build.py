"""Builds from files, and from meshes in memory."""

from __future__ import annotations

import errno
import json
import operator
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, BinaryIO, Callable, Optional, SupportsIndex, Union

import numpy as np

from . import _native
from ._error import Error, Path, path_text
from ._options import PATHS, BuildOptions

if TYPE_CHECKING:
    from typing_extensions import Unpack

# vertices (N, 3) of float, triangles (M, 3) of integers
Mesh = tuple[Any, Any]
Scene = Union[Path, Sequence[Path], Mesh]
# Called with the stage, units done, units in all (0 if unknown) and the unit.
Progress = Callable[[str, int, int, str], None]

# Rows that are converted and written at a time.
_ROWS = 1 << 18


def build(
    scene: Scene,
    *,
    resolution: SupportsIndex,
    output: Path,
    progress: Optional[Progress] = None,
    **options: Unpack[BuildOptions],
) -> dict[str, Any]:
    """Builds the DAG of a scene, or resumes a build that was interrupted, and returns its report.

    scene             one or several files, together one scene, or a mesh in memory: a tuple of
                      vertices (N, 3), of which doubles stay doubles, and of triangles (M, 3)
    resolution        voxels per edge of the grid, a power of two from 4 to 2^20
    output            the .vdag file to write
    progress          called now and then; an exception that it raises cancels the build and is
                      raised here

    The report has the names of `voxdag build --json`. Raises Error. Further options:

    """
    output = path_text(output)
    with _files_of(scene, output) as files:
        return _call(_native.build, files, resolution, output, progress, options)


def plan(
    scene: Scene,
    *,
    resolution: SupportsIndex,
    output: Optional[Path] = None,
    progress: Optional[Progress] = None,
    **options: Unpack[BuildOptions],
) -> dict[str, Any]:
    """Estimates what build() would need; builds nothing. The names are those of
    `voxdag plan --json`. Further options:

    """
    output = "voxdag-plan" if output is None else path_text(output)
    with _files_of(scene, output) as files:
        return _call(_native.plan, files, resolution, output, progress, options)


for _function in (build, plan):
    _options_text = (BuildOptions.__doc__ or "").partition("\n\n")[2]
    _function.__doc__ = (_function.__doc__ or "").rstrip() + "\n\n" + _options_text


def _call(
    function: Callable[..., str],
    files: list[str],
    resolution: SupportsIndex,
    output: str,
    progress: Optional[Progress],
    options: BuildOptions,
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
    for name in PATHS:
        if given.get(name) is not None:
            given[name] = path_text(given[name])
    return json.loads(function(files, resolution, progress, given))


@contextmanager
def _files_of(scene: Scene, output: str) -> Iterator[list[str]]:
    """The files of a scene. A mesh becomes a PLY file next to the output, which is removed."""
    if isinstance(scene, (str, bytes, os.PathLike)):
        yield [path_text(scene)]
    elif _is_mesh(scene):
        _check_mesh(*scene)
        path = _mesh_file(scene, output)
        try:
            yield [path]
        finally:
            os.remove(path)
    else:
        yield [path_text(file) for file in scene]


def _mesh_file(mesh: Sequence[Any], output: str) -> str:
    """Writes a mesh to a new file next to the output, or to a temporary one while that has no
    folder, and returns its path."""
    folder, name = os.path.split(os.path.abspath(output))
    path = None
    try:
        handle, path = tempfile.mkstemp(
            suffix=".ply", prefix=name + ".scene-", dir=folder if os.path.isdir(folder) else None
        )
        with os.fdopen(handle, "wb") as file:
            _write_ply(file, *(np.asarray(part) for part in mesh))
        return path
    except BaseException as error:
        if path is not None:
            os.remove(path)
        if isinstance(error, OSError):
            full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
            raise Error(
                f"the mesh cannot be written as a file: {error}", "no_space" if full else "io"
            ) from error
        raise


def _is_mesh(scene: Scene) -> bool:
    return (
        isinstance(scene, (tuple, list))
        and len(scene) == 2
        and not any(isinstance(part, (str, bytes, os.PathLike)) for part in scene)
    )


def _check_mesh(vertices: Any, triangles: Any) -> None:
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
            f"triangle {bad} has the vertices {triangles[bad].tolist()}: expected 0 to "
            f"{len(vertices) - 1}",
            "invalid_input",
        )


def _write_ply(file: BinaryIO, vertices: np.ndarray, triangles: np.ndarray) -> None:
    file.write(
        (
            f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
            "property double x\nproperty double y\nproperty double z\n"
            f"element face {len(triangles)}\n"
            "property list uchar uint vertex_indices\nend_header\n"
        ).encode()
    )
    for first in range(0, len(vertices), _ROWS):
        file.write(np.ascontiguousarray(vertices[first : first + _ROWS], dtype="<f8").data)
    for first in range(0, len(triangles), _ROWS):
        part = triangles[first : first + _ROWS]
        rows = np.empty(len(part), dtype=[("count", "u1"), ("corners", "<u4", 3)])
        rows["count"] = 3
        rows["corners"] = part
        file.write(rows.data)
