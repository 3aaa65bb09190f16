"""The scenes of the benchmarks: files in a folder, and a hairball that is generated if needed."""

import importlib.util
import json
import struct
import sys
from array import array
from pathlib import Path

from measure import run

HAIRBALL = "hairball"


def can_make_hairball(options):
    """True if --hairball was given, or its generator is next to the scenes and numpy exists."""
    return bool(options.hairball) or (
        (options.scenes / "../tools/gen_hairball.py").exists()
        and importlib.util.find_spec("numpy") is not None
    )


def hairball(options, folder):
    """Returns a scene of a million slivers: the file of --hairball, or a file that a script next to
    the scenes generates in `folder`."""
    if options.hairball:
        return options.hairball
    path = folder / f"{HAIRBALL}.glb"
    if not path.exists():
        run([sys.executable, options.scenes / "../tools/gen_hairball.py", path])
    return path


def scene_path(name, options, folder):
    return hairball(options, folder) if name == HAIRBALL else options.scenes / f"{name}.glb"


def add_hairball_option(parser):
    parser.add_argument("--hairball", type=Path, help="an existing hairball.glb")


def glb_to_obj(glb, obj):
    """The meshes of a .glb without transforms, as .obj."""
    data = glb.read_bytes()
    (json_bytes,) = struct.unpack_from("<I", data, 12)
    document = json.loads(data[20 : 20 + json_bytes])
    binary = data[28 + json_bytes :]

    def values(number, code, each):
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        out = array(code)
        out.frombytes(binary[start : start + accessor["count"] * each * out.itemsize])
        return out

    with obj.open("w") as out:
        first = 1
        for mesh in document["meshes"]:
            for primitive in mesh["primitives"]:
                points = values(primitive["attributes"]["POSITION"], "f", 3)
                corners = values(primitive["indices"], "I", 1)
                for i in range(0, len(points), 3):
                    x, y, z = points[i : i + 3]
                    out.write(f"v {x:.9g} {y:.9g} {z:.9g}\n")
                for i in range(0, len(corners), 3):
                    a, b, c = (first + corner for corner in corners[i : i + 3])
                    out.write(f"f {a} {b} {c}\n")
                first += len(points) // 3
