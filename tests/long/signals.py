#!/usr/bin/env python3
"""Sends signals to commands at random moments, and measures how long they take to end.

    tests/long/signals.py [--voxdag build/cpu/voxdag] [--signals 200] [--limit 1.0]

The commands build scenes (also with large progressive JPEG and interlaced PNG images), resume them,
extract, export in every format, render, generate, verify and plan. Each gets SIGINT, SIGTERM or
SIGHUP at a random moment of the time that it takes undisturbed. The script checks these
requirements:

  - The command ends within --limit seconds of the signal, with exit status 130. Or it had already
    ended when the signal was sent.
  - It leaves no output, no temporary file and no temporary folder, except the files of a build
    that can be resumed.
  - After all signals, every build resumes and has the SHA-256 of an undisturbed build.

Prints the longest wait of each command and of all. The exit status is 1 if a requirement is
violated.
"""

import argparse
import contextlib
import json
import os
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from pathlib import Path

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
FORMATS = ("hashdag", "svdag", "voxel", "vox", "bt", "vdb", "nvdb", "ply", "npz", "glb")
SUFFIXES = {"hashdag": ".basic_dag.dag.bin", "voxel": ".voxel.json"}


def png(width, height):
    """Returns an interlaced image of zeros with one bit per pixel: a few KB for 10^8 pixels."""

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    row, packer = bytes(1 + (width + 7) // 8), zlib.compressobj(9)
    data = b"".join(packer.compress(row) for _ in range(2 * height)) + packer.flush()
    head = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 1)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def jpeg(width, height, scans):
    """Returns a gray progressive image that repeats an empty scan of all coefficients."""

    def segment(marker, data):
        return bytes([255, marker]) + struct.pack(">H", len(data) + 2) + data

    blocks = ((width + 7) // 8) * ((height + 7) // 8)
    frame = struct.pack(">BHHB", 8, height, width, 1) + bytes([1, 0x11, 0])
    out = b"\xff\xd8" + segment(0xDB, b"\0" + b"\1" * 64) + segment(0xC2, frame)
    out += segment(0xC4, b"\0" + bytes([1] + [0] * 15) + b"\0")
    out += segment(0xC4, b"\x10" + bytes([1, 1] + [0] * 14) + b"\xe0\x00")
    out += segment(0xDA, bytes([1, 1, 0, 0, 0, 0])) + bytes((blocks + 7) // 8)
    bits = ""
    while blocks >= 16384:
        run = min(blocks, 32767)
        bits += "0" + format(run - 16384, "014b")
        blocks -= run
    bits += "10" * blocks
    bits += "1" * (-len(bits) % 8)
    packed = int(bits, 2).to_bytes(len(bits) // 8, "big").replace(b"\xff", b"\xff\0")
    return out + (segment(0xDA, bytes([1, 1, 0, 1, 63, 0])) + packed) * scans + b"\xff\xd9"


def textured_triangle(image, mime):
    """Returns a .glb file of one triangle with an image."""
    data = struct.pack("<9f6f", 0, 0, 0, 1, 0, 0, 0, 1, 0.5, 0, 0, 1, 0, 0, 1)
    views = [(0, 36), (36, 24), (60, len(image))]
    data += image + bytes(-len(image) % 4)
    scene = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteOffset": a, "byteLength": n} for a, n in views],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        "images": [{"bufferView": 2, "mimeType": mime}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}
        ],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
    return (
        head
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(data), b"BIN\0")
        + data
    )


class Interrupted:
    """A command that gets signals. `kept` are the names that it may leave."""

    def __init__(self, name, arguments, longest_s=20.0, kept=()):
        self.name, self.arguments, self.kept = name, arguments, set(kept)
        self.longest_s, self.seconds, self.waits, self.early = longest_s, 0.0, [], 0


class Run:
    def __init__(self, options, folder):
        self.options, self.folder = options, folder
        self.random = random.Random(options.seed)
        self.temporary = folder / "tmp"
        self.temporary.mkdir()
        self.failures = []
        self.digests = {}

    def start(self, arguments):
        return subprocess.Popen(
            [self.options.voxdag, *arguments],
            cwd=self.folder,
            env=dict(os.environ, TMPDIR=str(self.temporary)),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )

    def make_scenes(self):
        def write(name, data):
            (self.folder / name).write_bytes(data)

        write("jpeg.glb", textured_triangle(jpeg(16384, 16384, 490), "image/jpeg"))
        write("png.glb", textured_triangle(png(16384, 16384), "image/png"))
        for arguments in (
            ["generate", "city", "city.glb", "--triangles", "300000", "--colors"],
            ["generate", "soup", "soup.glb", "--triangles", "30000"],
            ["build", "city.glb", "-r", "2048", "-o", "in.vdag", "--color"],
        ):
            self.start(arguments).communicate()
        self.inputs = self.names()

    def names(self):
        return {p.name for p in self.folder.iterdir()} | {
            "tmp/" + p.name for p in self.temporary.iterdir()
        }

    def commands(self):
        def build(name, scene, *more):
            output = name + ".vdag"
            return Interrupted(
                "build " + name,
                ["build", scene, "-o", output, "--memory", "3GiB", *more],
                kept=[output + ".work", output + ".partial"],
            )

        yield build("city", "city.glb", "-r", "2048", "--color", "--attributes", "normal")
        yield build("soup", "soup.glb", "-r", "4096", "--subvolume", "512")
        yield build("jpeg", "jpeg.glb", "-r", "16", "--color")
        yield build("png", "png.glb", "-r", "16", "--color")
        yield Interrupted("plan", ["plan", "city.glb", "-r", "8192", "--color"])
        yield Interrupted("extract", ["extract", "in.vdag", "-o", "part.vdag"])
        yield Interrupted("verify", ["verify", "in.vdag", "--against", "city.glb"])
        yield Interrupted("render", ["render", "in.vdag", "-o", "r.png", "--size", "8192x8192"])
        yield Interrupted("generate", ["generate", "spheres", "s.glb", "--triangles", "3000000"])
        for name in FORMATS:
            output = "export" + SUFFIXES.get(name, "." + name)
            yield Interrupted(
                "export " + name, ["export", "in.vdag", "--to", name, "-o", output, "--level", "10"]
            )

    def measure(self, command):
        """Measures the undisturbed command. Returns False if the program was built without it."""
        begin = time.monotonic()
        process = self.start(command.arguments)
        try:
            _, err = process.communicate(timeout=command.longest_s)
            refused = process.returncode not in (0, 1)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            refused = False
        command.seconds = time.monotonic() - begin
        if refused:
            print(f"{command.name}: left out: {err.decode(errors='replace').strip()[-200:]}")
        elif command.name.startswith("build") and process.returncode == 0:
            self.digests[command.name] = self.digest(command)
        self.clean()
        return not refused

    def digest(self, command):
        output = command.arguments[command.arguments.index("-o") + 1]
        return zlib.crc32((self.folder / output).read_bytes())

    def clean(self):
        for name in self.names() - self.inputs:
            subprocess.run(["rm", "-rf", self.folder / name], check=True)

    def interrupt(self, command):
        before = self.names()  # an interrupted build may have left its work folder
        process = self.start(command.arguments)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.communicate(timeout=self.random.uniform(0, command.seconds))
        if process.returncode is not None:
            command.early += 1
            return self.clean()
        number = self.random.choice(SIGNALS)
        begin = time.monotonic()
        process.send_signal(number)
        _, err = process.communicate()
        command.waits.append(time.monotonic() - begin)
        self.check(command, before, process.returncode, number, err)
        if self.random.random() < 0.5:
            self.clean()  # otherwise the next build would resume this one
        return None

    def check(self, command, before, status, number, err):
        # A signal may come before the program catches signals, or after its last check of them.
        if status not in (130, 0, -number):
            self.failures.append(f"{command.name}: status {status}: {err.decode(errors='replace')}")
        if status == 0:
            return
        left = self.names() - before - command.kept
        left = {n for n in left if not any(n.startswith(k) for k in command.kept)}
        if left:
            self.failures.append(f"{command.name}: left {sorted(left)}")
            self.clean()

    def resume(self, command):
        process = self.start(command.arguments)
        _, err = process.communicate()
        if process.returncode != 0 or self.digest(command) != self.digests[command.name]:
            self.failures.append(
                f"{command.name} does not resume: {err.decode(errors='replace').strip()}"
            )
        self.clean()

    def run(self):
        self.make_scenes()
        commands = [c for c in self.commands() if self.measure(c)]
        sent = 0
        while sent < self.options.signals:
            command = self.random.choice(commands)
            before = len(command.waits)
            self.interrupt(command)
            sent += len(command.waits) - before
        for command in commands:
            if command.name in self.digests:
                self.resume(command)
        for command in commands:
            longest = max(command.waits, default=0)
            print(
                f"{command.name:16} {command.seconds:6.1f} s  {len(command.waits):3} signals  "
                f"{command.early:3} had ended  longest wait {longest:.3f} s"
            )
        waits = sorted(w for c in commands for w in c.waits)
        print(
            f"{sent} signals (seed {self.options.seed}): longest wait {waits[-1]:.3f} s, median "
            f"{waits[len(waits) // 2]:.3f} s, {len(self.failures)} failures"
        )
        for failure in self.failures:
            print(failure)
        return not self.failures and waits[-1] <= self.options.limit


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--voxdag", default="build/cpu/voxdag", type=Path)
    parser.add_argument("--signals", default=200, type=int)
    parser.add_argument("--limit", default=1.0, type=float, help="seconds until a command ends")
    parser.add_argument("--seed", default=1, type=int)
    options = parser.parse_args()
    options.voxdag = options.voxdag.resolve()
    with tempfile.TemporaryDirectory(prefix="voxdag-signals-") as folder:
        sys.exit(0 if Run(options, Path(folder)).run() else 1)


if __name__ == "__main__":
    main()
