"""A scene whose material cuts out parts of its surfaces."""

import json
import random
import struct
import zlib


def png(width, height, pixels):
    """Returns a PNG file of RGBA pixels."""

    def chunk(kind, data):
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    rows = b"".join(b"\0" + pixels[4 * width * y : 4 * width * (y + 1)] for y in range(height))
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0))
        + chunk(b"IDAT", zlib.compress(rows))
        + chunk(b"IEND", b"")
    )


def write_cutouts(path):
    """Writes a scene of 400 quads. Their image, in a separate file, is visible only in every third
    column."""
    corners, texture = [], []
    generator = random.Random(1)
    for _ in range(400):
        at, *sides = [[generator.uniform(-1, 1) for _ in range(3)] for _ in range(3)]
        for u, v in [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)]:
            corners += [10 * a + u * b + v * c for a, b, c in zip(at, *sides)]
            texture += [u, v]
    data = struct.pack(f"<{len(corners)}f{len(texture)}f", *corners, *texture)
    split = 4 * len(corners)
    path.with_name("cutouts.bin").write_bytes(data)
    pixels = b"".join(bytes([30, 160, 90, 255 if i % 3 == 0 else 0]) for i in range(256))
    path.with_name("cutouts.png").write_bytes(png(16, 16, pixels))
    count = len(texture) // 2
    path.write_text(
        json.dumps(
            {
                "asset": {"version": "2.0"},
                "buffers": [{"uri": "cutouts.bin", "byteLength": len(data)}],
                "bufferViews": [
                    {"buffer": 0, "byteLength": split},
                    {"buffer": 0, "byteOffset": split, "byteLength": len(data) - split},
                ],
                "accessors": [
                    {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"},
                    {"bufferView": 1, "componentType": 5126, "count": count, "type": "VEC2"},
                ],
                "images": [{"uri": "cutouts.png"}],
                "textures": [{"source": 0}],
                "materials": [
                    {
                        "alphaMode": "MASK",
                        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                    }
                ],
                "meshes": [
                    {
                        "primitives": [
                            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}
                        ]
                    }
                ],
                "nodes": [{"mesh": 0}],
                "scenes": [{"nodes": [0]}],
                "scene": 0,
            }
        )
    )
