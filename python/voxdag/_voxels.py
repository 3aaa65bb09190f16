"""Builds DAGs from points, voxels and dense arrays."""

from __future__ import annotations

import math
import shutil
import tempfile
import warnings
from typing import TYPE_CHECKING, Any, SupportsIndex, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._build import build
from ._dag import Dag
from ._error import Error, Path, path_text
from ._help import lists_options
from ._mesh import Mesh
from ._options import BuildOptions, VoxelOptions
from ._progress import Progress

if TYPE_CHECKING:
    from typing_extensions import Unpack

_MIN_RESOLUTION, _MAX_RESOLUTION = 4, 1 << 20
# Up to this distance from 0, a double is at most 1/32 of a voxel away from the center of a voxel.
_MAX_VOXELS_FROM_ZERO = 1 << 48


@lists_options(VoxelOptions)
def from_points(
    points: ArrayLike,
    voxel_size: float,
    colors: ArrayLike | None = None,
    *,
    origin: ArrayLike | None = None,
    resolution: SupportsIndex | None = None,
    output: Path | None = None,
    progress: Progress = None,
    **options: Unpack[VoxelOptions],
) -> Dag:
    """Builds a DAG in which the voxels that contain points are set, and returns its Dag.

    points       array (N, 3) of numbers. The point p sets the voxel
                 floor((p - origin) / voxel_size).
    voxel_size   length of a voxel's edge, in the units of the points
    colors       array (N, 3) or (N, 4): red, green, blue and optionally alpha of each point, as
                 integers from 0 to 255 or floats from 0 to 1. Colors are in sRGB. A voxel has the
                 mean color of its points, in linear light.
    origin       low corner of the grid, as x, y, z. By default, each of its coordinates is the
                 largest multiple of voxel_size that is not above any point.
    resolution   number of voxels per edge of the grid, a power of two from 4 to 2^20. The default
                 is the smallest that fits.
    output       the .vdag file to write. By default it is a temporary file, which is removed when
                 the Dag is closed or no longer used.
    progress     as in build()

    Raises Error if a point is not finite or outside the grid, if another argument is invalid, or if
    the build fails. Further options:

    """
    positions = _points_of(points)
    size = _size_of(voxel_size)
    if origin is not None:
        low = _origin_of(origin)
    elif len(positions):
        low = np.floor(positions.min(axis=0) / size) * size
    else:
        low = np.zeros(3)
    cells = np.floor((positions - low) / size)
    if len(cells) and (cells.min() < 0 or cells.max() >= _MAX_RESOLUTION):
        bad = np.flatnonzero(((cells < 0) | (cells >= _MAX_RESOLUTION)).any(axis=1))[0]
        raise Error(
            f"points[{bad}] is {positions[bad].tolist()}, in the voxel "
            f"{[int(c) for c in cells[bad]]}: expected voxels from 0 to {_MAX_RESOLUTION - 1}; the "
            f"origin is {low.tolist()}",
            "invalid_input",
        )
    return _dag_of(cells, colors, low, size, resolution, output, progress, options)


@lists_options(VoxelOptions)
def from_voxels(
    voxels: ArrayLike,
    colors: ArrayLike | None = None,
    *,
    resolution: SupportsIndex | None = None,
    voxel_size: float = 1,
    origin: ArrayLike = (0, 0, 0),
    output: Path | None = None,
    progress: Progress = None,
    **options: Unpack[VoxelOptions],
) -> Dag:
    """Builds a DAG in which exactly the given voxels are set, and returns its Dag.

    voxels       array (N, 3) of integers from 0 to 2^20 - 1: the positions of the voxels. The same
                 position may occur several times.
    colors       array (N, 3) or (N, 4): red, green, blue and optionally alpha of each voxel, as
                 integers from 0 to 255 or floats from 0 to 1. Colors are in sRGB.
    resolution   number of voxels per edge of the grid, a power of two from 4 to 2^20. The default
                 is the smallest that fits.
    voxel_size   length of a voxel's edge, in the units of the scene
    origin       low corner of the grid, as x, y, z in the units of the scene
    output       the .vdag file to write. By default it is a temporary file, which is removed when
                 the Dag is closed or no longer used.
    progress     as in build()

    Raises Error if an argument is invalid or the build fails. Further options:

    """
    cells = np.asarray(voxels)
    if cells.size == 0:
        cells = np.empty((0, 3), np.int64)
    if cells.ndim != 2 or cells.shape[1] != 3 or cells.dtype.kind not in "iu":
        raise Error(
            f"the voxels are an array {cells.shape} of {cells.dtype}: expected (N, 3) integers",
            "invalid_input",
        )
    size = _size_of(voxel_size)
    low = _origin_of(origin)
    return _dag_of(cells, colors, low, size, resolution, output, progress, options)


