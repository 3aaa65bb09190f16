"""Opens finished .vdag files, and answers queries of their voxels and attributes."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Optional, Union, overload

import numpy as np

from . import _native
from ._error import Error, Path, path_text, thread_count

# For each attribute's name: the number of components of a value, and the numpy type of a component.
# int64 values are indexes of material_names; -1 means that the cell is not set.
_ATTRIBUTE_TYPES = {
    name: (components, np.dtype(dtype)) for name, components, dtype in _native.attribute_types()
}

# Six numbers: the low corner x, y, z, which is in the region, and the high corner x, y, z, which is
# not.
Region = Union[Sequence[Any], np.ndarray]


class Hits(NamedTuple):
    """The hits of rays, one row per ray. A ray without a hit has an infinite distance."""

    distance: np.ndarray  # (N,) float64, in voxels; with world=True, in units of the scene
    voxel: np.ndarray  # (N, 3) int64, the low corner of the hit cell in voxels; -1 without a hit
    normal: np.ndarray  # (N, 3) int8, of the hit face; 0 without a hit or if the ray began inside

    @property
    def hit(self) -> np.ndarray:
        """True for each ray with a hit, (N,) bool."""
        return np.isfinite(self.distance)


def open(path: Path) -> "Dag":
    """Opens a .vdag file. The file is mapped into memory and read only where a query needs it, so
    the time to open it does not depend on its size."""
    return Dag(path)


class Dag:
    """A finished file. Immutable; any number of threads may query it concurrently.

    The methods have these arguments in common:

    points    positions of voxels, (N, 3) integers; with world=True, (N, 3) numbers
    level     l: positions and regions are in cells of the coarser grid with 2^l cells per edge; a
              cell is set if any voxel in it is set; by default, the cells are voxels
    region    six numbers: the low corner x, y, z, which is in the region, and the high corner
              x, y, z, which is not; it may extend beyond the grid; by default, the complete grid
    world     True: positions, regions and distances are in world space, in the units of the scene
    threads   number of threads; 0 means all cores
    """

    def __init__(self, path: Path) -> None:
        self.path = path_text(path)
        self._file: Optional[_native.Dag] = _native.Dag(self.path)

    def close(self) -> None:
        """Closes the file. Later queries raise Error."""
        self._file = None

    def __enter__(self) -> "Dag":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        if self._file is None:
            return f"<voxdag.Dag {self.path!r}, closed>"
        return f"<voxdag.Dag {self.path!r}, {self.resolution}^3, {self.voxels} voxels>"

    @property
    def _dag(self) -> "_native.Dag":
        if self._file is None:
            raise Error(f"{self.path} is closed: expected an open file", "invalid_input")
        return self._file

    @property
    def resolution(self) -> int:
        """Voxels per edge of the grid."""
        return 1 << self._dag.grid_levels

    @property
    def voxels(self) -> int:
        """Total number of set voxels."""
        return self._dag.voxels

    @property
    def voxel_size(self) -> float:
        """The edge of a voxel, in the units of the scene."""
        return self._dag.edge / self.resolution

    @property
    def bounds(self) -> np.ndarray:
        """The low and the high corner of the grid in the units of the scene, (2, 3) float64."""
        low = np.array(self._dag.origin)
        return np.stack([low, low + self._dag.edge])

    @property
    def levels(self) -> list[dict[str, int]]:
        """A dict with "level", "nodes" and "bytes" for each level of the DAG, from the root's level
        to the level of the bricks, which are nodes of 4 x 4 x 4 voxels."""
        return [
            {"level": level, "nodes": nodes, "bytes": size}
            for level, (nodes, size) in enumerate(self._dag.levels())
        ]

    def to_world(self, positions: Any, level: Optional[int] = None) -> np.ndarray:
        """Converts positions in the grid to positions in the scene, float64. `positions` may have
        fractions: v is the low corner of voxel v, and v + 0.5 its center."""
        size = self._dag.edge / (1 << self._levels(level))
        return np.asarray(self._dag.origin) + np.asarray(positions, np.float64) * size

    def to_voxel(self, points: Any, level: Optional[int] = None) -> np.ndarray:
        """Returns the voxel or cell that contains each point of the scene, int64 in the shape of
        `points`. It may be outside the grid.

        For the low corner of a cell, as to_world() returns it, the result is this cell: errors from
        the rounding of doubles are corrected."""
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

    def lookup(
        self, points: Any, level: Optional[int] = None, *, world: bool = False, threads: int = 1
    ) -> np.ndarray:
        """Returns whether each voxel or cell is set, (N,) bool; False outside the grid."""
        positions = self._positions(points, level, world)
        found = np.empty(len(positions), np.bool_)
        self._dag.lookup(
            positions, self._levels(level), found.view(np.uint8), thread_count(threads)
        )
        return found

    def rays(
        self,
        origins: Any,
        directions: Any,
        max_distance: float = np.inf,
        stop_size: float = 1,
        *,
        world: bool = False,
        threads: int = 1,
    ) -> Hits:
        """Returns the first set voxel on each ray. Origins and directions are (N, 3); one of them
        may be a single row for all rays. Directions may have any length except 0.

        Set voxels farther than `max_distance` from the origin are not found. A ray stops at the
        first set cell whose edge is at most `stop_size`, which is always in voxels: 1 stops at
        single voxels.
        """
        starts = _rows(origins, np.float64, "origins")
        ways = _rows(directions, np.float64, "directions")
        unit = self.voxel_size if world else 1.0
        if world:
            starts = (starts - np.asarray(self._dag.origin)) / unit
        if 1 in (len(starts), len(ways)):
            shape = (len(ways) if len(starts) == 1 else len(starts), 3)
            starts, ways = (
                np.ascontiguousarray(np.broadcast_to(rows, shape)) for rows in (starts, ways)
            )
        hits = Hits(
            np.empty(len(starts)),
            np.empty((len(starts), 3), np.int64),
            np.empty((len(starts), 3), np.int8),
        )
        self._dag.rays(
            starts, ways, float(max_distance) / unit, float(stop_size), *hits, thread_count(threads)
        )
        np.multiply(hits.distance, unit, out=hits.distance)
        return hits

    def dense(
        self, region: Optional[Region] = None, level: Optional[int] = None, *, world: bool = False
    ) -> np.ndarray:
        """Returns the cells of a region as an array of bool: the element [x, y, z] is True if the
        cell at the region's low corner + (x, y, z) is set."""
        low, high = self._region(region, level, world)
        cells = np.empty([max(0, b - a) for a, b in zip(low, high)], np.bool_)
        self._dag.dense(low, high, self._levels(level), cells.view(np.uint8))
        return cells

    @overload
    def points(
        self,
        region: Optional[Region] = None,
        level: Optional[int] = None,
        *,
        world: bool = False,
        attributes: None = None,
    ) -> np.ndarray: ...

    @overload
    def points(
        self,
        region: Optional[Region] = None,
        level: Optional[int] = None,
        *,
        world: bool = False,
        attributes: Sequence[str],
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]: ...

    def points(
        self,
        region: Optional[Region] = None,
        level: Optional[int] = None,
        *,
        world: bool = False,
        attributes: Optional[Sequence[str]] = None,
    ) -> Any:
        """Returns the set cells of a region in Morton order, (N, 3) int64.

        With world=True, returns their centers in the units of the scene, float64. With
        `attributes`, such as ["color", "normal"], returns a tuple: the cells, and a dict with an
        array for each attribute."""
        low, high = self._region(region, level, world)
        rows = self._dag.point_count(low, high, self._levels(level))
        found = np.empty((rows, 3), np.int64)
        self._dag.points(low, high, self._levels(level), found)
        cells = self.to_world(found + 0.5, level) if world else found
        if attributes is None:
            return cells
        if isinstance(attributes, str):
            raise Error(f"attributes={attributes!r}: expected a list of names", "invalid_input")
        return cells, {name: self._values(name, found, level, False) for name in attributes}

    @property
    def attributes(self) -> list[str]:
        """The names of the file's attributes: none, some or all of "color", "alpha", "normal" and
        "material"."""
        return self._dag.attributes

    @property
    def material_names(self) -> list[str]:
        """The names of the materials; materials() returns indexes of this list. The last name is ""
        and stands for triangles without a material."""
        return [name.decode(errors="replace") for name in self._dag.material_names]

    def colors(
        self, points: Any, level: Optional[int] = None, *, world: bool = False
    ) -> np.ndarray:
        """Returns the color of each cell, (N, 3) uint8, sRGB; 0 for a cell that is not set.

        The color grid is the finest grid with attributes. A smaller cell has the color of the color
        grid's cell that contains it. Raises Error if the file has no colors. alphas(), normals()
        and materials() follow the same rules."""
        return self._values("color", points, level, world)

    def alphas(
        self, points: Any, level: Optional[int] = None, *, world: bool = False
    ) -> np.ndarray:
        """Returns the alpha of each cell, (N,) uint8, linear; 0 for a cell that is not set."""
        return self._values("alpha", points, level, world)

    def normals(
        self, points: Any, level: Optional[int] = None, *, world: bool = False
    ) -> np.ndarray:
        """Returns the normal of each cell, (N, 3) float32, of length 1; 0 for a cell that is not
        set."""
        return self._values("normal", points, level, world)

    def materials(
        self, points: Any, level: Optional[int] = None, *, world: bool = False
    ) -> np.ndarray:
        """Returns the material of each cell, (N,) int64, an index into material_names; -1 for a
        cell that is not set."""
        return self._values("material", points, level, world)

    def count(
        self, region: Optional[Region] = None, level: Optional[int] = None, *, world: bool = False
    ) -> int:
        """Returns the exact number of set cells in a region."""
        low, high = self._region(region, level, world)
        return self._dag.count(low, high, self._levels(level))

    def nearest(
        self, points: Any, max_distance: float = np.inf, *, threads: int = 1
    ) -> tuple[np.ndarray, np.ndarray]:
        """Returns the set voxel nearest to each voxel, (N, 3) int64, and the distances between the
        centers, (N,) float64, in voxels.

        Among equally near voxels, returns the first in Morton order. If no set voxel is within
        `max_distance`, the voxel is -1 and the distance is infinite."""
        positions = self._positions(points, None, False)
        voxels = np.empty_like(positions)
        distances = np.empty(len(positions))
        self._dag.nearest(positions, float(max_distance), voxels, distances, thread_count(threads))
        return voxels, distances

    def _values(self, attribute: str, points: Any, level: Optional[int], world: bool) -> np.ndarray:
        if attribute not in self._dag.attributes:
            raise Error(
                f"{self.path} has no {attribute!r}: expected one of its attributes, "
                f"{', '.join(self._dag.attributes) or 'none'}",
                "invalid_input",
            )
        positions = self._positions(points, level, world)
        components, dtype = _ATTRIBUTE_TYPES[attribute]
        shape = (len(positions),) if components == 1 else (len(positions), components)
        values = np.full(shape, -1 if dtype == np.int64 else 0, dtype)
        self._dag.values(attribute, positions, self._levels(level), values)
        return values

    def _levels(self, level: Optional[int]) -> int:
        if level is None:
            return self._dag.grid_levels
        if not 0 <= level <= self._dag.grid_levels or int(level) != level:
            raise Error(
                f"level {level}: expected 0 to {self._dag.grid_levels}, for a grid of "
                "2^level cells per edge",
                "invalid_input",
            )
        return int(level)

    def _positions(self, points: Any, level: Optional[int], world: bool) -> np.ndarray:
        if world:
            return np.ascontiguousarray(self.to_voxel(_rows(points, np.float64, "points"), level))
        return _rows(points, np.int64, "points")

    def _region(
        self, region: Optional[Region], level: Optional[int], world: bool
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


def _rows(values: Any, dtype: Any, what: str) -> np.ndarray:
    """Returns the argument `what` as a contiguous array (N, 3) of `dtype`. A single row x, y, z is
    allowed. Raises Error for another shape, or for an array whose dtype must not be converted."""
    array = np.asarray(values)
    if array.ndim == 1 and array.shape == (3,):
        array = array.reshape(1, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise Error(f"the {what} are an array {array.shape}: expected (N, 3)", "invalid_input")
    if dtype == np.int64 and array.dtype.kind not in "iu":
        raise Error(
            f"{what} has the dtype {array.dtype}: expected an integer dtype, int8 to int64 or "
            "uint8 to uint64 (a float dtype requires world=True)",
            "invalid_input",
        )
    if array.dtype.kind not in "fiu":
        raise Error(
            f"{what} has the dtype {array.dtype}: expected a float dtype, such as float64, or an "
            "integer dtype, int8 to int64 or uint8 to uint64",
            "invalid_input",
        )
    if dtype == np.int64 and array.dtype == np.uint64 and (array >> np.uint64(63)).any():
        raise Error(
            f"the {what} have the coordinate {array.max()}: expected less than 2^63",
            "invalid_input",
        )
    return np.ascontiguousarray(array, dtype=dtype)
