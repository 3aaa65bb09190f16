"""Decoders of the formats that `voxdag export` writes, from the formats' descriptions.

Each takes the path of the file and the resolution of the exported grid, and returns an array of the
cells, n x 3, in any order. They share nothing with the exporter.
"""

import json

import numpy


def child_bits(masks):
    """For an array of 8-bit masks the pairs (row, bit) of all set bits, by row and bit."""
    return numpy.nonzero(masks.astype(numpy.uint8)[:, None] >> numpy.arange(8) & 1)


def popcount_below(masks, bits):
    below = masks.astype(numpy.int64) & ((1 << bits.astype(numpy.int64)) - 1)
    return numpy.array([bin(i).count("1") for i in range(256)])[below]


def child_corners(corners, bits, axes=(4, 2, 1)):
    """Corners of children, in units of the children's edge; `axes` are the bits of x, y and z."""
    return 2 * corners + numpy.stack([(bits & axis) // axis for axis in axes], axis=1)


def ply(path, grid):
    with open(path, "rb") as file:
        lines = []
        while not lines or lines[-1] != b"end_header":
            lines.append(file.readline().rstrip(b"\n"))
        assert lines[:2] == [b"ply", b"format binary_little_endian 1.0"], lines
        properties = [line for line in lines if line.startswith(b"property")]
        assert properties == [b"property double " + axis for axis in (b"x", b"y", b"z")], lines
        (count,) = [int(line.split()[2]) for line in lines if line.startswith(b"element vertex")]
        data = file.read()
    assert len(data) == 24 * count
    return grid.cells(numpy.frombuffer(data, "<f8").reshape(-1, 3))


def npz(path, grid):
    with numpy.load(path) as arrays:  # checks the CRC of each array, too
        assert sorted(arrays.files) == ["cells", "grid", "positions"]
        assert arrays["cells"].dtype == numpy.int32 and arrays["positions"].dtype == numpy.float64
        assert (arrays["grid"] == [*grid.origin, grid.voxel]).all()
        assert (grid.cells(arrays["positions"]) == arrays["cells"]).all()
        return arrays["cells"]


def missing(name):
    """The library that decoding needs and that is not here, or nothing."""
    del name
    return None
