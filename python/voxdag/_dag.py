"""Opens finished .vdag files, and answers queries of their voxels and attributes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, SupportsIndex, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arguments import rows_of
from ._error import Error, Path, thread_count
from ._file import DagFile
from ._indexing import BrickCells, Key, Voxel, bricks_of, element_of, voxels_of
from ._types import Bools, Bytes, Doubles, Integers, Region

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._derive import Operation
    from ._notebook import Viewer
    from ._types import ExportOptions, ExportReport, ExtractOptions, ExtractReport, RenderOptions

# For each attribute's name: the number of components of a value, and the numpy type of a component.
# int64 values are indexes of material_names; -1 means that the cell is not set.
_ATTRIBUTE_TYPES = {
    name: (components, np.dtype(dtype)) for name, components, dtype in _native.attribute_types()
}


class Hits(NamedTuple):
    """The hits of rays, one row per ray. A ray without a hit has an infinite distance."""

    distance: Doubles  # (N,), in voxels; with world=True, in units of the scene
    voxel: Integers  # (N, 3), the low corner of the hit cell in voxels; -1 without a hit
    normal: NDArray[np.int8]  # (N, 3), of the hit face; 0 without a hit or if the ray began inside

    @property
    def hit(self) -> Bools:
        """True for each ray with a hit, (N,) bool."""
        return np.isfinite(self.distance)


def open(path: Path) -> Dag:
    """Opens a .vdag file. The file is mapped into memory and read only where a query needs it, so
    the time to open it does not depend on its size."""
    return Dag(path)


class Dag(DagFile):
    """A finished file. Immutable; any number of threads may query it concurrently.

    The methods have these arguments in common:

    points    positions of voxels, (N, 3) integers; with world=True, (N, 3) numbers
    level     l: positions and regions are in cells of the coarser grid with 2^l cells per edge; a
              cell is set if any voxel in it is set; by default, the cells are voxels
    region    six numbers: the low corner x, y, z, which is in the region, and the high corner
              x, y, z, which is not; it may extend beyond the grid; by default, the complete grid
    world     True: positions, regions and distances are in world space, in the units of the scene
    threads   number of threads; 0 means all cores

    A Dag is also a set of voxels and an array of bool: `(x, y, z) in dag`, `len(dag)`,
    `for x, y, z in dag`, `dag[x, y, z]`, `dag[10:20, :, 5]`, `np.asarray(dag)`. `a | b`, `a - b`,
    `a & b` and `a ^ b` are new Dags in temporary files, as of combine(). A Dag is accepted wherever
    a path is. pickle keeps the path and the digest; unpickling opens the file again and
    raises Error if it changed. Two Dags are equal if their files have equal contents.
    """

    def __len__(self) -> int:
        return self.voxels

    def __or__(self, other: Dag) -> Dag:
        """Returns the voxels of this Dag or of the other one, in a temporary file. See
        voxdag.combine()."""
        return self._combined(other, "union") if isinstance(other, Dag) else NotImplemented

    def __sub__(self, other: Dag) -> Dag:
        return self._combined(other, "minus") if isinstance(other, Dag) else NotImplemented

    def __and__(self, other: Dag) -> Dag:
        return self._combined(other, "and") if isinstance(other, Dag) else NotImplemented

    def __xor__(self, other: Dag) -> Dag:
        return self._combined(other, "xor") if isinstance(other, Dag) else NotImplemented

    def _combined(self, other: Dag, operation: Operation) -> Dag:
        from ._derive import combine

        return combine(self, other, operation)

    def __contains__(self, voxel: ArrayLike) -> bool:
        found = self.lookup(voxel)
        if len(found) != 1:
            raise Error(f"{voxel!r} in dag: expected a voxel x, y, z", "invalid_input")
        return bool(found[0])

    def __iter__(self) -> Iterator[Voxel]:
        """Iterates over the set voxels, (x, y, z), in Morton order."""
        return voxels_of(self)

    @overload
    def __getitem__(  # type: ignore[overload-overlap]
        self, key: tuple[SupportsIndex, SupportsIndex, SupportsIndex]
    ) -> bool: ...

    @overload
    def __getitem__(self, key: Key) -> Bools: ...

    def __getitem__(self, key: Key) -> bool | Bools:
        """Indexes the dense array [x, y, z] of the grid: returns a bool for three integers, and an
        array if there is a slice. Reads only this part of the file."""
        return element_of(self, key)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        if copy is False:
            raise ValueError("a Dag has no array in memory: expected copy=True or None")
        return self.dense() if dtype is None else self.dense().astype(dtype)

    def _repr_png_(self) -> bytes | None:
        from ._notebook import picture_of

        if self._picture is None and self._file is not None:
            self._picture = picture_of(self)
        return self._picture

    def _repr_html_(self) -> str:
        from ._notebook import html_of

        return html_of(self)

    def lookup(
        self, points: ArrayLike, level: int | None = None, *, world: bool = False, threads: int = 1
    ) -> Bools:
        """Returns whether each voxel or cell is set, (N,) bool; False outside the grid."""
        positions = self._positions(points, level, world)
        found = np.empty(len(positions), np.bool_)
        self._dag.lookup(
            positions, self._levels(level), found.view(np.uint8), thread_count(threads)
        )
        return found

    def rays(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
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
        starts = rows_of(origins, np.float64, "origins")
        ways = rows_of(directions, np.float64, "directions")
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
        self, region: Region | None = None, level: int | None = None, *, world: bool = False
    ) -> Bools:
        """Returns the cells of a region as an array of bool: the element [x, y, z] is True if the
        cell at the region's low corner + (x, y, z) is set."""
        low, high = self._region(region, level, world)
        cells = np.empty([max(0, b - a) for a, b in zip(low, high)], np.bool_)
        self._dag.dense(low, high, self._levels(level), cells.view(np.uint8))
        return cells

    @overload
    def points(
        self,
        region: Region | None = None,
        level: int | None = None,
        *,
        world: bool = False,
        attributes: None = None,
    ) -> NDArray[Any]: ...

    @overload
    def points(
        self,
        region: Region | None = None,
        level: int | None = None,
        *,
        world: bool = False,
        attributes: Sequence[str],
    ) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]: ...

    def points(
        self,
        region: Region | None = None,
        level: int | None = None,
        *,
        world: bool = False,
        attributes: Sequence[str] | None = None,
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

    def colors(self, points: ArrayLike, level: int | None = None, *, world: bool = False) -> Bytes:
        """Returns the color of each cell, (N, 3) uint8, sRGB; 0 for a cell that is not set.

        The color grid is the finest grid with attributes. A smaller cell has the color of the color
        grid's cell that contains it. Raises Error if the file has no colors. alphas(), normals()
        and materials() follow the same rules."""
        return self._values("color", points, level, world)

    def alphas(self, points: ArrayLike, level: int | None = None, *, world: bool = False) -> Bytes:
        """Returns the alpha of each cell, (N,) uint8, linear; 0 for a cell that is not set."""
        return self._values("alpha", points, level, world)

    def normals(
        self, points: ArrayLike, level: int | None = None, *, world: bool = False
    ) -> NDArray[np.float32]:
        """Returns the normal of each cell, (N, 3) float32, of length 1; 0 for a cell that is not
        set."""
        return self._values("normal", points, level, world)

    def materials(
        self, points: ArrayLike, level: int | None = None, *, world: bool = False
    ) -> Integers:
        """Returns the material of each cell, (N,) int64, an index into material_names; -1 for a
        cell that is not set."""
        return self._values("material", points, level, world)

    def count(
        self, region: Region | None = None, level: int | None = None, *, world: bool = False
    ) -> int:
        """Returns the exact number of set cells in a region."""
        low, high = self._region(region, level, world)
        return self._dag.count(low, high, self._levels(level))

    def nearest(
        self, points: ArrayLike, max_distance: float = np.inf, *, threads: int = 1
    ) -> tuple[Integers, Doubles]:
        """Returns the set voxel nearest to each voxel, (N, 3) int64, and the distances between the
        centers, (N,) float64, in voxels.

        Among equally near voxels, returns the first in Morton order. If no set voxel is within
        `max_distance`, the voxel is -1 and the distance is infinite."""
        positions = self._positions(points, None, False)
        voxels = np.empty_like(positions)
        distances = np.empty(len(positions))
        self._dag.nearest(positions, float(max_distance), voxels, distances, thread_count(threads))
        return voxels, distances

    def bricks(self) -> Iterator[tuple[Voxel, BrickCells]]:
        """Iterates over the bricks, the cubes of 4 x 4 x 4 voxels that have a set voxel, in Morton
        order. Yields the low corner (x, y, z) of each brick, and its voxels: [x, y, z], bool."""
        return bricks_of(self)

    def extract(self, output: Path, **options: Unpack[ExtractOptions]) -> ExtractReport:
        """Writes a part of this file as a new .vdag file. It has the options of
        voxdag.extract()."""
        from ._derive import extract

        return extract(self, output, **options)

    def export(self, output: Path, **options: Unpack[ExportOptions]) -> ExportReport:
        """Writes this file, or a part of it, in the format of another program, which the ending of
        `output` names. It has the options of voxdag.export()."""
        from ._derive import export

        return export(self, output, **options)

    def render(self, **options: Unpack[RenderOptions]) -> Bytes:
        """Renders a picture, (height, width, 3 or 4) uint8. It has the options of
        voxdag.render()."""
        from ._render import render

        return render(self, **options)

    def view(self, *, open_browser: bool | None = None, program: str = "voxdag") -> Viewer:
        """Starts the viewer of the program voxdag, and opens it in the browser. Returns a Viewer,
        which has the `url`, and ends with close(), as a context manager, or with this program.

        open_browser   open the page; by default True, except in a notebook, which shows a link
        program        the program voxdag, which the package does not contain
        """
        from ._notebook import view

        return view(self, open_browser, program)

    def _values(
        self, attribute: str, points: ArrayLike, level: int | None, world: bool
    ) -> NDArray[Any]:
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
