"""An open .vdag file: its life, its properties, and positions in its grid."""

from __future__ import annotations

import hashlib
import os
import shutil
import weakref
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from . import _native
from ._arguments import rows_of
from ._error import Error, Path, path_text
from ._types import Doubles, Integers, Level, Region

if TYPE_CHECKING:
    from typing_extensions import Self

# The header of a .vdag file has checksums of all its other bytes.
_HEADER_BYTES = 4096


class DagFile:
    """The part of Dag that does not read voxels."""

    def __init__(self, path: Path) -> None:
        self.path = path_text(path)
        self._file: _native.Dag | None = _native.Dag(self.path)
        self._digest = _digest_of(self.path)
        self._picture: bytes | None = None
        self._remove: Any | None = None  # removes a temporary file

    @classmethod
    def _temporary(cls, path: str, folder: str) -> Self:
        """Opens the file `path` in the temporary folder `folder`. The folder is removed when the
        Dag is closed or no longer used."""
        dag = cls(path)
        dag._remove = weakref.finalize(dag, shutil.rmtree, folder, True)
        return dag

    def close(self) -> None:
        """Closes the file, and removes it if it is a temporary file. Later queries raise Error."""
        self._file = None
        if self._remove is not None:
            self._remove()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __fspath__(self) -> str:
        return self.path

    def __repr__(self) -> str:
        if self._file is None:
            return f"<voxdag.Dag {self.path!r}, closed>"
        return f"<voxdag.Dag {self.path!r}, {self.resolution}^3, {self.voxels} voxels>"

    @property
    def digest(self) -> str:
        """A hexadecimal number that identifies the contents of the file. It is the SHA-256 of the
        file's header, which contains checksums of all other bytes. So it differs from the SHA-256
        of the file."""
        return self._digest

    def __eq__(self, other: object) -> bool:
        return self._digest == other._digest if isinstance(other, DagFile) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._digest)

    def __reduce__(self) -> tuple[Any, ...]:
        return _reopened, (type(self), os.path.abspath(self.path), self._digest)

    @property
    def _dag(self) -> _native.Dag:
        if self._file is None:
            raise Error(f"{self.path} is closed: expected an open file", "invalid_input")
        return self._file

    @property
    def resolution(self) -> int:
        """The number of voxels per edge of the grid."""
        return 1 << self._dag.grid_levels

    @property
    def voxels(self) -> int:
        """The total number of set voxels."""
        return self._dag.voxels

    @property
    def node_order(self) -> str:
        """The order of the nodes in the file: "hash" or "first-parent". See voxdag.reorder()."""
        return self._dag.node_order

    @property
    def voxel_size(self) -> float:
        """The length of a voxel's edge, in the units of the scene."""
        return self._dag.edge / self.resolution

    @property
    def bounds(self) -> Doubles:
        """The low and the high corner of the grid in the units of the scene, as an array (2, 3) of
        float64."""
        low = np.array(self._dag.origin)
        return np.stack([low, low + self._dag.edge])

    @property
    def levels(self) -> list[Level]:
        """A list with a dict for each level of the DAG. "level" is the number of the level, "nodes"
        is the number of its nodes, and "bytes" is their size in the file. The list begins with the
        root, at level 0. It ends with the bricks, which are nodes of 4 x 4 x 4 voxels."""
        return [
            {"level": level, "nodes": nodes, "bytes": size}
            for level, (nodes, size) in enumerate(self._dag.levels())
        ]

    def to_world(self, positions: ArrayLike, level: int | None = None) -> Doubles:
        """Converts positions in the grid to points in the units of the scene.

        `positions` has the shape (..., 3) and is in voxels, or in cells of the grid that `level`
        selects. It may have fractions: v is the low corner of voxel v, and v + 0.5 is its center.
        The result is an array of float64 with the same shape."""
        size = self._dag.edge / (1 << self._levels(level))
        return np.asarray(self._dag.origin) + np.asarray(positions, np.float64) * size

    def to_voxel(self, points: ArrayLike, level: int | None = None) -> Integers:
        """Returns the position of the voxel that contains each point. With `level`, returns the
        position of the cell of this level.

        `points` has the shape (..., 3) and is in the units of the scene. The result is an array of
        int64 with the same shape. Positions can be outside the grid. Raises Error if a coordinate
        is not finite.

        If a point differs from a cell boundary only by rounding, it counts as on the boundary. So
        to_voxel(to_world(v)) is v for all integer positions v."""
        values = np.asarray(points, np.float64)
        if values.ndim == 0 or values.shape[-1] != 3:
            raise Error(
                f"the points are an array {values.shape}: expected (..., 3)", "invalid_input"
            )
        finite = np.isfinite(values).all(axis=-1)
        if not np.all(finite):
            index = np.argwhere(~finite)[0].tolist()
            raise Error(
                f"points{index or ''} is {values[tuple(index)].tolist()}: "
                "expected finite coordinates",
                "invalid_input",
            )
        cells = np.empty(values.shape, np.int64)
        self._dag.world_to_cells(
            np.ascontiguousarray(values.reshape(-1, 3)), self._levels(level), cells.reshape(-1, 3)
        )
        return cells

    def _levels(self, level: int | None) -> int:
        if level is None:
            return self._dag.grid_levels
        if not 0 <= level <= self._dag.grid_levels or int(level) != level:
            raise Error(
                f"level {level}: expected 0 to {self._dag.grid_levels}, for a grid of "
                "2^level cells per edge",
                "invalid_input",
            )
        return int(level)

    def _positions(self, points: ArrayLike, level: int | None, world: bool) -> Integers:
        if world:
            return np.ascontiguousarray(self.to_voxel(rows_of(points, np.float64, "points"), level))
        return rows_of(points, np.int64, "points")

    def _region(
        self, region: Region | None, level: int | None, world: bool
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        edge = 1 << self._levels(level)
        if region is None:
            return (0, 0, 0), (edge, edge, edge)
        corners = np.asarray(region, np.float64 if world else None).reshape(-1)
        if corners.shape != (6,):
            raise Error(
                f"the region {region!r}: expected x, y, z of its low and of its high corner",
                "invalid_input",
            )
        if world:
            if np.any(np.isnan(corners)):
                raise Error(f"the region {region!r}: expected numbers, not NaN", "invalid_input")
            low, high = self._dag.world_to_region(corners.tolist(), self._levels(level))
            corners = np.array([*low, *high])
        elif corners.dtype.kind not in "iu":
            raise Error(
                f"the region {region!r}: expected whole numbers, or world=True", "invalid_input"
            )
        numbers = tuple(int(number) for number in corners)
        if any(low > high for low, high in zip(numbers[:3], numbers[3:])):
            raise Error(
                f"the region {region!r}: expected the low corner before the high one",
                "invalid_input",
            )
        return numbers[:3], numbers[3:]


def _digest_of(path: str) -> str:
    with open(path, "rb") as file:
        return hashlib.sha256(file.read(_HEADER_BYTES)).hexdigest()


def _reopened(kind: type[DagFile], path: str, digest: str) -> DagFile:
    """Opens the file of a pickled Dag. Raises Error if its contents changed."""
    dag = kind(path)
    if dag.digest != digest:
        raise Error(
            f"{path} changed since the Dag was pickled: its digest is {dag.digest}, expected "
            f"{digest}",
            "invalid_input",
        )
    return dag
