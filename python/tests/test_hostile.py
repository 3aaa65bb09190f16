"""Damaged and malicious files raise voxdag.Error, or are read; they neither end nor stop Python."""

import json
import os
import random
import struct

import numpy as np
import pytest
import voxdag

TRIES = 60
MEMORY = "64MiB"


def damaged(data, source):
    """Returns the bytes with one to four random faults."""
    data = bytearray(data)
    for _ in range(source.randint(1, 4)):
        at = source.randrange(len(data))
        kind = source.randrange(5)
        if kind == 0:
            data[at] ^= 1 << source.randrange(8)
        elif kind == 1:
            value = source.choice((0, 1, 2**31 - 1, 2**32 - 1, source.getrandbits(32)))
            data[at : at + 4] = struct.pack("<I", value)
        elif kind == 2:
            data[at : at + 16] = data[source.randrange(len(data)) :][:16]
        elif kind == 3 and len(data) > 64:
            del data[at : at + source.randint(1, 64)]
        else:
            del data[max(1, at) :]
    return bytes(data)


def glb(vertices, triangles):
    parts = [vertices.astype("<f4").tobytes(), triangles.astype("<u4").tobytes()]
    views = [{"buffer": 0, "byteLength": len(parts[0])}]
    views.append({"buffer": 0, "byteOffset": len(parts[0]), "byteLength": len(parts[1])})
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": triangles.size, "type": "SCALAR"},
    ]
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [1, 2, 3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": sum(map(len, parts))}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(parts)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def ply(vertices, triangles):
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
    head += "property float x\nproperty float y\nproperty float z\n"
    head += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = b"".join(struct.pack("<B3i", 3, *face) for face in triangles)
    return head.encode() + vertices.astype("<f4").tobytes() + faces


def stl(vertices, triangles):
    corners = vertices[triangles].astype("<f4").reshape(-1, 9)
    facets = b"".join(bytes(12) + row.tobytes() + b"\0\0" for row in corners)
    return bytes(80) + struct.pack("<I", len(corners)) + facets


def obj(vertices, triangles):
    lines = ["v {} {} {}".format(*vertex) for vertex in vertices]
    lines += ["f {} {} {}".format(*face) for face in triangles + 1]
    return "\n".join(lines).encode()


def xyz(vertices, _):
    return "\n".join("{} {} {}".format(*vertex) for vertex in vertices).encode()


def query(dag):
    """Reads all parts of a file."""
    center = [dag.resolution // 2] * 3
    dag.lookup([center])
    dag.count()
    dag.dense((0, 0, 0, 32, 32, 32))
    dag.points(level=3)
    dag.rays(np.array([[-10.0, 0, 0]]), np.array([[1.0, 0, 0]]))
    dag.nearest([center])
    sum(1 for _, _ in zip(dag.bricks(), range(1000)))
    return dag.levels, dag.bounds, dag.digest, repr(dag)


def test_damaged_dags(path, tmp_path):
    good = path.read_bytes()
    source = random.Random(1)
    refused = 0
    for number in range(TRIES):
        file = tmp_path / f"{number}.vdag"
        file.write_bytes(damaged(good, source))
        try:
            with voxdag.open(file) as dag:
                query(dag)
        except voxdag.Error as error:
            refused += error.code in ("corrupt", "invalid_input", "unsupported_version")
        file.unlink()
    assert refused > TRIES // 2


def test_other_files_are_no_dags(tmp_path):
    os.mkfifo(tmp_path / "pipe.vdag")
    (tmp_path / "folder.vdag").mkdir()
    (tmp_path / "empty.vdag").write_bytes(b"")
    (tmp_path / "link.vdag").symlink_to("/dev/zero")
    with open(tmp_path / "huge.vdag", "wb") as file:
        file.truncate(1 << 40)
    for file in tmp_path.iterdir():
        with pytest.raises(voxdag.Error):
            voxdag.open(file)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("form", [glb, ply, stl, obj, xyz])
def test_damaged_scenes(mesh, tmp_path, form):
    vertices, triangles = mesh
    good = form(vertices[:200], triangles[(triangles < 200).all(axis=1)])
    source = random.Random(2)
    read = 0
    for number in range(-1, TRIES // 3):
        file = tmp_path / f"scene.{form.__name__}"
        file.write_bytes(good if number < 0 else damaged(good, source))
        try:
            voxdag.build(
                file,
                resolution=64,
                output=tmp_path / "x.vdag",
                memory=MEMORY,
                skip_invalid=True,
                force=True,
            )
            read += 1
        except voxdag.Error:
            assert number >= 0
    assert read > 0
