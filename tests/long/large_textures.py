#!/usr/bin/env python3
"""Builds a scene of 600 million texels with colors, within little memory.

    tests/long/large_textures.py [--voxdag build/cpu/voxdag] [--folder DIR] [--resolution 2048]

Writes a scene of 21 walls, each with a separate PNG: one of 16384 x 16384 texels, of which every
eighth row is different, and 20 of 4096 x 4096. Decoded they are 2.4 GB, as pyramids 6.4 GB. Builds
it with --memory 64MiB, 256MiB and the default. Checks that the peak of resident memory is at most
64 MiB above the limit, and that the files are equal. Takes 8 GB of disk and some minutes; a scene
that the folder has already is used again.
"""

import argparse
import json
import struct
import sys
import tempfile
import zlib
from pathlib import Path

from memory_promise import MIB, holds

SIZES = [16384] + [4096] * 20


def write_png(path, edge, seed):
    """Writes a PNG with ramps in all channels, shifted from row to row. The file is small, although
    no two neighboring texels are equal."""

    def chunk(kind, data):
        checksum = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", checksum)

    ramp = bytes((x * (c + 1) + 37 * seed) & 255 for x in range(256) for c in range(3))
    ramps = ramp * (edge // 256 + 1)
    packer = zlib.compressobj(1)
    packed = []
    repeats = edge // 2048 or 1
    for y in range(0, edge, repeats):
        shift = 3 * ((y * 7 // repeats + (y >> 6)) & 255)
        packed.append(packer.compress((b"\0" + ramps[shift : shift + 3 * edge]) * repeats))
    packed.append(packer.flush())
    header = struct.pack(">IIBBBBB", edge, edge, 8, 2, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", b"".join(packed))
        + chunk(b"IEND", b"")
    )


def write_scene(folder):
    """Writes a scene of tilted walls, one behind the other. Each wall shows its complete image."""
    scene = folder / "walls.gltf"
    if scene.exists():
        return scene
    positions, coordinates = [], []
    for i, edge in enumerate(SIZES):
        write_png(folder / f"wall{i}.png", edge, i)
        z = i / len(SIZES)
        for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)):
            positions += [x, y, z + 0.03 * x + 0.01 * y]
            coordinates += [x, 1 - y]
    indices = [0, 1, 2, 0, 2, 3]
    data = struct.pack(f"<{len(positions)}f", *positions)
    data += struct.pack(f"<{len(coordinates)}f", *coordinates) + struct.pack("<6H", *indices)
    (folder / "walls.bin").write_bytes(data)
    count = len(SIZES)
    views = [(0, 48 * count), (48 * count, 32 * count), (80 * count, 12)]
    accessors = [{"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}]
    for i in range(count):
        accessors.append(
            {
                "bufferView": 0,
                "byteOffset": 48 * i,
                "componentType": 5126,
                "count": 4,
                "type": "VEC3",
                "min": [0, 0, 0],
                "max": [1, 1, 2],
            }
        )
        accessors.append(
            {
                "bufferView": 1,
                "byteOffset": 32 * i,
                "componentType": 5126,
                "count": 4,
                "type": "VEC2",
            }
        )
    scene.write_text(
        json.dumps(
            {
                "asset": {"version": "2.0"},
                "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0}],
                "meshes": [
                    {
                        "primitives": [
                            {
                                "attributes": {"POSITION": 2 * i + 1, "TEXCOORD_0": 2 * i + 2},
                                "indices": 0,
                                "material": i,
                            }
                            for i in range(count)
                        ]
                    }
                ],
                "materials": [
                    {"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}}
                    for i in range(count)
                ],
                "textures": [{"source": i} for i in range(count)],
                "images": [{"uri": f"wall{i}.png"} for i in range(count)],
                "buffers": [{"uri": "walls.bin", "byteLength": len(data)}],
                "bufferViews": [
                    {"buffer": 0, "byteOffset": at, "byteLength": size} for at, size in views
                ],
                "accessors": accessors,
            }
        )
    )
    return scene


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--voxdag", default="build/cpu/voxdag")
    parser.add_argument("--folder", help="for the scene and the files; default: a temporary one")
    parser.add_argument("--resolution", type=int, default=2048)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(arguments.folder or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        scene = write_scene(folder)
        texels = sum(edge * edge for edge in SIZES)
        print(f"{len(SIZES)} images, {texels / 1e6:.0f} M texels", flush=True)
        command = [
            arguments.voxdag,
            "build",
            scene,
            "-r",
            str(arguments.resolution),
            "--color",
            "-o",
            folder / "walls.vdag",
        ]
        return 0 if holds(command, (64 * MIB, 256 * MIB, None)) else 1


if __name__ == "__main__":
    sys.exit(main())
