"""The page of the reference set (README.md), made from reference.json."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from cases import SCENES
from measure import amount, machine_line, table

BEGINNING = """\
# Reference set

These builds are references for comparisons with other programs and machines. `tools/canon` builds
them again and compares all digests and counts. `tools/canon --quick` builds only generated scenes
at resolutions below 4096, which need no download. `reference.json` has the exact numbers, also for
each level: octree nodes, DAG nodes, bytes and SHA-256.
[docs/format.md](../../docs/format.md#levels)
defines the levels.

On 2026-11-27, `tests/long/aarch64` built the quick cases with a program for AArch64 in QEMU. All
digests and counts were the same.

`tools/canon --write` writes this page. CPU seconds and peak memory were measured in one build,
while the machine also did other work:
"""


def scene_rows(cases):
    digests = {case["scene"]: case["scene_sha256"] for case in cases}
    for name, digest in digests.items():
        scene = SCENES[name]
        source = f"`{scene.source} {' '.join(scene.arguments)}`" if not scene.file else scene.source
        yield [name, source, scene.license, f"`{digest}`"]


def case_rows(cases):
    for case in cases:
        yield [
            case["scene"],
            str(case["resolution"]),
            " ".join(case["options"]) or "",
            amount(case["voxels"]),
            amount(case["octree_nodes"]),
            amount(case["dag_nodes"]),
            f"{case['bytes'] / 2**20:.2f}",
            f"`{case['sha256'][:16]}`",
            f"{case['cpu_s']:.2f}",
            f"{case['peak_memory_bytes'] / 2**20:.0f}",
        ]


def export_rows(cases):
    for case in cases:
        if case["export_bytes"]:
            sizes = [f"{size / 2**20:.2f}" for size in case["export_bytes"].values()]
            yield [case["scene"], str(case["resolution"]), f"{case['bytes'] / 2**20:.2f}", *sizes]


def page(reference):
    """Returns the text of README.md."""
    cases = reference["cases"]
    formats = next((list(case["export_bytes"]) for case in cases if case["export_bytes"]), [])
    parts = [
        BEGINNING,
        machine_line(reference["machine"]) + ".\n",
        "## Scenes\n",
        table(["scene", "source", "license", "SHA-256 of the file"], scene_rows(cases)),
        "\n## Builds\n",
        "R is the resolution. The column SHA-256 has the first 16 digits of the file's digest.\n",
        table(
            ["scene", "R", "options", "voxels", "octree nodes", "DAG nodes", "MiB", "SHA-256"]
            + ["CPU s", "peak MiB"],
            case_rows(cases),
        ),
        "\n## Bytes per format\n",
        "MiB of the .vdag file and of its exports with `voxdag export --to`.\n",
        table(["scene", "R", "vdag", *formats], export_rows(cases)),
    ]
    return "\n".join(parts) + "\n"
