#!/usr/bin/env python3
"""Exports of a generated scene in one format, decoded by other code and compared voxel by voxel.

    export_test.py VOXDAG LIST_VOXELS FORMAT [TOOLS...]

Exports at three resolutions, at a coarser level, of one region, and of a region of a coarser level.
For formats whose libraries the unit tests do not use, also compares the colors of a scene. TOOLS
are programs of this folder that the decoder of the format starts. If the decoder's library is
missing, exits with 77, which ctest reports as skipped, or with 1 if VOXDAG_SKIP_NOTHING is set.
"""

import json
import os
import re
import subprocess
import sys
import tempfile

# The decoders' libraries are packages of the system. Only the system's interpreter finds them.
SYSTEM_PYTHON = "/usr/bin/python3"


def skip(what):
    print("skipped: there is no " + what)
    sys.exit(1 if os.environ.get("VOXDAG_SKIP_NOTHING") else 77)


try:
    import numpy
except ImportError:
    if os.path.exists(SYSTEM_PYTHON) and not os.environ.get("VOXDAG_SYSTEM_PYTHON"):
        os.execve(
            SYSTEM_PYTHON, [SYSTEM_PYTHON, *sys.argv], os.environ | {"VOXDAG_SYSTEM_PYTHON": "1"}
        )
    skip("numpy here (python3-numpy)")

import decoders  # noqa: E402
import level_sets  # noqa: E402

SUFFIXES = {"hashdag": ".basic_dag.dag.bin", "voxel": ".voxel.json"}
# Each export: the resolution of the built file, and the options of the export.
CASES = [
    (64, []),
    (256, []),
    (512, []),
    (512, ["--level", "7"]),
    (256, ["--region", "37,0,90,150,201,133"]),
    (512, ["--level", "8", "--region", "101,3,50,170,201,133"]),
]

# More exports of some formats.
MORE_CASES = {
    "vdb": [(64, ["--grid", "mask"]), (256, ["--level", "7", "--grid", "mask"])],
    "nvdb": [(64, ["--grid", "mask"]), (256, ["--level", "7", "--grid", "mask"])],
    "npz": [(64, ["--compact"])],
}
# Exports whose upward axis differs from the format's default (--up).
TURN_CASES = [(64, []), (256, ["--level", "7", "--region", "9,0,30,90,101,83"])]

# Options of exports of the solid, whose resolution is 64.
SOLID_CASES = [[], ["--level", "5"], ["--region", "5,0,16,64,49,60"]]

# Options of exports of the solid with --grid sdf.
LEVEL_SET_CASES = [
    ["--level", "5"],
    ["--level", "4", "--band", "2"],
    ["--level", "5", "--band", "2", "--chunks", "4"],
]


class Grid:
    """The exported grid. Converts between its cells and world coordinates.

    `turn`: "z" if the y axis of the file is the z axis of the grid, (x, y, z) -> (x, -z, y); "y"
    for the inverse turn; None for the axes of the file.
    """

    def __init__(self, info, levels, region, turn=None):
        self.levels = levels
        self.resolution = 2**levels
        self.origin = numpy.array(info["bounds"]["origin"])
        self.edge = info["bounds"]["edge"]
        self.voxel = self.edge / self.resolution
        self.low = numpy.array(region[:3] if region else [0] * 3)
        self.high = numpy.array(region[3:] if region else [self.resolution] * 3)
        self.turn = turn
        if turn:
            x, y, z = self.origin
            self.origin = (
                numpy.array([x, -(z + self.edge), y])
                if turn == "z"
                else numpy.array([x, z, -(y + self.edge)])
            )
            corners = self.turned(numpy.array([self.low, self.high - 1]))
            self.low, self.high = corners.min(axis=0), corners.max(axis=0) + 1

    def turned(self, cells):
        x, y, z = cells.T
        last = self.resolution - 1
        turns = {None: (x, y, z), "z": (x, last - z, y), "y": (x, z, last - y)}
        return numpy.stack(turns[self.turn], axis=1)

    def cells(self, centers):
        """Returns the cells that have these centers in world space."""
        cells = (centers - self.origin) / self.voxel - 0.5
        rounded = numpy.rint(cells)
        assert numpy.abs(cells - rounded).max() < 1e-3, "positions are not centers of voxels"
        return rounded.astype(numpy.int64)


def keys(cells):
    cells = numpy.asarray(cells).astype(numpy.int64)
    assert cells.min() >= 0 and cells.max() < 2**20, "cells outside the grid"
    return cells[:, 0] << 40 | cells[:, 1] << 20 | cells[:, 2]


