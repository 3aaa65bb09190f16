#!/usr/bin/env python3
"""Builds a LAS file of 50 million points within 256 MiB.

    tests/long/large_points.py [--voxdag build/cpu/voxdag] [--folder DIR] [--points 50000000]
                               [--resolution 65536]

Writes a hilly terrain of random points with colors (LAS 1.2, point format 2): 1.3 GB by default.
Builds it with --memory 256MiB and with the default. Checks that the peak of resident memory is at
most 64 MiB above the limit, by the build's report and by the system's own measurement, and that the
files are equal. Takes some minutes and several GB of disk; a scene that the folder has already is
used again.
"""

import argparse
import math
import os
import random
import struct
import sys
import tempfile
from pathlib import Path

from memory_promise import MIB, holds

BUDGET = 256 * MIB
EXTENT = 1_000_000  # edge of the terrain, in thousandths of a unit
WINDOW = 1 << 16  # points that are packed in one step
RECORD = struct.Struct("<3i8x3H")  # position, other members, color


def header(points):
    head = bytearray(227)
    struct.pack_into("<4s20x2B", head, 0, b"LASF", 1, 2)
    struct.pack_into("<HI", head, 94, len(head), len(head))
    struct.pack_into("<BHI", head, 104, 2, RECORD.size, points)
    struct.pack_into("<6d", head, 131, 0.001, 0.001, 0.001, 0, 0, 0)
    return bytes(head)


def record(numbers):
    """Returns the record of a point: its position in the plane, its height, and its color."""
    bits = numbers.getrandbits(88)
    x, y = (bits & 0xFFFFF) * EXTENT >> 20, (bits >> 20 & 0xFFFFF) * EXTENT >> 20
    z = int(40_000 * math.sin(x * 2e-5) + 9_000 * math.sin(y * 3e-4))
    return RECORD.pack(x, y, z, bits >> 40 & 0xFFFF, bits >> 56 & 0xFFFF, bits >> 72)


def write_las(path, points):
    numbers = random.Random(1)
    with open(f"{path}.partial", "wb") as file:
        file.write(header(points))
        for first in range(0, points, WINDOW):
            count = min(WINDOW, points - first)
            file.write(b"".join(record(numbers) for _ in range(count)))
    os.rename(f"{path}.partial", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--voxdag", default="build/cpu/voxdag")
    parser.add_argument("--folder", help="for the scene and the files; default: a temporary one")
    parser.add_argument("--points", type=int, default=50_000_000)
    parser.add_argument("--resolution", type=int, default=65536)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(arguments.folder or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        scene = folder / f"terrain{arguments.points}.las"
        if not scene.exists():
            write_las(scene, arguments.points)
        print(f"{scene.stat().st_size / MIB:.0f} MiB of LAS", flush=True)
        command = [arguments.voxdag, "build", scene, "-r", str(arguments.resolution)]
        return 0 if holds([*command, "-o", folder / "terrain.vdag"], (BUDGET, None)) else 1


if __name__ == "__main__":
    sys.exit(main())
