"""Opens finished .vdag files, and answers queries of their voxels and attributes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, SupportsIndex, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._arguments import rows_of
from ._error import Error, Path, thread_count
from ._file import DagFile
from ._indexing import BrickCells, Key, Voxel, bricks_of, components_of, element_of, voxels_of
from ._types import Bools, Bytes, Components, Doubles, Hits, Integers, Region

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._derive import Operation
    from ._notebook import Viewer
    from ._progress import Progress
    from ._types import (
        EditOptions,
        ExportOptions,
        ExportReport,
        ExtractOptions,
        ExtractReport,
        MorphologyOptions,
        RenderOptions,
        ReorderOptions,
        ReorderReport,
    )

# For each attribute's name: the number of components of a value, and the numpy type of a component.
# int64 values are indexes of material_names; -1 means that the cell is not set.
_ATTRIBUTE_TYPES = {
    name: (components, np.dtype(dtype)) for name, components, dtype in _native.attribute_types()
}


def open(path: Path) -> Dag:
    """Opens a .vdag file and returns its Dag.

    The file is mapped into memory and read only where a query needs it, so the time to open it does
    not depend on its size. Raises Error if the file does not exist, cannot be read, or is not a
    valid .vdag file."""
    return Dag(path)


class Dag(DagFile):
    """An open .vdag file. A Dag is immutable, and several threads can query it concurrently.

    These parameters have the same meaning in all methods:

    points    positions of cells, as an array (N, 3) of integers. With world=True, points in the
              units of the scene, as an array (N, 3) of numbers. A single row x, y, z is allowed.
    level     selects the grid of 2^level cells per edge. Positions and regions are then in cells of
              this grid. A cell is set if any voxel in it is set. By default, the cells are the
              voxels.
    region    a box of cells, as six integers: x, y, z of the low corner, which is in the box, and
              x, y, z of the high corner, which is not. The box may extend beyond the grid. The
              default is the complete grid.
    world     if True, points, regions and distances are in the units of the scene. A region then
              contains all cells that it overlaps, and its coordinates may be infinite.
    threads   number of threads, at most 1024; 0 means all cores

    Methods raise Error if an argument is invalid, if the Dag is closed, or if they find that the
    file is damaged.

    A Dag also behaves like a set of voxels: `(x, y, z) in dag`, `len(dag)`, `for x, y, z in dag`.
    And it behaves like the array that dense() returns: `dag[x, y, z]`, `dag[10:20, :, 5]`,
    `np.asarray(dag)`.

    `a | b`, `a - b`, `a & b` and `a ^ b` call combine() and return a Dag in a temporary file. Every
    function that takes a path also takes a Dag. Two Dags are equal if their files have equal
    contents. A pickled Dag contains the path and the digest of its file. Unpickling opens the file
    again, and raises Error if its digest has changed.
    """

    def __len__(self) -> int:
        return self.voxels

    def __or__(self, other: Dag) -> Dag:
        """Returns a Dag in a temporary file. A voxel is set if it is set in this Dag or in the
        other Dag. See voxdag.combine()."""
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
        """Iterates over the positions (x, y, z) of the set voxels, in Morton order."""
        return voxels_of(self)

    @overload
    def __getitem__(  # type: ignore[overload-overlap]
        self, key: tuple[SupportsIndex, SupportsIndex, SupportsIndex]
    ) -> bool: ...

    @overload
    def __getitem__(self, key: Key) -> Bools: ...

    def __getitem__(self, key: Key) -> bool | Bools:
        """Returns the part of the dense array [x, y, z] that `key` selects: a bool for three
        integers, otherwise an array. Reads only this part of the file."""
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
        """Returns an array (N,) of bool that is True for each point whose cell is set. It is False
        for points outside the grid."""
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
        """Finds the first set voxel on each ray, and returns Hits.

        `origins` and `directions` are arrays (N, 3) of numbers. If one of them has only one row,
        this row applies to all rays. Origins and distances are in voxels, or with world=True in the
        units of the scene. Directions may have any length except 0.

        A ray finds only cells within `max_distance` of its origin. It stops at the first set cell
        whose edge is at most `stop_size`. This size is always in voxels; with the default of 1,
        rays stop at single voxels.

        Raises Error if a coordinate is not finite, or if a direction is 0, 0, 0.
        """
        starts, ways, unit = self._rays(origins, directions, world)
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

    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        max_distance: float = np.inf,
        stop_size: float = 1,
        *,
        world: bool = False,
        threads: int = 1,
    ) -> Bools:
        """Tests whether each ray hits a cell, and returns an array (N,) of bool.

        Takes the arguments of rays(). The result equals `rays(...).hit`, but takes less time, for
        example for shadows and lines of sight. For the line of sight between two points a and b,
        the direction is b - a, and `max_distance` is the distance between them."""
        starts, ways, unit = self._rays(origins, directions, world)
        found = np.empty(len(starts), np.bool_)
        self._dag.occluded(
            starts,
            ways,
            float(max_distance) / unit,
            float(stop_size),
            found.view(np.uint8),
            thread_count(threads),
        )
        return found

    def dense(
        self, region: Region | None = None, level: int | None = None, *, world: bool = False
    ) -> Bools:
        """Returns the cells of a region as an array of bool, whose shape is the size of the region.
        Element [x, y, z] is True if the cell at the region's low corner + (x, y, z) is set."""
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
        """Returns the positions of the set cells in a region, in Morton order.

        The result is an array (N, 3) of int64. With world=True, it is an array (N, 3) of float64,
        the centers of the cells in the units of the scene.

        With `attributes`, a list of names such as ["color", "normal"], returns a tuple of this
        array and a dict. For each name, the dict has an array with the values of the cells; its
        shape and dtype are the same as in the results of colors(), alphas(), normals() and
        materials(). Raises Error if the file does not have one of these attributes."""
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
        """A list of the names of the file's attributes. It has none, some or all of the names
        "color", "alpha", "normal" and "material"."""
        return self._dag.attributes

    @property
    def material_names(self) -> list[str]:
        """A list of the names of the materials. materials() returns indexes into this list. The
        last name is "", for triangles without a material. The list is empty if the file has no
        materials."""
        return [name.decode(errors="replace") for name in self._dag.material_names]

    def colors(self, points: ArrayLike, level: int | None = None, *, world: bool = False) -> Bytes:
        """Returns the color of each point's cell, as an array (N, 3) of uint8 in sRGB. The color of
        a cell that is not set is 0, 0, 0.

        The finest grid for which the file stores colors is the color grid. A cell that is smaller
        than the cells of the color grid has the color of the color cell that contains it. Raises
        Error if the file has no colors.

        alphas(), normals() and materials() follow the same rules for their attributes."""
        return self._values("color", points, level, world)

    def alphas(self, points: ArrayLike, level: int | None = None, *, world: bool = False) -> Bytes:
        """Returns the alpha of each point's cell, as an array (N,) of uint8. Alpha is linear, and
        255 is opaque. The alpha of a cell that is not set is 0."""
        return self._values("alpha", points, level, world)

    def normals(
        self, points: ArrayLike, level: int | None = None, *, world: bool = False
    ) -> NDArray[np.float32]:
        """Returns the normal of each point's cell, as an array (N, 3) of float32. Normals have the
        length 1. The normal of a cell that is not set is 0, 0, 0."""
        return self._values("normal", points, level, world)

    def materials(
        self, points: ArrayLike, level: int | None = None, *, world: bool = False
    ) -> Integers:
        """Returns the material of each point's cell, as an array (N,) of int64. A value is an index
        into material_names, or -1 if the cell is not set."""
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
        """Finds the set voxel that is nearest to each of the voxels `points`.

        Returns a tuple of two arrays: the positions of the nearest voxels, (N, 3) of int64, and
        their distances, (N,) of float64. A distance is measured in voxels, between the centers of
        the two voxels. If several voxels are equally near, the result is the first of them in
        Morton order. If no set voxel is within `max_distance` voxels, the position is -1, -1, -1
        and the distance is infinite.

        `points` may be outside the grid, with coordinates from -2^30 to 2^30."""
        positions = self._positions(points, None, False)
        voxels = np.empty_like(positions)
        distances = np.empty(len(positions))
        self._dag.nearest(positions, float(max_distance), voxels, distances, thread_count(threads))
        return voxels, distances

    def components(
        self,
        connectivity: int = 26,
        largest: SupportsIndex = 10,
        *,
        memory: int | str | None = None,
        progress: Progress = None,
    ) -> Components:
        """Finds the connected components of the voxels, and returns Components: their number, and
        the `largest` largest ones, at most 1000000.

        connectivity  6 connects voxels with a common face, 26 also voxels with a common edge or
                      corner
        memory        memory limit, as a number of bytes or as text such as "8GiB". The default is
                      half of the machine's memory.
        progress      as in build()

        Raises Error if an argument is invalid, or if the memory limit is too small."""
        return components_of(self, connectivity, largest, memory, progress)

    def bricks(self) -> Iterator[tuple[Voxel, BrickCells]]:
        """Iterates over the bricks of the grid, in Morton order. A brick is a cube of 4 x 4 x 4
        voxels with at least one set voxel; its low corner is at multiples of 4.

        Yields a tuple for each brick: its low corner (x, y, z) in voxels, and its voxels as an
        array [x, y, z] of bool with the shape (4, 4, 4)."""
        return bricks_of(self)

    def extract(self, output: Path, **options: Unpack[ExtractOptions]) -> ExtractReport:
        """Writes a region, or a coarser grid, of this file as a new .vdag file. Takes the options
        of voxdag.extract() and returns its report."""
        from ._derive import extract

        return extract(self, output, **options)

    def export(self, output: Path, **options: Unpack[ExportOptions]) -> ExportReport:
        """Writes this file, or a part of it, in the format of another program. Takes the options of
        voxdag.export() and returns its report. Without `to`, the extension of `output` determines
        the format."""
        from ._derive import export

        return export(self, output, **options)

    def edit(self, output: Path | None = None, **options: Unpack[EditOptions]) -> Dag:
        """Writes a changed copy of this file, and returns its Dag: removes spheres and boxes, adds
        scenes, and pastes other files. Takes the options of voxdag.edit(). Without `output`, the
        copy is a temporary file."""
        from ._derive import edit

        return edit(self, output, **options)

    def dilate(
        self,
        voxels: SupportsIndex = 1,
        output: Path | None = None,
        **options: Unpack[MorphologyOptions],
    ) -> Dag:
        """Sets all voxels of the grid that are within `voxels` voxels of a set voxel on each axis,
        and returns the Dag of the new file. So each set voxel becomes a cube of 2 * voxels + 1
        voxels per edge. Voxels outside the grid are dropped. A new voxel has the attributes of the
        nearest set voxel.

        The options are color_resolution, no_attributes, memory, threads, force and progress, as in
        voxdag.edit(). Without `output`, the new file is temporary. Raises Error if `voxels` is not
        from 1 to 2^20, or for the reasons of voxdag.edit()."""
        from ._derive import distance_of, edit

        return edit(self, output, dilate=distance_of(voxels, "voxels", 1), **options)

    def erode(
        self,
        voxels: SupportsIndex = 1,
        output: Path | None = None,
        *,
        outside_set: bool = False,
        **options: Unpack[MorphologyOptions],
    ) -> Dag:
        """Keeps only the voxels whose cube of 2 * voxels + 1 voxels per edge is completely set, and
        returns the Dag of the new file. Voxels outside the grid count as not set, or as set if
        `outside_set` is True. dilate(n).erode(n, outside_set=True) closes gaps and never removes a
        set voxel. The other arguments and the errors are the same as for dilate()."""
        from ._derive import distance_of, edit

        distance = distance_of(voxels, "voxels", 1)
        return edit(self, output, erode=distance, outside_set=outside_set, **options)

    def reorder(self, output: Path, **options: Unpack[ReorderOptions]) -> ReorderReport:
        """Writes a copy of this file with its nodes in another order. Takes the options of
        voxdag.reorder() and returns its report."""
        from ._derive import reorder

        return reorder(self, output, **options)

    def render(self, **options: Unpack[RenderOptions]) -> Bytes:
        """Renders a picture of this file, as an array (height, width, 3 or 4) of uint8. Takes the
        options of voxdag.render()."""
        from ._render import render

        return render(self, **options)

    def view(self, *, open_browser: bool | None = None, program: str = "voxdag") -> Viewer:
        """Starts the viewer for this file, opens its page in the browser, and returns a Viewer.

        open_browser   True opens the page in the browser. The default is True, except in a
                       notebook, where the Viewer is shown as a link.
        program        name or path of the program voxdag, which is not part of this package

        Keep the Viewer as long as you use the page: the viewer stops when the Viewer is no longer
        referenced. Raises Error if the program does not exist or cannot start the viewer.
        """
        from ._notebook import view

        return view(self, open_browser, program)

    def _rays(
        self, origins: ArrayLike, directions: ArrayLike, world: bool
    ) -> tuple[Doubles, Doubles, float]:
        """Returns the origins and directions of rays as arrays of equal length, and the
        length of a voxel in the caller's unit. The returned origins are in voxels."""
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
        return starts, ways, unit

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
