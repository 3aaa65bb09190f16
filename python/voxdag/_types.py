"""Types of arguments and reports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, SupportsIndex, TypedDict, Union

import numpy as np
from numpy.typing import NDArray

from ._progress import Progress

if TYPE_CHECKING:
    from typing_extensions import NotRequired

    from ._build import Scene
    from ._error import Path

# A box of cells: a sequence or an array of six numbers. The first three are x, y, z of the low
# corner, which is in the region. The last three are x, y, z of the high corner, which is not.
Region = Union[Sequence[Any], NDArray[Any]]


# The order of the nodes in a file.
NodeOrder = Literal["hash", "first-parent"]


class Range(TypedDict):
    """An estimated number: its most likely value, and a low and a high estimate."""

    low: float
    likely: float
    high: float


class ColorEstimate(TypedDict):
    """The estimate for the colors and other attributes alone, without the voxels."""

    cells: Range
    file_bytes: Range
    artifact_bytes: Range
    spill_bytes: Range
    cpu_s: Range


class SceneWarning(TypedDict):
    """A warning about a scene."""

    code: str
    place: str
    message: str
    count: int


class SolidEstimate(TypedDict):
    """The estimate for the interior of a solid."""

    rule: str
    interior: Range
    disputed: Range
    rows: int
    open_rows: int
    odd_rows: int
    warnings: list[SceneWarning]


class Estimate(TypedDict):
    """The dict that plan() returns. docs/cli.md, section "The estimate of plan", describes its
    members. A Range is a dict with the members "low", "likely" and "high"."""

    triangles: int
    subvolumes: int
    pilot_resolution: int
    voxels: Range
    svo_nodes: Range
    dag_nodes: Range
    file_bytes: Range
    disk_bytes: Range
    memory_bytes: Range
    cpu_s: Range
    wall_s: Range
    free_disk_bytes: int
    memory_budget_bytes: int
    solid: NotRequired[SolidEstimate]
    colors: NotRequired[ColorEstimate]


class Bounds(TypedDict):
    """The cube that a grid covers: its low corner and the length of its edge, in scene units."""

    origin: list[float]
    edge: float


class ExtractReport(TypedDict):
    """The dict that extract() returns. It describes the new file.

    resolution   number of voxels per edge of the grid
    bounds       a dict with the low corner of the grid, "origin", and the length of the grid's
                 edge, "edge", in the units of the scene
    voxels       number of set voxels
    svo_nodes    number of nodes of the octree, without sharing of equal subtrees
    dag_nodes    number of nodes of the DAG
    bytes        size of the file in bytes
    sha256       SHA-256 of the file, as a hexadecimal number
    """

    resolution: int
    bounds: Bounds
    voxels: int
    svo_nodes: int
    dag_nodes: int
    bytes: int
    sha256: str


class ExportReport(TypedDict):
    """The dict that export() returns.

    files    list of the paths of the written files
    bytes    total size of the files in bytes
    voxels   number of exported voxels
    notes    list of sentences on how to use the files
    facts    dict of the numbers in the notes. A value is a number, or a list of three numbers.
             Counts and sizes are integers.
    """

    files: list[str]
    bytes: int
    voxels: int
    notes: list[str]
    facts: dict[str, float | list[float]]


class ReorderReport(TypedDict):
    """The dict that reorder() returns. It describes the new file.

    node_order   order of the nodes
    dag_nodes    number of nodes of the DAG
    bytes        size of the file in bytes
    sha256       SHA-256 of the file, as a hexadecimal number
    """

    node_order: NodeOrder
    dag_nodes: int
    bytes: int
    sha256: str


class ExtractOptions(TypedDict, total=False):
    """Options of extract()."""

    region: Region | None
    level: int | None
    world: bool
    crop: bool
    majority: bool
    memory: int | str | None
    threads: int
    force: bool
    progress: Progress


class ExportOptions(TypedDict, total=False):
    """Options of export()."""

    to: str | None
    region: Region | None
    level: int | None
    world: bool
    memory: int | str | None
    gray: bool
    up: str | None
    grid: str | None
    band: int | None
    compact: bool
    outside: bool
    watertight: bool
    force: bool
    progress: Progress


class MorphologyOptions(TypedDict, total=False):
    """Options of Dag.dilate() and Dag.erode()."""

    color_resolution: int
    no_attributes: bool
    memory: int | str | None
    threads: int
    force: bool
    progress: Progress


class EditOptions(MorphologyOptions, total=False):
    """Options of edit()."""

    cut: str | Sequence[str]
    add: Scene | None
    paste: Sequence[tuple[Path, tuple[int, int, int]]]
    dilate: SupportsIndex
    erode: SupportsIndex
    outside_set: bool
    clip: bool
    fill_color: tuple[int, int, int] | None


class ReorderOptions(TypedDict, total=False):
    """Options of reorder()."""

    order: NodeOrder
    memory: int | str | None
    threads: int
    force: bool
    progress: Progress


class RenderOptions(TypedDict, total=False):
    """Options of render()."""

    view: str
    camera: Any | None
    target: Any | None
    fov: float | None
    size: tuple[int, int]
    samples: int
    background: str
    shade: str
    gray: bool
    memory: int | str | None
    threads: int
    progress: Progress


class Level(TypedDict):
    """A level of the DAG: the number of the level (0 for the root), the number of its nodes, and
    their size in the file."""

    level: int
    nodes: int
    bytes: int


Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Doubles = NDArray[np.float64]
Integers = NDArray[np.int64]


class Hits(NamedTuple):
    """The results of rays(): for each of N rays, the cell that it hits.

    distance  distance from the origin of each ray to its hit, as an array (N,) of float64. It is in
              voxels, or with world=True in the units of the scene. It is infinite if the ray hits
              no cell.
    voxel     low corner of the hit cell, as an array (N, 3) of int64. It is always in voxels. It is
              -1, -1, -1 if the ray hits no cell.
    normal    unit normal of the face through which the ray enters the cell, as an array (N, 3) of
              int8. It is 0, 0, 0 if the ray begins in the cell, or hits no cell.
    """

    distance: Doubles
    voxel: Integers
    normal: NDArray[np.int8]

    @property
    def hit(self) -> Bools:
        """An array (N,) of bool that is True for each ray that hits a cell."""
        return np.isfinite(self.distance)


class Components(NamedTuple):
    """The results of components(): connected components of voxels.

    total   number of components
    voxels  number of voxels of each of the K largest components, as an array (K,) of int64. The
            largest component comes first.
    boxes   box of each of these components, as an array (K, 6) of int64. A row is a region: x, y, z
            of the low corner, which is in the box, and of the high corner, which is not.
    """

    total: int
    voxels: Integers
    boxes: Integers
