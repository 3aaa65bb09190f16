#!/usr/bin/env python3
"""Exports complete files to every format, decodes them by other code, and compares every voxel.

    tests/long/exports_whole.py [--voxdag build/cpu/voxdag] [--digest build/cpu/tests/digest_voxels]
                                [--folder DIR] [--memory 4GiB] [--formats bt,vdb,...]
                                 [--resolution 2048]
                                [--may-refuse bt,glb,...]
                                [FILE.vdag[:X0,Y0,Z0,X1,Y1,Z1] ...]

Without FILE, the script builds a generated city at --resolution. It exports each file, or a region
of it, to each format. An export to a format of --may-refuse (default: none for the city, all for
files) may be refused. Then its error must name a selection that fits, and the export must leave no
file. The files must not have colors, because the decoders of ply and npz do not support them.

tests/export/whole decodes a written file completely, with code that shares nothing with the
exporter. It returns the number of voxels and a hash of 128 bits of the voxels' positions, which
does not depend on their order. Both must equal the values that the reader header finds in the .vdag
file. For glb, the faces between voxels and empty cells are compared instead of voxels.

Prints a row of a table for each export. The exit status is 1 if anything differs. Takes 12 GB of
disk for Sponza at 4096^3.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FORMATS = ["hashdag", "svdag", "voxel", "vox", "bt", "vdb", "nvdb", "ply", "npz", "glb"]
SUFFIXES = {"hashdag": ".basic_dag.dag.bin", "voxel": ".voxel.json"}
DECODERS = {"vdb": "libopenvdb", "nvdb": "libnanovdb"}


def run(args):
    """Returns exit status, output, messages, CPU seconds and peak memory in MiB of a command."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen([str(arg) for arg in args], stdout=out, stderr=err)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read().decode())
    return process.returncode, *texts, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def digest(options, *args):
    """Returns (voxels or faces, hashes), as decoded by digest_voxels, and its CPU seconds."""
    status, out, err, seconds, _ = run([options.digest, *args])
    assert status == 0, f"digest_voxels {' '.join(map(str, args))}: status {status}, {err.strip()}"
    count, hashes = out.split()
    return (int(count), hashes), seconds


def mebibytes(size):
    """Returns the number of MiB in a size such as 512MiB or 4GiB."""
    number, unit = re.fullmatch(r"(\d+)(MiB|GiB)", size).groups()
    return int(number) * (1024 if unit == "GiB" else 1)


class Selection:
    """A file, or a region of a file, and the digests that its exports must have."""

    def __init__(self, options, text):
        self.path, _, region = text.partition(":")
        self.region = region.split(",") if region else []
        self.info = json.loads(run([options.voxdag, "info", self.path, "--json"])[1])
        self.digests = {}
        self.options = options

    def expected(self, kind):
        if kind not in self.digests:
            self.digests[kind], _ = digest(self.options, kind, self.path, *self.region)
        return self.digests[kind]

    def grid(self):
        bounds, resolution = self.info["bounds"], self.info["resolution"]
        numbers = [*bounds["origin"], bounds["edge"] / resolution]
        return [*map(repr, numbers), resolution.bit_length() - 1]


def check(options, selection, name, folder):
    """Returns a row of the table; raises AssertionError if the export is wrong."""
    output = folder / ("whole" + SUFFIXES.get(name, "." + name))
    region = ["--region", ",".join(selection.region)] if selection.region else []
    started = time.monotonic()
    status, out, err, seconds, peak = run(
        [
            options.voxdag,
            "export",
            selection.path,
            "--to",
            name,
            "-o",
            output,
            "--memory",
            options.memory,
            "--json",
            *(["--grid", "mask"] if name in ("vdb", "nvdb") else []),
            *region,
        ]
    )
    wall = time.monotonic() - started
    if status != 0:
        message = err.strip().splitlines()[-1]
        assert name in options.may_refuse, f"status {status}: {message}"
        assert "fits" in message or "--region" in message, f"status {status}: {message}"
        assert not list(folder.iterdir()), "a refused export leaves files"
        return ["refused: " + message.split(": ", 2)[-1]]
    report = json.loads(out)
    kind = "faces" if name == "glb" else "vdag"
    expected = selection.expected(kind)
    found, decoding = digest(options, name, output, *selection.grid())
    assert found == expected, f"{found} decoded, {expected} in the file"
    assert report["voxels"] == selection.expected("vdag")[0], "another count of voxels is reported"
    size = sum(path.stat().st_size for path in folder.iterdir())
    assert report["bytes"] == size, "another size is reported"
    most = mebibytes(options.memory) + os.path.getsize(selection.path) / 2**20 + 64
    assert peak <= most, f"peak memory {peak:.0f} MiB, expected {most:.0f} MiB at most"
    for path in folder.iterdir():
        path.unlink()
    return [
        f"{size / 2**20:.1f} MiB",
        f"{wall:.1f} s",
        f"{seconds:.1f} s",
        f"{peak:.0f} MiB",
        f"{DECODERS.get(name, 'own')}, {decoding:.0f} s",
        f"{found[0]:,}".replace(",", " ") + (" faces" if kind == "faces" else " voxels"),
    ]


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--voxdag", default="build/cpu/voxdag")
    parser.add_argument("--digest", default="build/cpu/tests/digest_voxels")
    parser.add_argument(
        "--folder", help="where files are written; a temporary folder of the system"
    )
    parser.add_argument(
        "--memory", default="4GiB", help="of each export, in MiB or GiB; its peak is checked"
    )
    parser.add_argument("--formats", help="all that this voxdag has")
    parser.add_argument("--resolution", type=int, default=2048)
    parser.add_argument("--may-refuse", help="formats")
    parser.add_argument("files", nargs="*")
    options = parser.parse_args()
    if options.may_refuse is not None:
        options.may_refuse = options.may_refuse.split(",")
    else:
        options.may_refuse = FORMATS if options.files else []
    if not options.formats:
        known = re.findall(
            r"^\s*(\w+): ", run([options.voxdag, "export", "--help"])[1], re.MULTILINE
        )
        options.formats = ",".join(name for name in FORMATS if name in known)
    failed = 0
    with tempfile.TemporaryDirectory(dir=options.folder) as scratch:
        scratch = Path(scratch)
        if not options.files:
            scene, built = scratch / "city.glb", scratch / "city.vdag"
            for args in (
                ["generate", "city", scene, "--triangles", str(options.resolution * 100)],
                ["build", scene, "-r", str(options.resolution), "-o", built],
            ):
                status, _, err, *_ = run([options.voxdag, *args])
                assert status == 0, err
            options.files = [str(built)]
        folder = scratch / "out"
        folder.mkdir()
        print(
            "| file | format | size | wall | CPU | peak memory "
            "| decoder, CPU | equal, one to one |",
            flush=True,
        )
        print("|---|---|---|---|---|---|---|---|")
        for text in options.files:
            selection = Selection(options, text)
            for name in options.formats.split(","):
                try:
                    row = check(options, selection, name, folder)
                except AssertionError as error:
                    failed += 1
                    row = [f"FAILED: {error}"]
                    for path in folder.iterdir():
                        path.unlink()
                print(f"| {Path(text).name} | `{name}` | {' | '.join(row)} |", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
