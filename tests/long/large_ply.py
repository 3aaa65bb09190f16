#!/usr/bin/env python3
"""A binary PLY of many times --memory.

    tests/long/large_ply.py [--voxdag build/cpu/voxdag] [--folder DIR] [--edge 5000] [--resolution 2048]

Writes a hilly sheet of EDGE x EDGE vertices, whose rows of faces are scattered over the file: 906 MiB by default.
Builds it with --memory 64MiB and with the default. What must hold: the peak of resident memory is at most 64 MiB above what
was given, by the build's report and by the system's own measurement, and the files are equal. Takes some minutes and several GB of
disk; a scene that the folder has already is used again.
"""

import argparse
import array
import json
import math
import os
import random
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

MIB = 1 << 20
BUDGET = 64 * MIB
ALLOWANCE = 64 * MIB  # of the promise of --memory


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
    """Neighbors in the sheet are far apart in the file, and their vertices as well."""
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
        file.write(
            f"ply\nformat binary_little_endian 1.0\nelement vertex {edge * edge}\n"
            "property float x\nproperty float y\nproperty float z\n"
            f"element face {2 * (edge - 1) ** 2}\nproperty list uchar uint vertex_indices\nend_header\n".encode())
        write_vertices(file, edge)
        write_faces(file, edge)
    os.rename(f"{path}.partial", path)


def build(voxdag, scene, output, resolution, memory):
    """The report, and the peak of resident memory that the system measured."""
    command = [voxdag, "build", scene, "-r", str(resolution), "-o", output, "--force", "--json"]
    if memory:
        command += ["--memory", str(memory)]
    with tempfile.TemporaryFile() as out:
        process = subprocess.Popen(command, stdout=out)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            sys.exit(f"voxdag build: status {process.returncode}")
        out.seek(0)
        return json.load(out), usage.ru_maxrss * 1024


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
        print(f"{size / MIB:.0f} MiB of binary PLY, {2 * (arguments.edge - 1) ** 2 / 1e6:.1f} M triangles", flush=True)
        if size < 5 * BUDGET:
            sys.exit(f"--edge {arguments.edge}: expected a scene of at least {5 * BUDGET / MIB:.0f} MiB")
        digests, failed = set(), False
        for memory in (BUDGET, None):
            report, measured = build(arguments.voxdag, scene, folder / "sheet.vdag", arguments.resolution, memory)
            peak = max(report["peak_rss_bytes"], measured)
            digests.add(report["sha256"])
            broken = memory is not None and peak > memory + ALLOWANCE
            failed |= broken
            given = f"{memory // MIB} MiB" if memory else "default"
            print(f"--memory {given:8} peak {peak / MIB:6.0f} MiB  wall {report['wall_s']:6.1f} s  "
                  f"CPU {report['cpu_s']:6.1f} s  {report['voxels']} voxels{'  TOO MUCH' if broken else ''}", flush=True)
        if len(digests) != 1:
            print("the files differ")
            failed = True
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
