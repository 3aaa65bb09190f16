#!/usr/bin/env python3
"""What `plan` foretells against what `build` then takes, scene by scene.

Voxels should come within 25 %; disk at its peak, peak memory and the bytes of the DAG within a
factor of 2. The disk's peak is watched while the build runs. Exits 1 if a figure is out of bounds.
"""

import argparse
import json
import sys
import tempfile
import threading
from pathlib import Path

import measure

RESOLUTIONS = [1024, 4096, 8192]
# What must hold for estimate / truth, whichever is larger on top.
WITHIN = {"voxels": 1.25, "file_bytes": 2.0, "disk_bytes": 2.0, "memory_bytes": 2.0}
SHOWN = ["voxels", "file_bytes", "disk_bytes", "memory_bytes", "dag_nodes", "cpu_s"]


class DiskWatch:
    """The most bytes that a folder held while the watch was on, looked at every 20 ms."""

    def __init__(self, folder):
        self.folder = folder
        self.peak_bytes = 0
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.watch)

    def look(self):
        total = 0
        for path in self.folder.rglob("*"):
            try:
                total += path.stat().st_blocks * 512
            except FileNotFoundError:
                pass  # gone since it was listed
        self.peak_bytes = max(self.peak_bytes, total)

    def watch(self):
        while not self.over.wait(0.02):
            self.look()

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.over.set()
        self.thread.join()
        self.look()


def measure_case(scene, resolution, options):
    plan_run = measure.run([options.voxdag, "plan", scene, "-r", resolution, "--json"])
    plan = json.loads(plan_run.stdout)
    with tempfile.TemporaryDirectory(dir=options.scratch) as folder:
        output = Path(folder) / "out.vdag"
        with DiskWatch(Path(folder)) as disk:
            taken = measure.run(
                [options.voxdag, "build", scene, "-r", resolution, "-o", output, "--json"])
        report = json.loads(taken.stdout)
    truth = {
        "voxels": report["voxels"],
        "dag_nodes": report["dag_nodes"],
        "file_bytes": report["bytes"],
        "disk_bytes": disk.peak_bytes,
        "memory_bytes": taken.peak_rss_bytes,
        "cpu_s": taken.cpu_s,
    }
    likely = {name: plan[name]["likely"] for name in SHOWN}
    return {
        "case": f"{scene.stem}:{resolution}",
        "plan_cpu_s": plan_run.cpu_s,
        "likely": likely,
        "truth": truth,
        "missed": [name for name, factor in WITHIN.items()
                   if not 1 / factor <= likely[name] / truth[name] <= factor],
    }


def print_cases(cases):
    def cell(case, name):
        likely, truth = case["likely"][name], case["truth"][name]
        text = f"{measure.amount(likely)} / {measure.amount(truth)} = {likely / truth:.2f}"
        return text + (" !" if name in case["missed"] else "")

    print("Estimate / truth, ! where it is out of bounds:\n")
    measure.print_table(["case"] + SHOWN + ["plan's own CPU s"],
                        [[c["case"]] + [cell(c, name) for name in SHOWN] + [f"{c['plan_cpu_s']:.2f}"]
                         for c in cases])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    measure.add_common_options(parser)
    parser.add_argument("--scene", action="append", type=Path, metavar="FILE.glb",
                        help="instead of all in --scenes")
    parser.add_argument("--resolution", action="append", type=int, metavar="R",
                        help=f"instead of {RESOLUTIONS}")
    options = parser.parse_args()

    facts = measure.machine()
    print(measure.machine_line(facts) + "\n", flush=True)
    scenes = options.scene or sorted(options.scenes.glob("*.glb"))
    cases = [measure_case(scene, resolution, options)
             for scene in scenes for resolution in options.resolution or RESOLUTIONS]
    print_cases(cases)
    measure.write_json(options.json, {"machine": facts, "cases": cases})
    return 1 if any(case["missed"] for case in cases) else 0


if __name__ == "__main__":
    sys.exit(main())
