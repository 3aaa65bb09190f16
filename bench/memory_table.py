#!/usr/bin/env python3
"""Checks that a small memory budget is kept, and that the file is the same as with a large budget.

`--memory` guarantees that the resident set never exceeds the budget plus 64 MiB. Each case is built
with its small budget and with a budget of 8 GiB. The table shows two measurements of the small
build's peak: VmHWM from the build's report, and the system's own measurement. Exits 1 if one of
them exceeds the limit, or if the bytes of the two files differ.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import measure
from measure import MIB
from scenes import add_hairball_option, hairball

SLACK_BYTES = 64 * MIB
LARGE = "8GiB"


def sponza(options, _folder):
    return options.scenes / "sponza.glb"


def large_file(options, folder):
    """A terrain of 2 GiB, eight times the budget: 12 bytes per triangle."""
    path = folder / "terrain.glb"
    measure.run([options.voxdag, "generate", "terrain", path, "--triangles", 180_000_000])
    return path


# name: (scene, resolution, small budget in MiB)
CASES = {
    "sponza": (sponza, 16384, 512),
    "hairball": (hairball, 4096, 256),
    "2-GiB-file": (large_file, 2048, 256),
}


def measure_case(name, options, folder):
    make_scene, resolution, budget_mib = CASES[name]
    scene = make_scene(options, folder)
    large_run, large = measure.build(
        options.voxdag, scene, resolution, options.scratch, "--memory", LARGE
    )
    small_run, small = measure.build(
        options.voxdag, scene, resolution, options.scratch, "--memory", f"{budget_mib}MiB"
    )
    peak = max(small["peak_rss_bytes"], small_run.peak_rss_bytes)
    return {
        "case": f"{name}:{resolution}",
        "scene_bytes": scene.stat().st_size,
        "budget_bytes": budget_mib * MIB,
        "vm_hwm_bytes": small["peak_rss_bytes"],
        "max_rss_bytes": small_run.peak_rss_bytes,
        "within_budget": peak <= budget_mib * MIB + SLACK_BYTES,
        "spill_bytes": small["spill_bytes"],
        "split": small["subvolumes"]["split"],
        "merge_passes": small["merge_passes"],
        "wall_s": small_run.wall_s,
        "large_wall_s": large_run.wall_s,
        "large_vm_hwm_bytes": large["peak_rss_bytes"],
        "sha256": small["sha256"],
        "same_bytes": small["sha256"] == large["sha256"],
    }


def print_cases(cases):
    measure.print_table(
        [
            "case",
            "scene MiB",
            "budget MiB",
            "VmHWM MiB",
            "max RSS MiB",
            "within budget",
            "spilled MiB",
            "splits",
            "passes",
            "wall s",
            f"VmHWM at {LARGE}",
            f"wall s at {LARGE}",
            "same bytes",
        ],
        [
            [
                c["case"],
                f"{c['scene_bytes'] / MIB:.0f}",
                f"{c['budget_bytes'] / MIB:.0f}",
                f"{c['vm_hwm_bytes'] / MIB:.0f}",
                f"{c['max_rss_bytes'] / MIB:.0f}",
                "yes" if c["within_budget"] else "NO",
                f"{c['spill_bytes'] / MIB:.0f}",
                c["split"],
                c["merge_passes"],
                f"{c['wall_s']:.1f}",
                f"{c['large_vm_hwm_bytes'] / MIB:.0f}",
                f"{c['large_wall_s']:.1f}",
                "yes" if c["same_bytes"] else "NO",
            ]
            for c in cases
        ],
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    measure.add_common_options(parser)
    parser.add_argument("--case", action="append", choices=CASES, help="instead of all")
    add_hairball_option(parser)
    options = parser.parse_args()

    facts = measure.machine()
    print(measure.machine_line(facts) + "\n", flush=True)
    with tempfile.TemporaryDirectory(dir=options.scratch) as folder:
        cases = [measure_case(name, options, Path(folder)) for name in options.case or CASES]
    print_cases(cases)
    measure.write_json(options.json, {"machine": facts, "cases": cases})
    return 0 if all(c["within_budget"] and c["same_bytes"] for c in cases) else 1


if __name__ == "__main__":
    sys.exit(main())
