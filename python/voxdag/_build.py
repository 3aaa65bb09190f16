"""Builds DAGs of scenes, which are files or meshes in memory, and estimates the cost of builds."""

from __future__ import annotations

import contextlib
import json
import operator
import os
import tempfile
from collections.abc import Iterator, Sequence
from typing import IO, TYPE_CHECKING, Any, Callable, SupportsIndex, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _native
from ._adapt import SceneObject, is_mesh, meshes_of
from ._error import Error, Path, path_text
from ._help import lists_options
from ._laz import decompressed
from ._mesh import Mesh, NativeMesh, native_meshes
from ._options import PATHS, BuildOptions
from ._progress import Progress, shown

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._reports import BuildReport
    from ._types import Estimate

_Item = Union[Path, IO[bytes], SceneObject, tuple[ArrayLike, ArrayLike]]
# A scene of build() and plan(): a path, an open binary file, a mesh, or a sequence of these, which
# together form one scene. A mesh is a Mesh, an object of trimesh, Open3D, PyVista or meshio, or a
# tuple (vertices, triangles) of arrays. build() describes these forms.
Scene = Union[_Item, Sequence[_Item]]

# A scene file without triangles, in the format STL.
_NO_TRIANGLES = b"solid\nendsolid\n"


@lists_options(BuildOptions)
def build(
    scene: Scene,
    *,
    resolution: SupportsIndex | None = None,
    output: Path,
    progress: Progress = None,
    **options: Unpack[BuildOptions],
) -> BuildReport:
    """Builds the DAG of a scene, writes it to a .vdag file, and returns a report of the build.

    If a build is interrupted, the same call resumes it.

    scene             a path, an open binary file, a mesh, or a list of these, which together form
                      one scene
    resolution        number of voxels per edge of the grid: a power of two from 4 to 2^20. Without
                      it, the option `voxel_size` is required, and the resolution is the smallest
                      that fits the scene.
    output            path of the .vdag file to write
    progress          a function that build() calls up to 20 times a second, or True to show a
                      progress bar (see Progress). If the function raises an exception, build()
                      cancels the build and raises this exception.

    docs/scenes.md describes the formats of scene files. build() reads an open binary file, such as
    io.BytesIO, into memory. A LAZ file requires the packages laspy and lazrs; build() decompresses
    it to a temporary LAS file next to the output.

    A mesh is a Mesh; an object of trimesh (Trimesh, Scene or PointCloud), Open3D (TriangleMesh or
    PointCloud), PyVista (PolyData or a grid) or meshio (Mesh); or a tuple (vertices, triangles).
    In the tuple, `vertices` is an array (N, 3) of numbers; float64 is not rounded to float32.
    `triangles` is an array (M, 3) of integers: for each triangle, the indexes of its three
    vertices. Do not change the arrays before build() returns.

    The report is a dict with the same members as the JSON object that `voxdag build --json` prints.
    Raises Error if an argument is invalid or the build fails. Further options:

    """
    output = path_text(output)
    las_prefix = f"{output}.laz-"
    report: BuildReport = _call(
        _native.build, scene, resolution, output, progress, options, las_prefix
    )
    return report


@lists_options(BuildOptions)
def plan(
    scene: Scene,
    *,
    resolution: SupportsIndex | None = None,
    output: Path | None = None,
    progress: Progress = None,
    **options: Unpack[BuildOptions],
) -> Estimate:
    """Estimates the time, memory, disk space and file size of a build, without writing its output.

    The arguments are the same as for build(), but `output` is optional. plan() decompresses LAZ
    files to the system's folder for temporary files. The estimate is a dict with the same members
    as the JSON object that `voxdag plan --json` prints. Raises Error if an argument is invalid or
    the estimate fails. Further options:

    """
    output = "voxdag-plan" if output is None else path_text(output)
    with tempfile.TemporaryDirectory(prefix="voxdag-") as folder:
        estimate: Estimate = _call(
            _native.plan, scene, resolution, output, progress, options, f"{folder}/"
        )
        return estimate


