"""Types of arguments and reports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypedDict, Union

import numpy as np
from numpy.typing import NDArray

from ._progress import Progress

if TYPE_CHECKING:
    from typing_extensions import NotRequired

# Six numbers: the low corner x, y, z, which is in the region, and the high corner x, y, z, which is
# not.
Region = Union[Sequence[Any], NDArray[Any]]


class Range(TypedDict):
    """An estimated number."""

    low: float
    likely: float
    high: float


class ColorEstimate(TypedDict):
    """The part of an estimate for colors and other attributes."""

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
    """The part of an estimate for a solid's interior."""

    rule: str
    interior: Range
    disputed: Range
    rows: int
    open_rows: int
    odd_rows: int
    warnings: list[SceneWarning]


class Estimate(TypedDict):
    """The result of plan(). docs/cli.md (The estimate of plan) explains the members."""

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
    """The cube of a grid: its low corner and its edge."""

    origin: list[float]
    edge: float


class ExtractReport(TypedDict):
    """The report of extract()."""

    resolution: int
    bounds: Bounds
    voxels: int
    svo_nodes: int
    dag_nodes: int
    bytes: int
    sha256: str


class ExportReport(TypedDict):
    """The report of export(): the written files and their total size, the number of voxels, and
    sentences on how to use the files."""

    files: list[str]
    bytes: int
    voxels: int
    notes: list[str]


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
    gray: bool
    memory: int | str | None
    threads: int
    progress: Progress


class Level(TypedDict):
    """A level of the DAG: its number, 0 for the root, its nodes and their size in the file."""

    level: int
    nodes: int
    bytes: int


Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Doubles = NDArray[np.float64]
Integers = NDArray[np.int64]