def from_dense(
    array: ArrayLike,
    colors: ArrayLike | None = None,
    *,
    resolution: SupportsIndex | None = None,
    voxel_size: float = 1,
    origin: ArrayLike = (0, 0, 0),
    output: Path | None = None,
    progress: Progress = None,
    **options: Unpack[VoxelOptions],
) -> Dag:
    """Builds a DAG from a dense array of voxels, and returns its Dag.

    array        array (X, Y, Z) of bool or numbers. The voxel (x, y, z) is set if array[x, y, z] is
                 not 0.
    colors       array (X, Y, Z, 3) or (X, Y, Z, 4): the colors of the voxels, in the same form as
                 for from_voxels()

    The other arguments are the same as for from_voxels(). Dag.dense() is the inverse of this
    function, except that its array has the size of the grid. Raises Error if an argument is invalid
    or the build fails.
    """
    dense = np.asarray(array)
    if dense.ndim != 3:
        raise Error(f"the array has the shape {dense.shape}: expected (X, Y, Z)", "invalid_input")
    if colors is not None:
        all_colors = np.asarray(colors)
        if all_colors.shape not in ((*dense.shape, 3), (*dense.shape, 4)):
            raise Error(
                f"the colors are an array {all_colors.shape}: expected {(*dense.shape, 3)} or "
                f"{(*dense.shape, 4)}",
                "invalid_input",
            )
        colors = all_colors[dense != 0]
    return from_voxels(
        np.argwhere(dense),
        colors,
        resolution=resolution,
        voxel_size=voxel_size,
        origin=origin,
        output=output,
        progress=progress,
        **options,
    )


def _points_of(points: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(points)
    if array.size == 0:
        return np.empty((0, 3))
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise Error(
            f"the points are an array {array.shape} of {array.dtype}: expected (N, 3) numbers",
            "invalid_input",
        )
    finite = np.isfinite(array).all(axis=1)
    if not finite.all():
        bad = np.flatnonzero(~finite)[0]
        raise Error(f"points[{bad}] is not finite: it is {array[bad].tolist()}", "invalid_input")
    return array.astype(np.float64)


def _size_of(voxel_size: float) -> float:
    size = float(voxel_size)
    if not 0 < size < math.inf:
        raise Error(f"voxel_size={voxel_size!r}: expected a number above 0", "invalid_input")
    return size


def _origin_of(origin: ArrayLike) -> NDArray[np.float64]:
    corner = np.asarray(origin, np.float64)
    if corner.shape != (3,) or not np.isfinite(corner).all():
        raise Error(f"origin={origin!r}: expected x, y, z, all finite", "invalid_input")
    return corner


def _resolution_of(cells: NDArray[Any], given: SupportsIndex | None) -> int:
    """Returns the number of voxels per edge of the grid: `given`, or by default the smallest that
    contains all cells. Raises Error if a cell is outside this grid."""
    if len(cells) and (cells.min() < 0 or cells.max() >= _MAX_RESOLUTION):
        bad = np.flatnonzero(((cells < 0) | (cells >= _MAX_RESOLUTION)).any(axis=1))[0]
        raise Error(
            f"voxels[{bad}] is {cells[bad].tolist()}: expected 0 to {_MAX_RESOLUTION - 1}",
            "invalid_input",
        )
    needed = int(cells.max()) + 1 if len(cells) else 1
    smallest = max(_MIN_RESOLUTION, 1 << (needed - 1).bit_length())
    if given is None:
        return smallest
    if given.__index__() < smallest:
        raise Error(
            f"resolution={given}: expected at least {smallest}, the smallest grid that contains "
            "all voxels",
            "invalid_input",
        )
    return given.__index__()


def _dag_of(
    cells: NDArray[Any],
    colors: ArrayLike | None,
    origin: NDArray[np.float64],
    voxel_size: float,
    given_resolution: SupportsIndex | None,
    output: Path | None,
    progress: Progress,
    options: VoxelOptions,
) -> Dag:
    """Builds a DAG in which `cells` are set. The scene of the build has a point in the center of
    each cell."""
    for name in options:
        if name not in VoxelOptions.__annotations__:
            raise TypeError(f"unexpected keyword argument {name!r}")
    resolution = _resolution_of(cells, given_resolution)
    farthest = max(np.abs(origin).max(), np.abs(origin + voxel_size * resolution).max())
    if farthest > voxel_size * _MAX_VOXELS_FROM_ZERO:
        raise Error(
            f"the grid from {origin.tolist()} reaches the coordinate {farthest:g}: expected at "
            f"most 2^48 times the voxel size, {voxel_size:g}, because numbers of 64 bits are too "
            "imprecise there",
            "invalid_input",
        )
    chosen = cast(BuildOptions, {"allow_empty": True, **options})
    if colors is not None:
        chosen["color"] = True
    chosen["bounds"] = [*origin.tolist(), voxel_size * resolution]
    # Without cells, the scene is a point outside of the grid, because it must not be empty.
    centers = (cells + 0.5) * voxel_size + origin if len(cells) else origin[None] - voxel_size
    scene = Mesh(centers, colors=colors if len(cells) else None)
    folder = tempfile.mkdtemp(prefix="voxdag-") if output is None else None
    path = f"{folder}/voxels.vdag" if output is None else path_text(output)
    try:
        with warnings.catch_warnings():
            if len(cells) == 0:
                warnings.filterwarnings("ignore", "mesh in memory: .* all outside the grid")
            warnings.filterwarnings("ignore", ".*the scene has no colors")  # white is a color here
            build(scene, resolution=resolution, output=path, progress=progress, **chosen)
        return Dag(path) if folder is None else Dag._temporary(path, folder)
    except BaseException:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
        raise
