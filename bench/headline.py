#!/usr/bin/env python3
"""Measures complete builds: the release build of voxdag, default options, empty work folders.

Each case is built several times, and medians are printed; cases that take more than a minute are
built once. `tools/bench plot` draws the figures that --json prints.

With --study FOLDER, an optional external reference program (see study.py) runs before every build.
The column "ratio" is the CPU seconds of `voxdag build` (reading, artifacts, merge, final file)
divided by the CPU seconds of the reference's build in memory.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

import measure
from measure import amount, median
from scenes import HAIRBALL, add_hairball_option, can_make_hairball, scene_path
from study import Study, same_work

CASES = (
    [f"sponza:{1 << levels}" for levels in range(13, 18)]
    + [f"dragon_100k:{1 << levels}" for levels in range(13, 16)]
    + [f"{HAIRBALL}:4096", f"{HAIRBALL}:8192", "minecraft_terrain:16384", "wooden_staircase:16384"]
)
SHORT_CASES = [
    "sponza:8192",
    "sponza:16384",
    "dragon_100k:8192",
    f"{HAIRBALL}:4096",
    "minecraft_terrain:16384",
    "wooden_staircase:16384",
]
LONG_S = 60  # a case is not repeated after a build of more wall seconds than this


def measure_case(case, options, study, folder):
    scene, resolution = case.split(":")
    levels = int(resolution).bit_length() - 1
    path = scene_path(scene, options, folder)
    runs, reports, references = [], [], []
    while len(runs) < options.repeat and not (runs and runs[-1].wall_s > LONG_S):
        if study and study.supports(scene):
            references.append(study.build_stage(scene, path, levels))
        taken, report = measure.build(options.voxdag, path, resolution, options.scratch)
        runs.append(taken)
        reports.append(report)
    return summary(case, runs, reports, references)


def summary(case, runs, reports, references):
    last = reports[-1]
    cpu_s = median([taken.cpu_s for taken in runs])
    wall_s = median([taken.wall_s for taken in runs])
    stages = {
        stage["name"]: median([report["stages"][i]["cpu_s"] for report in reports])
        for i, stage in enumerate(last["stages"])
    }
    scene, resolution = case.split(":")
    figures = {
        "case": case,
        "scene": scene,
        "resolution": int(resolution),
        "runs": len(runs),
        "cpu_s": cpu_s,
        "cpu_s_all": [taken.cpu_s for taken in runs],
        "wall_s": wall_s,
        "wall_over_cpu": wall_s / cpu_s,
        "peak_rss_bytes": max(taken.peak_rss_bytes for taken in runs),
        "bytes": last["bytes"],
        "peak_disk_bytes": max(taken.peak_disk_bytes for taken in runs),
        "sha256": last["sha256"],
        "subvolumes": last["subvolumes"]["total"],
        "artifact_nodes": last["artifacts"]["nodes"],
        "voxels": last["voxels"],
        "svo_nodes": last["svo_nodes"],
        "dag_nodes": last["dag_nodes"],
        "voxels_per_cpu_s": last["voxels"] / cpu_s,
        "ns_per_svo_node": 1e9 * cpu_s / last["svo_nodes"],
        "dag_nodes_per_cpu_s": last["dag_nodes"] / cpu_s,
        "stages_cpu_s": stages,
    }
    if references:
        figures["study_cpu_s"] = median([r["cpu_s"] for r in references])
        figures["study_cpu_s_all"] = [r["cpu_s"] for r in references]
        figures["study_wall_s"] = median([r["wall_s"] for r in references])
        figures["ratio"] = cpu_s / figures["study_cpu_s"]
        figures["same_work"] = same_work(references[-1], last)
    return figures


def growth(cases):
    """Returns a row for each scene: the factors by which CPU time, voxels, DAG nodes and file bytes
    grow when the resolution doubles, as geometric means from its smallest to its largest
    resolution."""
    grown = []
    for scene in dict.fromkeys(case["scene"] for case in cases):
        own = sorted((c for c in cases if c["scene"] == scene), key=lambda c: c["resolution"])
        first, last = own[0], own[-1]
        doublings = (last["resolution"] // first["resolution"]).bit_length() - 1
        if doublings:
            grown.append(
                {
                    "scene": scene,
                    "from": first["resolution"],
                    "to": last["resolution"],
                    **{
                        name: (last[name] / first[name]) ** (1 / doublings)
                        for name in ("cpu_s", "voxels", "dag_nodes", "bytes")
                    },
                }
            )
    return grown


def print_builds(cases):
    measure.print_table(
        [
            "case",
            "voxels",
            "DAG nodes",
            "subvol.",
            "CPU s",
            "wall s",
            "wall / CPU",
            "peak MiB",
            "file MiB",
            "peak disk / file",
            "voxels/CPU s",
            "ns/octree node",
            "DAG nodes/CPU s",
        ],
        [
            [
                c["case"],
                amount(c["voxels"]),
                amount(c["dag_nodes"]),
                c["subvolumes"],
                f"{c['cpu_s']:.2f}",
                f"{c['wall_s']:.2f}",
                f"{c['wall_over_cpu']:.2f}",
                f"{c['peak_rss_bytes'] / measure.MIB:.0f}",
                f"{c['bytes'] / measure.MIB:.0f}",
                f"{c['peak_disk_bytes'] / c['bytes']:.1f}",
                amount(c["voxels_per_cpu_s"]),
                f"{c['ns_per_svo_node']:.1f}",
                amount(c["dag_nodes_per_cpu_s"]),
            ]
            for c in cases
        ],
    )


def print_stages(cases):
    names = list(dict.fromkeys(name for case in cases for name in case["stages_cpu_s"]))
    print("\nCPU seconds by stage, and their share:\n")
    rows = []
    for case in cases:
        stages = case["stages_cpu_s"]
        total = sum(stages.values()) or 1
        rows.append(
            [case["case"]]
            + [
                f"{stages[name]:.2f} ({100 * stages[name] / total:.0f} %)"
                if name in stages
                else "-"
                for name in names
            ]
        )
    measure.print_table(["case"] + names, rows)


def print_ratios(cases):
    cases = [case for case in cases if "ratio" in case]
    if not cases:
        return
    print("\nCompared with the external reference (one thread, in memory):\n")
    measure.print_table(
        [
            "case",
            "build CPU s",
            "reference CPU s",
            "ratio",
            "build wall s",
            "reference wall s",
            "same work",
        ],
        [
            [
                c["case"],
                f"{c['cpu_s']:.2f}",
                f"{c['study_cpu_s']:.2f}",
                f"{c['ratio']:.2f}",
                f"{c['wall_s']:.2f}",
                f"{c['study_wall_s']:.2f}",
                "yes" if c["same_work"] else "NO",
            ]
            for c in cases
        ],
    )


def print_growth(grown):
    if not grown:
        return
    print("\nGrowth per doubling of R, geometric mean:\n")
    measure.print_table(
        ["scene", "R", "CPU time", "voxels", "DAG nodes", "file"],
        [
            [g["scene"], f"{g['from']} to {g['to']}"]
            + [f"{g[name]:.2f}" for name in ("cpu_s", "voxels", "dag_nodes", "bytes")]
            for g in grown
        ],
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    measure.add_common_options(parser)
    add_hairball_option(parser)
    parser.add_argument(
        "--study",
        type=Path,
        metavar="FOLDER",
        help="sources of an external reference program to compare with",
    )
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument(
        "--case",
        action="append",
        metavar="SCENE:R",
        help="build this case instead of the default ones",
    )
    parser.add_argument(
        "--short", action="store_true", help="only cases of less than five minutes in total"
    )
    options = parser.parse_args()

    names = options.case or (SHORT_CASES if options.short else CASES)
    if not options.case and not can_make_hairball(options):
        print("No hairball: give --hairball, or numpy and its generator next to the scenes.\n")
        names = [name for name in names if not name.startswith(HAIRBALL)]
    facts = measure.machine()
    print(measure.machine_line(facts) + "\n", flush=True)
    with tempfile.TemporaryDirectory(dir=options.scratch) as name:
        folder = Path(name)
        study = Study(options.study, folder) if options.study else None
        cases = []
        for case in names:
            cases.append(measure_case(case, options, study, folder))
            print(f"{case}: {cases[-1]['cpu_s']:.2f} CPU s", file=sys.stderr, flush=True)
    facts["load_1min_after"] = measure.machine()["load_1min"]
    grown = growth(cases)
    print_builds(cases)
    print_stages(cases)
    print_ratios(cases)
    print_growth(grown)
    print(f"\nLoad at the end: {facts['load_1min_after']:.2f}")
    figures = {"machine": facts, "cases": cases, "growth": grown}
    measure.write_json(options.json, figures)
    if not options.json:
        print("\n" + json.dumps(figures))


if __name__ == "__main__":
    main()
