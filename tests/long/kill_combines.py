#!/usr/bin/env python3
"""Kills `voxdag combine` and `voxdag edit` at random moments, and runs the same command again.

    tests/long/kill_combines.py [--voxdag build/cpu/voxdag] [--kills 30] [-r 2048] [--seed 1]

Two scenes are generated and built. Each command is killed (SIGKILL) at a random moment of its
usual time. The script checks these requirements:

  - The output does not exist, or it is the complete file.
  - The next run succeeds, and its file has the SHA-256 of an undisturbed run.
  - No other file is left.

The exit status is 1 if a requirement is violated.
"""

import argparse
import hashlib
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BOUNDS = "-512,-512,-512,1024"
COMMANDS = [
    ["combine", "a.vdag", "--union", "b.vdag"],
    ["combine", "a.vdag", "--minus", "b.vdag", "--memory", "64MiB"],
    ["combine", "a.vdag", "--xor", "b.vdag", "--offset", "5,-3,16", "--clip"],
    ["edit", "a.vdag", "--cut", "sphere:900,800,700,500", "--add", "b.glb"],
]


def run(options, folder, *arguments):
    done = subprocess.run(
        [options.voxdag, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        sys.exit(f"{' '.join(arguments)}: exit status {done.returncode}: {done.stderr}")
    return done.stdout


def make_inputs(options, folder):
    for seed, name in enumerate(("a", "b"), 1):
        run(options, folder, "generate", "soup", f"{name}.glb", "--triangles", "20000",
            "--seed", str(seed))  # fmt: skip
        run(options, folder, "build", f"{name}.glb", "-r", str(options.resolution),
            "--bounds", BOUNDS, "-o", f"{name}.vdag")  # fmt: skip


class Kills:
    def __init__(self, options, folder, command):
        self.options, self.folder = options, folder
        self.output = folder / "out.vdag"
        self.command = [*command, "-o", "out.vdag", "--json"]
        self.inputs = set(folder.iterdir())
        begin = time.monotonic()
        self.digest = self.finish()
        self.seconds = time.monotonic() - begin
        self.finished_early = 0

    def finish(self):
        """Runs the command to its end, and removes the output. Returns its SHA-256."""
        reported = json.loads(run(self.options, self.folder, *self.command))["sha256"]
        assert reported == self.found(), f"{self.command}: the reported SHA-256 is wrong"
        left = set(self.folder.iterdir()) - self.inputs - {self.output}
        assert not left, f"{self.command}: left {left}"
        self.output.unlink()
        return reported

    def found(self):
        return hashlib.sha256(self.output.read_bytes()).hexdigest()

    def kill(self, delay):
        process = subprocess.Popen(
            [self.options.voxdag, *self.command],
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        time.sleep(delay)
        self.finished_early += process.poll() is not None
        process.kill()
        process.wait()
        if self.output.exists():
            assert self.found() == self.digest, f"{self.command}: a partial file"
            self.output.unlink()
        assert self.finish() == self.digest, f"{self.command}: another file after a kill"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--voxdag", type=Path, default="build/cpu/voxdag")
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("-r", "--resolution", type=int, default=2048)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    options.voxdag = options.voxdag.resolve()
    chance = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_inputs(options, folder)
        commands = [Kills(options, folder, command) for command in COMMANDS]
        for i in range(options.kills):
            kills = commands[i % len(commands)]
            kills.kill(chance.uniform(0, kills.seconds))
        early = sum(kills.finished_early for kills in commands)
    print(f"{options.kills} kills, {early} after the end: all files are as expected")


if __name__ == "__main__":
    main()