def _call(
    function: Callable[..., str],
    scene: Scene,
    resolution: SupportsIndex | None,
    output: str,
    progress: Progress,
    options: BuildOptions,
    las_prefix: str,
) -> Any:
    edge = _edge_of(resolution, options)
    given: dict[str, Any] = {**options, "output": output}
    if given.get("bounds") is not None:
        given["bounds"] = [float(number) for number in given["bounds"]]
    if isinstance(given.get("solid"), bool):  # True is the recommended rule
        given["solid"] = "winding" if given["solid"] else None
    for name in PATHS:
        if given.get(name) is not None:
            given[name] = path_text(given[name])
    with_colors = any(given.get(name) for name in ("color", "attributes", "cutouts"))
    prepared = native_scene(scene, with_colors, las_prefix, bool(given.get("skip_invalid")))
    with prepared as parts, shown(progress) as callback:
        return json.loads(function(*parts, edge, callback, given))


# The parts of a scene in the form that the native module requires: paths, files in memory, meshes.
_NativeScene = tuple[list[str], list[tuple[str, bytes]], list[NativeMesh]]


def native_scene(
    scene: Scene, with_colors: bool, las_prefix: str, skip_invalid: bool = False
) -> contextlib.AbstractContextManager[_NativeScene]:
    """Returns a context manager that provides the parts of a scene for the native module. Meshes
    have no colors unless `with_colors` is True. LAS files whose paths begin with `las_prefix`
    replace LAZ files until the end of the context."""
    files, streams, meshes = _parts_of(scene)
    contents = [(f"file in memory {i}", _bytes_of(stream)) for i, stream in enumerate(streams)]
    arrays = []
    for mesh, native in zip(meshes, native_meshes(meshes, with_colors, skip_invalid)):
        # The native module takes the vertices of a mesh without triangles as points.
        if mesh.triangles is not None and len(mesh.triangles) == 0:
            contents.append((native[0], _NO_TRIANGLES))
        else:
            arrays.append(native)
    return _with_las(files, las_prefix, contents, arrays)


@contextlib.contextmanager
def _with_las(
    files: list[str], las_prefix: str, contents: list[tuple[str, bytes]], meshes: list[NativeMesh]
) -> Iterator[_NativeScene]:
    with decompressed(files, las_prefix) as readable:
        yield readable, contents, meshes


def _edge_of(resolution: SupportsIndex | None, options: BuildOptions) -> int:
    """Returns the resolution; 0 if the build must find it."""
    if resolution is None:
        if options.get("voxel_size") is None:
            raise Error("expected a resolution, or a voxel_size", "invalid_input")
        return 0
    edge = operator.index(resolution)
    if not 0 < edge < 1 << 63:
        raise Error(f"resolution={edge}: expected a power of two from 4 to 2^20", "invalid_input")
    return edge


def _parts_of(scene: Any) -> tuple[list[str], list[IO[bytes]], list[Mesh]]:
    """Returns three lists: the paths, the open files and the meshes of a scene."""
    if _is_pair_of_arrays(scene) and not all(_is_mesh_tuple(item) for item in scene):
        return [], [], [Mesh(*scene)]
    paths: list[str] = []
    streams: list[IO[bytes]] = []
    meshes: list[Mesh] = []
    for item in [scene] if _is_part(scene) else _items_of(scene):
        if is_mesh(item):
            meshes += meshes_of(item)
        elif _is_mesh_tuple(item):
            meshes.append(Mesh(*item))
        elif hasattr(item, "read"):
            streams.append(item)
        else:
            paths.append(path_text(item))
    return paths, streams, meshes


def _items_of(scene: Any) -> list[Any]:
    try:
        return list(scene)
    except TypeError:
        raise TypeError(
            f"the scene is a {type(scene).__name__}: expected a path, a mesh (vertices and "
            "triangles, or an object that has them), or a list of these"
        ) from None


def _bytes_of(stream: IO[bytes]) -> bytes:
    data = stream.read()
    if not isinstance(data, bytes):
        raise TypeError(
            f"{stream!r} gives {type(data).__name__}: expected a file open in binary mode"
        )
    return data


def _is_part(scene: Any) -> bool:
    """True for a path, an open file or a mesh."""
    return isinstance(scene, (str, bytes, os.PathLike)) or hasattr(scene, "read") or is_mesh(scene)


def _is_mesh_tuple(item: Any) -> bool:
    """True for a tuple (vertices, triangles) in a list of meshes."""
    return isinstance(item, tuple) and _is_pair_of_arrays(item) and np.ndim(item[0]) == 2


def _is_pair_of_arrays(scene: Any) -> bool:
    return (
        isinstance(scene, (tuple, list)) and len(scene) == 2 and not any(_is_part(p) for p in scene)
    )
