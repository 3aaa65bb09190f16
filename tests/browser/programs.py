"""Programs that the viewer's test starts: `voxdag`, and the two servers of the viewer."""

import json
import re
import signal
import socket
import struct
import subprocess
import time
import urllib.request
from array import array

START_S = 60


class Voxdag:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder

    def run(self, *words):
        return self.run_both(*words).stdout

    def run_both(self, *words):
        done = subprocess.run(
            [self.program, *map(str, words)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"voxdag {' '.join(map(str, words))}:\n{done.stderr}"
        return done

    def build(self, kind, resolution, *options):
        scene, built = self.folder / f"{kind}.glb", self.folder / f"{kind}_{resolution}.vdag"
        self.run("generate", kind, scene, *options)
        self.run("build", scene, "-r", resolution, "-o", built)
        return built

    def render(self, built, camera, width, height, path=None):
        """Returns the distances along the rays, rows from the top; the sky is infinite."""
        path = path or self.folder / "depth.npy"
        self.run(
            "render",
            built,
            "-o",
            self.folder / "picture.png",
            *camera.split(),
            "--force",
            "--size",
            f"{width}x{height}",
            "--samples",
            1,
            "--depth",
            path,
        )
        return read_npy(path, width, height)

    def named_view(self, built, name):
        """Returns the camera options that `render` prints for a named view."""
        printed = self.run(
            "render",
            built,
            "-o",
            self.folder / "view.png",
            "--view",
            name,
            "--size",
            "48x27",
            "--samples",
            1,
            "--force",
        )
        return re.search(r"--camera .*", printed)[0]

    def printed_camera(self, built, camera):
        """Returns the camera that `render` prints for these options."""
        printed = self.run(
            "render",
            built,
            "-o",
            self.folder / "view.png",
            *camera.split(),
            "--size",
            "16x9",
            "--samples",
            1,
            "--force",
            "--json",
        )
        return json.loads(printed)


def read_npy(path, width, height):
    data = path.read_bytes()
    assert data[:6] == b"\x93NUMPY", "not an npy file"
    (length,) = struct.unpack_from("<H", data, 8)
    header = data[10 : 10 + length].decode()
    assert "'<f4'" in header and f"({height}, {width})" in header.replace(",)", ")"), header
    depths = array("f")
    depths.frombytes(data[10 + length :])
    assert len(depths) == width * height
    return depths


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Server:
    """A server process that prints its address."""

    def __init__(self, command, folder, name):
        self.command, self.log_path = [str(word) for word in command], folder / f"{name}.log"
        self.start()

    def start(self):
        with open(self.log_path, "w", encoding="utf-8") as log:
            self.process = subprocess.Popen(self.command, stdout=log, stderr=log)
        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline and self.process.poll() is None:
            if found := re.search(r"(http://[\w.:]+[0-9])", self.log()):
                self.url = found[1]
                return
            time.sleep(0.05)
        raise SystemExit(f"the server did not start:\n{self.log()}")

    def log(self):
        return self.log_path.read_text(encoding="utf-8")

    def kill(self):
        self.process.kill()
        self.process.wait()

    def get(self, path, headers=None):
        with urllib.request.urlopen(
            urllib.request.Request(self.url + path, headers=headers or {})
        ) as answer:
            return answer.read()

    def post(self, path, body, headers=None):
        request = urllib.request.Request(
            self.url + path,
            json.dumps(body).encode(),
            method="POST",
            headers={"Content-Type": "application/json", **(headers or {})},
        )
        with urllib.request.urlopen(request) as answer:
            return json.load(answer)

    def send(self, method, path, data=None):
        with urllib.request.urlopen(
            urllib.request.Request(self.url + path, data, method=method)
        ) as answer:
            return answer.read()

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if kind is not None:
            self.kill()
            print(f"the end of the server's log:\n{self.log()[-4000:]}")
            return
        self.process.send_signal(signal.SIGTERM)
        assert self.process.wait(timeout=60) == 0, f"the server did not stop cleanly:\n{self.log()}"


class DagFile:
    """A reader of .vdag files, written from docs/format.md alone. Reads single voxels."""

    def __init__(self, path):
        self.data = path.read_bytes()
        self.levels = struct.unpack_from("<I", self.data, 16)[0]
        self.origin = struct.unpack_from("<3d", self.data, 32)
        self.edge = struct.unpack_from("<d", self.data, 56)[0]
        self.resolution = 2**self.levels
        self.offsets = [
            struct.unpack_from("<Q", self.data, 128 + 32 * level)[0]
            for level in range(self.levels - 1)
        ]

    def word(self, level, index):
        return struct.unpack_from("<I", self.data, self.offsets[level] + 4 * index)[0]

    def find(self, voxel, level):
        """Returns the word offset of the node of `level` that contains a voxel; None if empty."""
        offset = 0
        for above in range(level):
            shift = self.levels - 1 - above
            x, y, z = ((c >> shift) & 1 for c in voxel)
            child, mask = 4 * x + 2 * y + z, self.word(above, offset)
            if not mask >> child & 1:
                return None
            offset = self.word(above, offset + 1 + (mask & ((1 << child) - 1)).bit_count())
        return offset

    def is_set(self, voxel):
        brick = self.find(voxel, self.levels - 2)
        if brick is None:
            return False
        x, y, z = voxel
        bit = (
            32 * (x >> 1 & 1)
            + 16 * (y >> 1 & 1)
            + 8 * (z >> 1 & 1)
            + 4 * (x & 1)
            + 2 * (y & 1)
            + (z & 1)
        )
        mask = self.word(self.levels - 2, brick) | self.word(self.levels - 2, brick + 1) << 32
        return bool(mask >> bit & 1)
