#!/usr/bin/env python3
"""Whole builds: the shipped program, default options, empty work folders.

Each case is built several times, and medians are shown. With --study the yardstick's build stage
runs before every build, and the ratio is CPU seconds of the whole `voxdag build` (reading,
artifacts, merge, final file) over CPU seconds of the study's build stage alone.
"""

import argparse
import json
import tempfile
from pathlib import Path

import measure
from measure import amount, median
from study import Study, same_work

# The study's name of a scene and the same scene as .glb.
STUDY_NAMES = {"sponza": "sponza", "dragon_100k": "dragon"}
CASES = ["sponza:16384", "sponza:32768", "dragon_100k:8192", "dragon_100k:16384"]
SHORT_CASES = ["sponza:16384", "dragon_100k:8192"]


def measure_case(case, options, study):
    scene, resolution = case.split(":")
    levels = int(resolution).bit_length() - 1
    path = options.scenes / f"{scene}.glb"
    runs, reports, yardsticks = [], [], []
    for _ in range(options.repeat):
        if study and scene in STUDY_NAMES:
            yardsticks.append(study.build_stage(STUDY_NAMES[scene], levels))
        taken, report = measure.build(options.voxdag, path, resolution, options.scratch)
        runs.append(taken)
        reports.append(report)
    return summary(case, runs, reports, yardsticks)


def summary(case, runs, reports, yardsticks):
    last = reports[-1]
    cpu_s = median([taken.cpu_s for taken in runs])
    stages = {
        stage["name"]: median([report["stages"][i]["cpu_s"] for report in reports])
        for i, stage in enumerate(last["stages"])
    }
    figures = {
        "case": case,
        "runs": len(runs),
        "cpu_s": cpu_s,
        "cpu_s_all": [taken.cpu_s for taken in runs],
        "wall_s": median([taken.wall_s for taken in runs]),
        "peak_rss_bytes": max(taken.peak_rss_bytes for taken in runs),
        "subvolumes": last["subvolumes"]["total"],
        "voxels": last["voxels"],
        "svo_nodes": last["svo_nodes"],
        "dag_nodes": last["dag_nodes"],
        "voxels_per_cpu_s": last["voxels"] / cpu_s,
        "svo_nodes_per_cpu_s": last["svo_nodes"] / cpu_s,
        "dag_nodes_per_cpu_s": last["dag_nodes"] / cpu_s,
        "stages_cpu_s": stages,
    }
    if yardsticks:
        figures["study_cpu_s"] = median([y["cpu_s"] for y in yardsticks])
        figures["study_cpu_s_all"] = [y["cpu_s"] for y in yardsticks]
        figures["study_wall_s"] = median([y["wall_s"] for y in yardsticks])
        figures["ratio"] = cpu_s / figures["study_cpu_s"]
        figures["same_work"] = same_work(yardsticks[-1], last)
    return figures


def print_builds(cases):
    measure.print_table(
        ["case", "voxels", "DAG nodes", "subvol.", "CPU s", "wall s", "peak MiB", "voxels/CPU s",
         "octree nodes/CPU s", "DAG nodes/CPU s"],
        [[c["case"], amount(c["voxels"]), amount(c["dag_nodes"]), c["subvolumes"],
          f"{c['cpu_s']:.2f}", f"{c['wall_s']:.2f}", f"{c['peak_rss_bytes'] / measure.MIB:.0f}",
          amount(c["voxels_per_cpu_s"]), amount(c["svo_nodes_per_cpu_s"]),
          amount(c["dag_nodes_per_cpu_s"])] for c in cases])


def print_stages(cases):
    names = list(dict.fromkeys(name for case in cases for name in case["stages_cpu_s"]))
    print("\nCPU seconds by stage, and their share:\n")
    rows = []
    for case in cases:
        stages = case["stages_cpu_s"]
        total = sum(stages.values()) or 1
        rows.append([case["case"]] + [
            f"{stages[name]:.2f} ({100 * stages[name] / total:.0f} %)" if name in stages else "-"
            for name in names])
    measure.print_table(["case"] + names, rows)


def print_ratios(cases):
    cases = [case for case in cases if "ratio" in case]
    if not cases:
        return
    print("\nBeside the study's build stage (CPU seconds, single thread, in memory):\n")
    measure.print_table(
        ["case", "build CPU s", "study CPU s", "ratio", "build wall s", "study wall s", "same work"],
        [[c["case"], f"{c['cpu_s']:.2f}", f"{c['study_cpu_s']:.2f}", f"{c['ratio']:.2f}",
          f"{c['wall_s']:.2f}", f"{c['study_wall_s']:.2f}", "yes" if c["same_work"] else "NO"]
         for c in cases])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    measure.add_common_options(parser)
    parser.add_argument("--study", type=Path, help="the study's folder; without it, no ratios")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--case", action="append", metavar="SCENE:R", help="instead of the usual")
    parser.add_argument("--short", action="store_true", help="the two quickest cases")
    options = parser.parse_args()

    facts = measure.machine()
    print(measure.machine_line(facts) + "\n", flush=True)
    with tempfile.TemporaryDirectory(dir=options.scratch) as folder:
        study = Study(options.study, folder) if options.study else None
        names = options.case or (SHORT_CASES if options.short else CASES)
        cases = [measure_case(case, options, study) for case in names]
    print_builds(cases)
    print_stages(cases)
    print_ratios(cases)
    figures = {"machine": facts, "cases": cases}
    measure.write_json(options.json, figures)
    if not options.json:
        print("\n" + json.dumps(figures))


if __name__ == "__main__":
    main()
