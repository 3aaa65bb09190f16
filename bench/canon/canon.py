#!/usr/bin/env python3
"""Builds the reference set, and compares every build with the recorded digests and counts.

    tools/canon [--quick] [--scenes FOLDER] [--voxdag COMMAND] [--write]

A case is a scene, a resolution and geometry options. Generated scenes need no download; for the
others, --scenes names a folder with the files. Cases whose file is missing are listed as absent.

- --quick: only the cases on generated scenes below a resolution of 4096
- --voxdag: the program, or a command such as "qemu-aarch64 -L SYSROOT build/aarch64/voxdag"
- --write: records the results in reference.json and README.md, instead of comparing them

Exit status 1 if a digest or a count differs, 2 if nothing was compared.
"""

import argparse
import hashlib
import json
import shlex
import struct
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
import measure
import page
from cases import CASES, EXPORTS, SCENES, is_quick

FOLDER = Path(__file__).parent
REFERENCE = FOLDER / "reference.json"
# Members of a case that depend on the machine. They are recorded, and not compared.
COSTS = ("cpu_s", "peak_memory_bytes")


def sha256(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def level_digests(path):
    """Returns the SHA-256 of the nodes of each level, from the root (docs/format.md, "Levels")."""
    digests = []
    with open(path, "rb") as file:
        header = file.read(4096)
        levels = struct.unpack_from("<I", header, 16)[0] - 1
        for level in range(levels):
            offset, _, words = struct.unpack_from("<QQQ", header, 128 + 32 * level)
            file.seek(offset)
            digest = hashlib.sha256()
            left = 4 * words
            while left > 0:
                piece = file.read(min(left, 1 << 20))
                if not piece:
                    sys.exit(f"{path}: level {level} is cut off")
                digest.update(piece)
                left -= len(piece)
            digests.append(digest.hexdigest())
    return digests


class Canon:
    """The program under test, and a folder for scenes and results."""

    def __init__(self, voxdag, scenes, folder):
        self.voxdag = voxdag
        self.scenes = scenes
        self.folder = Path(folder)

    def run(self, *arguments):
        return measure.run([*self.voxdag, *arguments])

    def scene(self, name):
        """Returns the scene's file, which is generated if necessary; None if it is absent."""
        scene = SCENES[name]
        if scene.file:
            path = self.scenes / scene.file if self.scenes else None
            return path if path and path.exists() else None
        path = self.folder / f"{name}.glb"
        if not path.exists():
            self.run("generate", *scene.arguments, path, "-q")
        return path

    def result(self, case):
        """Builds a case, and returns the members that reference.json has for it."""
        scene = self.scene(case.scene)
        if not scene:
            return None
        output = self.folder / "out.vdag"
        taken = self.run(
            *("build", scene, "-r", case.resolution, "-o", output, "--force", "-q"),
            *("--report", "none", *case.options),
        )
        info = json.loads(self.run("info", output, "--digest", "--stats", "--json").stdout)
        digests = level_digests(output)
        return {
            "scene": case.scene,
            "scene_sha256": sha256(scene),
            "resolution": case.resolution,
            "options": list(case.options),
            "voxels": info["voxels"],
            "octree_nodes": info["svo_nodes"],
            "dag_nodes": info["dag_nodes"],
            "bytes": info["bytes"],
            "sha256": info["sha256"],
            "levels": [
                {
                    "octree_nodes": level["svo_nodes"],
                    "dag_nodes": level["nodes"],
                    "bytes": level["bytes"],
                    "sha256": digest,
                }
                for level, digest in zip(info["levels"], digests, strict=True)
            ],
            "export_bytes": self.exported_bytes(output) if case.has_exports else {},
            "cpu_s": round(taken.cpu_s, 2),
            "peak_memory_bytes": taken.peak_rss_bytes,
        }

    def exported_bytes(self, dag):
        """Returns the size of the file in each export format."""
        sizes = {}
        for name, ending in EXPORTS.items():
            output = self.folder / f"export{ending}"
            self.run("export", dag, "--to", name, "-o", output, "--force", "-q")
            sizes[name] = output.stat().st_size
            output.unlink()
        return sizes


def key(entry):
    return (entry["scene"], entry["resolution"], *entry["options"])


def differences(expected, actual):
    """Returns a line for each member of a case that differs from the reference."""
    lines = []
    for member, value in expected.items():
        if member in COSTS or member == "levels" or actual[member] == value:
            continue
        lines.append(f"{member} is {actual[member]}, expected {value}")
    for number, pair in enumerate(zip(expected["levels"], actual["levels"], strict=True)):
        lines += [
            f"level {number}: {member} is {pair[1][member]}, expected {value}"
            for member, value in pair[0].items()
            if pair[1][member] != value
        ]
    return lines


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--voxdag", default="build/cpu/voxdag", type=shlex.split)
    parser.add_argument("--scenes", type=Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    reference = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {"cases": []}
    expected = {key(entry): entry for entry in reference["cases"]}
    failures = compared = 0
    with tempfile.TemporaryDirectory() as folder:
        canon = Canon(options.voxdag, options.scenes, folder)
        for case in CASES:
            if options.quick and not is_quick(case):
                continue
            actual = canon.result(case)
            if actual is None:
                print(f"absent     {case}", flush=True)
            elif options.write:
                expected[key(actual)] = actual
                print(f"recorded   {case}, {actual['cpu_s']} CPU s", flush=True)
            elif key(actual) not in expected:
                failures += 1
                print(f"not known  {case}: expected an entry of {REFERENCE.name}", flush=True)
            else:
                lines = differences(expected[key(actual)], actual)
                failures += bool(lines)
                compared += 1
                print(f"{'different' if lines else 'equal    '}  {case}", flush=True)
                for line in lines:
                    print(f"    {line}", flush=True)
    if options.write:
        order = [(case.scene, case.resolution, *case.options) for case in CASES]
        cases = [expected[name] for name in order if name in expected]
        reference = {"machine": measure.machine(), "cases": cases}
        REFERENCE.write_text(json.dumps(reference, indent=1) + "\n")
        (FOLDER / "README.md").write_text(page.page(reference))
        return 0
    print(f"{compared} cases compared, {failures} failed")
    return 1 if failures else 0 if compared else 2


if __name__ == "__main__":
    sys.exit(main())