class Test:
    def __init__(self, voxdag, list_voxels, name, tools):
        self.voxdag, self.list_voxels, self.name = voxdag, list_voxels, name
        self.decode = getattr(decoders, name)
        self.tools = tools
        self.files = {}

    def run(self, *args, status=0):
        done = subprocess.run([self.voxdag, *args], capture_output=True, text=True)
        assert done.returncode == status, f"{args}: {done.returncode}, {done.stderr}"
        return done.stdout if status == 0 else done.stderr

    def scene(self, resolution):
        """Builds the generated city. Returns the .vdag file."""
        if resolution not in self.files:
            if not os.path.exists("city.glb"):
                self.run("generate", "city", "city.glb", "--triangles", "20000")
            path = f"city{resolution}.vdag"
            self.run("build", "city.glb", "-r", str(resolution), "-o", path)
            self.files[resolution] = path, json.loads(self.run("info", path, "--json"))
        return self.files[resolution]

    def solid(self):
        """Builds a solid, which has full cubes of many sizes. Returns the .vdag file."""
        if "solid" not in self.files:
            self.run("generate", "menger", "solid.glb", "--level", "1")
            self.run("build", "solid.glb", "-r", "64", "--solid", "winding", "-o", "solid.vdag")
            self.files["solid"] = "solid.vdag", json.loads(self.run("info", "solid.vdag", "--json"))
        return self.files["solid"]

    def expected(self, path, shift, grid):
        listed = subprocess.run(
            [self.list_voxels, path, str(shift)], capture_output=True, check=True
        )
        cells = grid.turned(numpy.frombuffer(listed.stdout, "<i4").reshape(-1, 3))
        cells = cells[((cells >= grid.low) & (cells < grid.high)).all(axis=1)]
        return numpy.unique(keys(cells))

    def check(self, resolution, options, solid=False, turn=None):
        path, info = self.solid() if solid else self.scene(resolution)
        given = dict(zip(options[::2], options[1::2]))
        full = resolution.bit_length() - 1
        region = [int(x) for x in given["--region"].split(",")] if "--region" in given else None
        grid = Grid(info, int(given.get("--level", full)), region, turn)
        options = [*options, "--up", turn] if turn else options
        output = "out" + SUFFIXES.get(self.name, "." + self.name)
        report = json.loads(
            self.run("export", path, "--to", self.name, "-o", output, "--json", "--force", *options)
        )
        expected = self.expected(path, full - grid.levels, grid)
        assert len(expected) > 100, "too small a scene"
        found = keys(self.decode(output, grid, *self.tools))
        assert len(numpy.unique(found)) == len(found), "a voxel comes twice"
        wrong = numpy.setxor1d(expected, found)
        assert len(wrong) == 0, f"{len(wrong)} of {len(expected)} voxels differ"
        assert report["voxels"] == len(expected), report
        assert report["bytes"] == sum(map(os.path.getsize, report["files"])), report
        left = [name for name in os.listdir(".") if name.endswith(".partial")]
        assert not left, left
        print(f"{resolution} {' '.join(options)}: {len(expected)} voxels, {report['bytes']} bytes")

    def colored_scene(self):
        """Builds a bumpy sheet with colored corners. Returns the .vdag file."""
        corners = []
        for i in range(21):
            for j in range(21):
                color = f"{12 * i} {12 * j} {(37 * i * j) % 256}"
                corners.append(f"{i} {(i * j) % 5} {j} {color}\n")
        faces = []
        for a in range(20 * 21):
            if a % 21 != 20:
                faces += [f"3 {a} {a + 1} {a + 21}\n", f"3 {a + 1} {a + 22} {a + 21}\n"]
        with open("sheet.ply", "w", encoding="ascii") as file:
            file.write(
                "ply\nformat ascii 1.0\n"
                f"element vertex {len(corners)}\n"
                + "".join(f"property float {axis}\n" for axis in "xyz")
                + "".join(f"property uchar {channel}\n" for channel in ("red", "green", "blue"))
                + f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
            )
            file.writelines(corners + faces)
        self.run("build", "sheet.ply", "-r", "128", "--color", "-o", "sheet.vdag")
        return "sheet.vdag", json.loads(self.run("info", "sheet.vdag", "--json"))

    def check_colors(self):
        """Checks that each voxel has the reader's color, or no color if gray is requested."""
        decode = getattr(decoders, self.name + "_colors", None)
        if not decode:
            return
        path, info = self.colored_scene()
        output = "colored." + self.name
        for level in (7, 5):
            grid = Grid(info, level, None)
            options = ["--to", self.name, "-o", output, "--force", "--level", str(level)]
            self.run("export", path, *options)
            cells, colors = decode(output, grid, *self.tools)
            found = numpy.stack([keys(cells), colors @ [65536, 256, 1]], axis=1)
            listed = subprocess.run(
                [self.list_voxels, path, str(7 - level), "colors"], capture_output=True, check=True
            )
            listed = numpy.frombuffer(listed.stdout, "<i4").reshape(-1, 4)
            expected = numpy.stack([keys(listed[:, :3]), listed[:, 3]], axis=1)
            expected = numpy.unique(expected, axis=0)
            assert len(expected) > 100 and len(numpy.unique(expected[:, 1])) > 100
            assert (found[numpy.argsort(found[:, 0])] == expected).all(), "other colors"
            colored_bytes = os.path.getsize(output)
            self.run("export", path, *options, "--gray")
            assert os.path.getsize(output) < colored_bytes
            print(f"colors of level {level}: {len(expected)} voxels, {colored_bytes} bytes")

    def check_level_set(self, resolution, options):
        """Compares the values of `--grid sdf` with exact distances. The distance of a set voxel is
        measured to the nearest empty voxel, and the distance of an empty voxel to the nearest set
        voxel."""
        path, info = self.solid()
        given = dict(zip(options[::2], options[1::2]))
        full, band = resolution.bit_length() - 1, int(given.get("--band", 3))
        levels = int(given.get("--level", full))
        grid = Grid(info, levels, None)
        output = "level_set" + ("" if "--chunks" in given else "." + self.name)
        sdf = ["--to", self.name, "--grid", "sdf", "-o", output, "--force"]
        self.run("export", path, *sdf, *options)
        # The cells of the grid and a margin, in which all cells are empty.
        edge = grid.resolution + 4 * band
        is_set = numpy.zeros((edge,) * 3, bool)
        listed = subprocess.run(
            [self.list_voxels, path, str(full - levels)], capture_output=True, check=True
        )
        cells = numpy.frombuffer(listed.stdout, "<i4").reshape(-1, 3) + 2 * band
        is_set[tuple(cells.T)] = True
        steps = range(-band, band + 1)
        limit = 4 * band * band
        squares = numpy.full(is_set.shape, limit)
        for step in [(x, y, z) for x in steps for y in steps for z in steps]:
            square = sum((2 * abs(d) - 1) ** 2 for d in step if d)
            differs = numpy.roll(is_set, step, (0, 1, 2)) != is_set
            squares[differs & (squares > square)] = square
        expected = numpy.sqrt(squares) / 2 * grid.voxel * numpy.where(is_set, -1, 1)
        in_band = squares < limit

        def check(file, part):
            decode = getattr(level_sets, self.name)
            values, active = decode(file, grid, [-2 * band] * 3, edge, band, *self.tools)
            assert numpy.abs(values - expected)[part].max() < 1e-5 * grid.voxel
            assert (active[part] == in_band[part]).all()
            return active[part].sum()

        if "--chunks" in given:
            self.check_chunks(output, grid, band, is_set, in_band, check)
        else:
            assert check(output, ...) == in_band.sum()
        print(f"level set {' '.join(options)}: {in_band.sum()} active voxels")

    def check_chunks(self, folder, grid, band, is_set, in_band, check):
        """Checks the chunks of a level set. A chunk at the border of the grid also has the part of
        the band that is outside the grid."""
        with open(folder + "/manifest.json", encoding="utf-8") as file:
            manifest = json.load(file)
        kinds = {"inside": 0, "without voxels": 0}
        rest = in_band.copy()
        for chunk in manifest["levels"][0]["chunks"]:
            low, high = numpy.array(chunk["low"]), numpy.array(chunk["high"])
            own = tuple(slice(2 * band + a, 2 * band + b) for a, b in zip(low, high))
            low = numpy.where(low == 0, -band, low)
            high = numpy.where(high == grid.resolution, high + band, high)
            part = tuple(slice(2 * band + a, 2 * band + b) for a, b in zip(low, high))
            check(os.path.join(folder, chunk["files"][0]["path"]), part)
            assert chunk["voxels"] == is_set[own].sum()
            rest[part] = False
            kinds["inside"] += is_set[own].all() and not in_band[own].any()
            kinds["without voxels"] += not is_set[own].any()
        assert not rest.any(), "cells of the band are in no chunk"
        assert all(kinds.values()), kinds
        print("chunks:", kinds)

    def check_refusals(self):
        """Checks that existing files and empty selections are refused, and leave no other files."""
        path, _ = self.scene(64)
        output = "refused" + SUFFIXES.get(self.name, "." + self.name)
        nothing = ["--region", "0,63,0,1,64,1"]
        message = self.run("export", path, "--to", self.name, "-o", output, *nothing, status=2)
        assert "no voxels" in message, message
        assert not [name for name in os.listdir(".") if name.startswith("refused")]
        with open(output, "w", encoding="utf-8") as file:
            file.write("somebody's")
        message = self.run("export", path, "--to", self.name, "-o", output, status=2)
        assert "--force" in message, message
        with open(output, encoding="utf-8") as file:
            assert file.read() == "somebody's"


def main():
    voxdag, list_voxels, name, *tools = sys.argv[1:]
    missing = decoders.missing(name, tools)
    if not missing and not re.search(
        rf"^\s*{name}: ", subprocess.getoutput(f"{voxdag} export --help"), re.MULTILINE
    ):
        missing = f"{name} in this build of voxdag: its library was not found"
    if missing:
        skip(missing)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        test = Test(voxdag, list_voxels, name, tools)
        for resolution, options in CASES:
            test.check(resolution, options)
        for options in SOLID_CASES:
            test.check(64, options, solid=True)
        for resolution, options in MORE_CASES.get(name, []):
            test.check(resolution, options)
        for resolution, options in TURN_CASES:
            test.check(resolution, options, turn="y" if name == "vox" else "z")
        if name in ("vdb", "nvdb"):
            for options in LEVEL_SET_CASES:
                test.check_level_set(64, options)
        test.check_colors()
        test.check_refusals()
    return 0


if __name__ == "__main__":
    sys.exit(main())
