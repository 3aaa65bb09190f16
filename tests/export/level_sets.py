"""Readers of level sets: the grid `sdf` of .vdb and .nvdb files."""

import subprocess

import numpy
from decoders import pyopenvdb


def vdb(path, grid, low, edge, band):
    """Returns the values and the active states of the cube of `edge` cells at `low`, whose three
    coordinates are equal."""
    read = pyopenvdb.read(path, "surface")
    assert read.gridClass == pyopenvdb.GridClass.LEVEL_SET
    assert abs(read.background - band * grid.voxel) < 1e-6 * grid.voxel
    corner = numpy.array(read.transform.indexToWorld((0, 0, 0)))
    assert numpy.abs(corner - (grid.origin + grid.voxel / 2)).max() < 1e-6 * grid.voxel
    values = numpy.zeros((edge,) * 3, numpy.float32)
    read.copyToArray(values, ijk=low)
    active = numpy.zeros((edge,) * 3, bool)
    for item in read.citerOnValues():
        assert item.min == item.max, "an active tile"
        active[tuple(numpy.array(item.min) - low)] = True
    return values, active


def nvdb(path, grid, low, edge, band, reader):
    """Returns the same as vdb()."""
    read = subprocess.run(
        [reader, path, "surface", str(low[0]), str(edge)], capture_output=True, check=True
    )
    numbers = numpy.frombuffer(read.stdout)
    background, corner = numbers[0], numbers[1:4]
    assert abs(background - band * grid.voxel) < 1e-6 * grid.voxel
    assert numpy.abs(corner - (grid.origin + grid.voxel / 2)).max() < 1e-6 * grid.voxel
    values, active = numbers[4:].reshape(-1, 2).T.reshape((2,) + (edge,) * 3)
    return values.astype(numpy.float32), active == 1
