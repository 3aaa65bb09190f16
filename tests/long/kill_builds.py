#!/usr/bin/env python3
"""Kills builds at random moments, and immediately runs the same command again.

    tests/long/kill_builds.py [--voxdag build/cpu/voxdag] [--kills 300] [--scene FILE]
                              [--generate "terrain --triangles 400000"] [-r 2048]
                              [--color] [--build-options "--threads 2"] [--seed 1]

Without --scene a scene is generated. With --color the file has colors. Each build is killed
(SIGKILL) one to six times, each time at a random moment of the remaining time, and started again
without a pause. After the last kill it runs to its end. The script checks these requirements:

  - No command is refused or fails, whatever files and locks the killed command has left.
  - The file has the SHA-256 of an undisturbed build, and no other file is left.

Prints a line per 25 kills, and the totals. The exit status is 1 if a requirement is violated.
"""

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path


class Builds:
    def __init__(self, options, folder):
        self.seed = options.seed
        self.random = random.Random(options.seed)
        self.output = folder / "out.vdag"
        scene = options.scene
        if not scene:
            scene = folder / "scene.glb"
            subprocess.run(
                [options.voxdag, "generate", *options.generate.split(), scene],
                check=True,
                stdout=subprocess.DEVNULL,
            )
        self.command = (
            [
                options.voxdag,
                "build",
                scene,
                "-r",
                str(options.resolution),
                "-o",
                self.output,
                "--json",
            ]
            + options.build_options.split()
            + ["--color"] * options.color
        )
        self.kills = self.waits = self.finished_early = 0
        self.failures = []

    def start(self):
        return subprocess.Popen(
            self.command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def end(self, process):
        """Waits for a build. Returns the SHA-256 that it reports, or None if it failed."""
        out, err = process.communicate()
        self.waits += err.count("is in use by another build: waiting")
        if process.returncode == 0:
            return json.loads(out)["sha256"]
        self.failures.append(f"exit status {process.returncode}: {err.strip()}")
        return None

    def clean(self):
        names = sorted(p.name for p in self.output.parent.iterdir() if p.name.startswith("out."))
        if names != ["out.vdag", "out.vdag.report.json"]:
            self.failures.append(f"left: {names}")
        for suffix in ("", ".report.json"):
            Path(str(self.output) + suffix).unlink(missing_ok=True)

    def measure(self):
        begin = time.monotonic()
        self.expected = self.end(self.start())
        self.seconds = time.monotonic() - begin
        self.clean()

    def round(self, kills):
        """Kills a build up to `kills` times, and lets it end."""
        left = self.seconds
        for _ in range(kills):
            process = self.start()
            pause = self.random.uniform(0, left)
            try:
                process.wait(pause)
            except subprocess.TimeoutExpired:
                process.kill()
                self.kills += 1
                left = max(0.1, left - pause / 2)
            if process.returncode is None:
                # The next command starts while the system still removes the killed process.
                self.dying.append(process)
                continue
            self.finished_early += 1
            self.check(self.end(process))
            return
        self.check(self.end(self.start()))

    def check(self, sha256):
        for process in self.dying:
            _, err = process.communicate()
            self.waits += err.count("is in use by another build: waiting")
        self.dying = []
        if sha256 not in (None, self.expected):
            self.failures.append(f"SHA-256 {sha256}: expected {self.expected}")
        self.clean()

    def run(self, kills):
        self.measure()
        print(f"undisturbed: {self.seconds:.2f} s, SHA-256 {self.expected}", flush=True)
        self.dying = []
        shown = 0
        while self.kills < kills and len(self.failures) < 10:
            self.round(min(self.random.randint(1, 6), kills - self.kills))
            if self.kills // 25 > shown:
                shown = self.kills // 25
                print(
                    f"{self.kills} kills, {self.waits} waited for a lock, "
                    f"{len(self.failures)} failures",
                    flush=True,
                )
        print(
            f"seed {self.seed}: {self.kills} kills, {self.finished_early} builds ended before "
            f"their kill, {self.waits} commands waited for a lock, {len(self.failures)} failures"
        )
        for failure in self.failures:
            print(failure)
        return not self.failures


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--voxdag", default="build/cpu/voxdag", type=Path)
    parser.add_argument("--kills", default=300, type=int)
    parser.add_argument("--scene", type=Path)
    parser.add_argument("--generate", default="terrain --triangles 400000", help="kind of scene")
    parser.add_argument("-r", "--resolution", default=2048, type=int)
    parser.add_argument("--build-options", default="--threads 2", help="for voxdag build")
    parser.add_argument("--color", action="store_true", help="with colors")
    parser.add_argument("--seed", default=1, type=int)
    options = parser.parse_args()
    options.voxdag = options.voxdag.resolve()
    with tempfile.TemporaryDirectory(prefix="voxdag-kills-") as folder:
        sys.exit(0 if Builds(options, Path(folder)).run(options.kills) else 1)


if __name__ == "__main__":
    main()
