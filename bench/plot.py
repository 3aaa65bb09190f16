#!/usr/bin/env python3
"""Draws CPU time and DAG size over the resolution as a PNG, from the JSON of `headline`.

    tools/bench headline --json headline.json
    tools/bench plot headline.json headline.png

Needs matplotlib (Debian: python3-matplotlib; PyPI: matplotlib). No other benchmark needs it.
"""

import argparse
import json
from pathlib import Path

import measure

PANELS = [
    ("CPU seconds of the whole build", lambda case: case["cpu_s"]),
    ("DAG nodes, millions", lambda case: case["dag_nodes"] / 1e6),
    ("bytes of the file per million voxels", lambda case: case["bytes"] / (case["voxels"] / 1e6)),
]


def draw(figures, output):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    cases = figures["cases"]
    resolutions = sorted({case["resolution"] for case in cases})
    figure, panels = pyplot.subplots(
        1, len(PANELS), figsize=(5 * len(PANELS), 5), layout="constrained"
    )
    for panel, (title, value) in zip(panels, PANELS):
        for number, scene in enumerate(dict.fromkeys(case["scene"] for case in cases)):
            own = sorted((c for c in cases if c["scene"] == scene), key=lambda c: c["resolution"])
            xs = [case["resolution"] for case in own]
            panel.plot(xs, [value(case) for case in own], "o-", color=f"C{number}", label=scene)
            timed = [case for case in own if "study_cpu_s" in case]
            if timed and panel is panels[0]:
                panel.plot(
                    [case["resolution"] for case in timed],
                    [case["study_cpu_s"] for case in timed],
                    "x--",
                    color=f"C{number}",
                    label=f"{scene}, external reference",
                )
        panel.set_xscale("log", base=2)
        panel.set_yscale("log")
        panel.set_xticks(resolutions, [str(r) for r in resolutions], rotation=30)
        panel.set_xlabel("R")
        panel.set_title(title)
        panel.grid(True, which="both", alpha=0.3)
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=4,
        fontsize="small",
    )
    figure.suptitle(measure.machine_line(figures["machine"]), fontsize="small")
    figure.savefig(output, dpi=110)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("figures", type=Path, help="the JSON file of headline --json")
    parser.add_argument("output", type=Path, help="the PNG file to write")
    options = parser.parse_args()
    try:
        draw(json.loads(options.figures.read_text()), options.output)
    except ModuleNotFoundError as missing:
        raise SystemExit(
            f"{missing}: install python3-matplotlib, or matplotlib from PyPI"
        ) from None


if __name__ == "__main__":
    main()
