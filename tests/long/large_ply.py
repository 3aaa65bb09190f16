#!/usr/bin/env python3
"""Builds a binary PLY file that is many times larger than --memory.

    tests/long/large_ply.py [--voxdag build/cpu/voxdag] [--folder DIR] [--edge 5000]
                            [--resolution 2048]

Writes a hilly sheet of EDGE x EDGE vertices, whose rows of faces are scattered over the file: 906
MiB by default. Builds it with --memory 64MiB and with the default. Checks that the peak of resident
memory is at most 64 MiB above the limit, by the build's report and by the system's own measurement,
and that the files are equal. Takes some minutes and several GB of disk; a scene that the folder has
already is used again.
"""

import argparse
import array
import math
import os
import random
import struct
import sys
import tempfile
from pathlib import Path

from memory_promise import MIB, holds

BUDGET = 64 * MIB


def write_vertices(file, edge):
    hills = [40 * math.sin(i * 0.013) + 9 * math.sin(i * 0.37) for i in range(edge)]
    for x in range(edge):
        row = array.array("f")
        for z in range(edge):
            row.extend((x, hills[x] + hills[z], z))
        if sys.byteorder == "big":
            row.byteswap()
        file.write(row.tobytes())


def write_faces(file, edge):
    """Writes the faces. Neighbors in the sheet are far apart in the file, as are their vertices."""
    face = struct.Struct("<BIII")
    shuffled = random.Random(1)
    columns = list(range(edge - 1))
    for x in range(edge - 1):
        shuffled.shuffle(columns)
        # A permutation of the rows: the step has no divisor in common with their number.
        row = x * step_of(edge - 1) % (edge - 1) * edge
        faces = bytearray()
        for z in columns:
            a, b = row + z, row + edge + z
            faces += face.pack(3, a, a + 1, b)
            faces += face.pack(3, b, a + 1, b + 1)
        file.write(faces)


def step_of(rows):
    step = rows * 5 // 8
    while math.gcd(step, rows) != 1:
        step += 1
    return step


def write_scene(path, edge):
    with open(f"{path}.partial", "wb") as file:
        header = (
            f"ply\nformat binary_little_endian 1.0\nelement vertex {edge * edge}\n"
            "property float x\nproperty float y\nproperty float z\n"
            f"element face {2 * (edge - 1) ** 2}\n"
            "property list uchar uint vertex_indices\nend_header\n"
        )
        file.write(header.encode())
        write_vertices(file, edge)
        write_faces(file, edge)
    os.rename(f"{path}.partial", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--voxdag", default="build/cpu/voxdag")
    parser.add_argument("--folder", help="for the scene and the files; default: a temporary one")
    parser.add_argument("--edge", type=int, default=5000)
    parser.add_argument("--resolution", type=int, default=2048)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(arguments.folder or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        scene = folder / f"sheet{arguments.edge}.ply"
        if not scene.exists():
            write_scene(scene, arguments.edge)
        size = scene.stat().st_size
        print(
            f"{size / MIB:.0f} MiB of binary PLY, "
            f"{2 * (arguments.edge - 1) ** 2 / 1e6:.1f} M triangles",
            flush=True,
        )
        if size < 5 * BUDGET:
            sys.exit(
                f"--edge {arguments.edge}: expected a scene of at least {5 * BUDGET / MIB:.0f} MiB"
            )
        command = [
            arguments.voxdag,
            "build",
            scene,
            "-r",
            str(arguments.resolution),
            "-o",
            folder / "sheet.vdag",
        ]
        return 0 if holds(command, (BUDGET, None)) else 1


if __name__ == "__main__":
    sys.exit(main())
