#!/usr/bin/env python3
"""Compares the estimates of `plan` with the actual values of builds, scene by scene.

An estimate of the number of voxels may be wrong by a factor of 1.25, an estimate of peak disk use,
peak memory or file size by a factor of 2. Peak disk use is sampled during the build. The exit
status is 1 if an estimate is out of bounds.
"""

import argparse
import json
import sys
from pathlib import Path

import measure

RESOLUTIONS = [1024, 8192, 32768]
# Upper limits of estimate / truth and of truth / estimate.
WITHIN = {"voxels": 1.25, "file_bytes": 2.0, "disk_bytes": 2.0, "memory_bytes": 2.0}
SHOWN = ["voxels", "file_bytes", "disk_bytes", "memory_bytes", "dag_nodes", "cpu_s"]


def measure_case(scene, resolution, options):
    plan_run = measure.run([options.voxdag, "plan", scene, "-r", resolution, "--json"])
    plan = json.loads(plan_run.stdout)
    taken, report = measure.build(options.voxdag, scene, resolution, options.scratch)
    truth = {
        "voxels": report["voxels"],
        "dag_nodes": report["dag_nodes"],
        "file_bytes": report["bytes"],
        "disk_bytes": taken.peak_disk_bytes,
        "memory_bytes": taken.peak_rss_bytes,
        "cpu_s": taken.cpu_s,
    }
    likely = {name: plan[name]["likely"] for name in SHOWN}
    return {
        "case": f"{scene.stem}:{resolution}",
        "plan_cpu_s": plan_run.cpu_s,
        "likely": likely,
        "truth": truth,
        "missed": [
            name
            for name, factor in WITHIN.items()
            if not 1 / factor <= likely[name] / truth[name] <= factor
        ],
    }


def print_cases(cases):
    def cell(case, name):
        likely, truth = case["likely"][name], case["truth"][name]
        text = f"{measure.amount(likely)} / {measure.amount(truth)} = {likely / truth:.2f}"
        return text + (" !" if name in case["missed"] else "")

    print("Estimate / truth, ! if out of bounds:\n")
    measure.print_table(
        ["case"] + SHOWN + ["plan's own CPU s"],
        [
            [c["case"]] + [cell(c, name) for name in SHOWN] + [f"{c['plan_cpu_s']:.2f}"]
            for c in cases
        ],
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    measure.add_common_options(parser)
    parser.add_argument(
        "--scene",
        action="append",
        type=Path,
        metavar="FILE.glb",
        help="this scene instead of all in --scenes",
    )
    parser.add_argument(
        "--resolution",
        action="append",
        type=int,
        metavar="R",
        help=f"this resolution instead of {RESOLUTIONS}",
    )
    options = parser.parse_args()

    facts = measure.machine()
    print(measure.machine_line(facts) + "\n", flush=True)
    scenes = options.scene or sorted(options.scenes.glob("*.glb"))
    cases = [
        measure_case(scene, resolution, options)
        for scene in scenes
        for resolution in options.resolution or RESOLUTIONS
    ]
    print_cases(cases)
    measure.write_json(options.json, {"machine": facts, "cases": cases})
    return 1 if any(case["missed"] for case in cases) else 0


if __name__ == "__main__":
    sys.exit(main())
