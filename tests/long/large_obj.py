#!/usr/bin/env python3
"""Builds an OBJ file that is many times larger than --memory, and the same scene as glTF.

    tests/long/large_obj.py [--voxdag build/cpu/voxdag] [--folder DIR] [--edge 2750]
                            [--resolution 2048]

Writes a hilly sheet of EDGE x EDGE vertices with texture coordinates: 1 GB of OBJ by default.
Builds it with --memory 64MiB and with the default. Checks that the peak of resident memory is at
most 64 MiB above the limit, by the build's report and by the system's own measurement, and that the
files are equal. Then builds the glTF file, whose voxels must be the same, for comparison of the CPU
time. Takes some minutes and several GB of disk; scenes that the folder has already are used again.
"""

import argparse
import json
import math
import os
import struct
import sys
import tempfile
from pathlib import Path

from memory_promise import MIB, holds

BUDGET = 64 * MIB


def single(value):
    """Rounds to single precision, so that both files have the same positions."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def heights(edge):
    hills = [single(40 * math.sin(i * 0.013) + 9 * math.sin(i * 0.37)) for i in range(edge)]
    for x in range(edge):
        yield x, [single(hills[x] + hills[z]) for z in range(edge)]


def faces(edge, first):
    """Yields, for each row of the sheet, the vertex indices of its triangles."""
    for x in range(edge - 1):
        row = first + x * edge
        yield [
            corners
            for a in range(row, row + edge - 1)
            for corners in ((a, a + 1, a + edge), (a + edge, a + 1, a + edge + 1))
        ]


def write_obj(path, edge):
    with open(f"{path}.partial", "w") as file:
        file.write("# a sheet\no sheet\n")
        for x, row in heights(edge):
            file.write("".join(f"v {x} {y:.9g} {z}\n" for z, y in enumerate(row)))
        for x in range(edge):
            u = x / (edge - 1)
            file.write("".join(f"vt {u:.6f} {z / (edge - 1):.6f}\n" for z in range(edge)))
        for row in faces(edge, 1):
            file.write("".join("f {0}/{0} {1}/{1} {2}/{2}\n".format(*c) for c in row))
    os.rename(f"{path}.partial", path)


def write_glb(path, edge):
    vertices, corners = edge * edge, 6 * (edge - 1) ** 2
    buffers = [12 * vertices, 4 * corners]
    views = [{"buffer": 0, "byteLength": buffers[0]}]
    views.append({"buffer": 0, "byteOffset": buffers[0], "byteLength": buffers[1]})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": sum(buffers)}],
        "bufferViews": views,
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": corners, "type": "SCALAR"},
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    with open(f"{path}.partial", "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + sum(buffers)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", sum(buffers), b"BIN\0"))
        for x, row in heights(edge):
            numbers = [number for z, y in enumerate(row) for number in (x, y, z)]
            file.write(struct.pack(f"<{len(numbers)}f", *numbers))
        for row in faces(edge, 0):
            indices = [index for corners in row for index in corners]
            file.write(struct.pack(f"<{len(indices)}I", *indices))
    os.rename(f"{path}.partial", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--voxdag", default="build/cpu/voxdag")
    parser.add_argument("--folder", help="for the scenes and the files; default: a temporary one")
    parser.add_argument("--edge", type=int, default=2750)
    parser.add_argument("--resolution", type=int, default=2048)
    arguments = parser.parse_args()
    edge = arguments.edge
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(arguments.folder or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        obj, glb = folder / f"sheet{edge}.obj", folder / f"sheet{edge}.glb"
        for path, write in ((obj, write_obj), (glb, write_glb)):
            if not path.exists():
                write(path, edge)
        print(
            f"{obj.stat().st_size / MIB:.0f} MiB of OBJ, {glb.stat().st_size / MIB:.0f} MiB of "
            f"glTF, {2 * (edge - 1) ** 2 / 1e6:.1f} M triangles",
            flush=True,
        )
        if obj.stat().st_size < 5 * BUDGET:
            sys.exit(f"--edge {edge}: expected a scene of at least {5 * BUDGET / MIB:.0f} MiB")
        within = True
        for path, budgets in ((obj, (BUDGET, None)), (glb, (BUDGET,))):
            print(path.name, flush=True)
            command = [arguments.voxdag, "build", path, "-r", str(arguments.resolution)]
            within &= holds([*command, "-o", folder / "sheet.vdag"], budgets)
        return 0 if within else 1


if __name__ == "__main__":
    sys.exit(main())
