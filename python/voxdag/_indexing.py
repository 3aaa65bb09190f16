"""Indexes a Dag like an array of bool, iterates over its voxels and bricks, and finds its connected
components."""

from __future__ import annotations

import operator
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, SupportsIndex, Union

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._error import Error, memory_text
from ._progress import Progress, shown
from ._types import Components

if TYPE_CHECKING:
    from types import EllipsisType

    from ._dag import Dag

Voxel = tuple[int, int, int]
BrickCells = NDArray[np.bool_]
_Item = Union[SupportsIndex, slice, "EllipsisType"]
Key = Union[_Item, tuple[_Item, ...]]

_BLOCK_LEVELS = 6  # voxels and bricks are read in blocks of 64 x 64 x 64 voxels
_BRICK_LEVELS = 2
_MAX_COMPONENTS = 1_000_000  # listed components


def element_of(dag: Dag, key: Any) -> bool | NDArray[np.bool_]:
    """Returns the elements of the dense array of `dag` that numpy's basic indexing selects."""
    items = _three_items(key if isinstance(key, tuple) else (key,))
    ranges = [
        range(*item.indices(dag.resolution))
        if isinstance(item, slice)
        else _single(item, dag.resolution, axis)
        for axis, item in enumerate(items)
    ]
    low = [min(r[0], r[-1]) if r else 0 for r in ranges]
    high = [max(r[0], r[-1]) + 1 if r else 0 for r in ranges]
    inner = [
        _slice_of(r, begin) if isinstance(item, slice) else 0
        for item, r, begin in zip(items, ranges, low)
    ]
    found = dag.dense((*low, *high))[tuple(inner)]
    return found if isinstance(found, np.ndarray) else bool(found)


def _three_items(key: tuple[Any, ...]) -> list[Any]:
    """Returns an item for each axis. Replaces an ellipsis and missing items by slices of the
    complete axis."""
    ellipses = [place for place, item in enumerate(key) if item is Ellipsis]
    if len(ellipses) > 1 or len(key) - len(ellipses) > 3:
        raise IndexError(f"the index {key!r}: expected at most three items and one ellipsis")
    place = ellipses[0] if ellipses else len(key)
    before, after = list(key[:place]), list(key[place + 1 :])
    return before + [slice(None)] * (3 - len(before) - len(after)) + after


def _single(item: Any, resolution: int, axis: int) -> range:
    try:
        number = operator.index(item)
    except TypeError:
        raise TypeError(
            f"the index {item!r} of a Dag: expected an integer, a slice or an ellipsis; use "
            "lookup() for an array of positions"
        ) from None
    if not -resolution <= number < resolution:
        raise IndexError(f"index {number} is out of bounds for axis {axis} with size {resolution}")
    return range(number % resolution, number % resolution + 1)


def _slice_of(chosen: range, begin: int) -> slice:
    """Returns the slice that selects the positions `chosen` from an array whose first element is at
    the position `begin`."""
    if not chosen:
        return slice(0, 0)
    end = chosen[-1] - begin + (1 if chosen.step > 0 else -1)
    return slice(chosen[0] - begin, None if end < 0 else end, chosen.step)


def voxels_of(dag: Dag) -> Iterator[Voxel]:
    """Yields the set voxels in Morton order."""
    for low, high in _blocks_of(dag):
        for row in dag.points((*low, *high)).tolist():
            yield row[0], row[1], row[2]


def bricks_of(dag: Dag) -> Iterator[tuple[Voxel, BrickCells]]:
    """Yields the low corner and the voxels of each brick in Morton order."""
    brick_level = dag.resolution.bit_length() - 1 - _BRICK_LEVELS
    for low, high in _blocks_of(dag):
        cells = dag.dense((*low, *high))
        region = (*(c >> _BRICK_LEVELS for c in low), *(c >> _BRICK_LEVELS for c in high))
        for corner in (dag.points(region, brick_level) << _BRICK_LEVELS).tolist():
            x, y, z = (a - b for a, b in zip(corner, low))
            yield (corner[0], corner[1], corner[2]), cells[x : x + 4, y : y + 4, z : z + 4].copy()


def _blocks_of(dag: Dag) -> Iterator[tuple[Voxel, Voxel]]:
    """Yields the low and the high corner of each block that has set voxels, in Morton order."""
    levels = dag.resolution.bit_length() - 1
    edge = 1 << min(levels, _BLOCK_LEVELS)
    for x, y, z in (dag.points(level=max(0, levels - _BLOCK_LEVELS)) * edge).tolist():
        yield (x, y, z), (x + edge, y + edge, z + edge)


def components_of(
    dag: Dag,
    connectivity: int,
    largest: SupportsIndex,
    memory: int | str | None,
    progress: Progress,
) -> Components:
    """Returns the components of dag.components()."""
    if connectivity not in (6, 26):
        raise Error(f"connectivity={connectivity!r}: expected 6 or 26", "invalid_input")
    rows = operator.index(largest)
    if not 0 <= rows <= _MAX_COMPONENTS:
        raise Error(f"largest={rows}: expected 0 to {_MAX_COMPONENTS}", "invalid_input")
    with shown(progress) as callback:
        total, found = _native.components(
            dag.path, connectivity == 26, rows, memory_text(memory), callback
        )
    voxels = np.array([size for size, _ in found], np.int64)
    return Components(total, voxels, np.array([box for _, box in found], np.int64).reshape(-1, 6))
