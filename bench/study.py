"""Runs an optional reference program that builds a DAG in memory, given by --study FOLDER.

The folder is not part of this repository; the benchmarks run without it. It contains the C++
sources of one program, with main() in bench.cpp. The program is called as `study MESH.obj LEVELS`
and prints one line:

    BUILD cpu SECONDS s (wall SECONDS) | voxels COUNT ... dag COUNT nodes

The folder can contain meshes as NAME.obj.xz (see MESHES); other scenes are converted to .obj. The
program is compiled with -march=native. The released binary of voxdag is not.
"""

import lzma
import re
import shutil
from pathlib import Path

from measure import run
from scenes import HAIRBALL, glb_to_obj

# Scenes whose mesh is in the folder, with the mesh's name.
MESHES = {"sponza": "sponza", "dragon_100k": "dragon"}

# The reference program snaps vertices a little differently, so its counts can differ from voxdag's
# by these fractions. The comparison only shows that both programs did the same work.
VOXELS_WITHIN = 0.005
NODES_WITHIN = 0.03


class Study:
    def __init__(self, source, folder):
        """Copies the sources into `folder` and compiles them there."""
        self.folder = Path(folder)
        self.source = Path(source)
        for path in self.source.iterdir():
            if path.suffix in (".h", ".cpp"):
                shutil.copyfile(path, self.folder / path.name)
        # The sources can contain an aligned load from a heap object that is not 32-byte aligned. It
        # is replaced by an unaligned load.
        header = self.folder / "build.h"
        text = header.read_text().replace("_mm256_load_si256(", "_mm256_loadu_si256(")
        header.write_text(text)
        self.program = self.folder / "study"
        run(
            [
                "g++",
                "-std=c++20",
                "-O3",
                "-march=native",
                "-w",
                "-o",
                self.program,
                self.folder / "bench.cpp",
            ]
        )

    def supports(self, scene):
        return scene in MESHES or scene == HAIRBALL

    def mesh_of(self, scene, scene_path):
        """Returns the path of the scene as .obj: the mesh in the folder, or the converted scene."""
        mesh = self.folder / f"{scene}.obj"
        if not mesh.exists():
            if scene in MESHES:
                packed = self.source / f"{MESHES[scene]}.obj.xz"
                mesh.write_bytes(lzma.decompress(packed.read_bytes()))
            else:
                glb_to_obj(scene_path, mesh)
        return mesh

    def build_stage(self, scene, scene_path, levels):
        """CPU and wall seconds, voxels and DAG nodes of the build stage at R = 2^levels."""
        mesh = self.mesh_of(scene, scene_path)
        text = run([self.program, mesh, levels]).stdout
        found = re.search(
            r"BUILD cpu ([\d.]+) s \(wall ([\d.]+)\) \| voxels ([\d.e+]+).*"
            r"dag ([\d.e+]+) nodes",
            text,
        )
        if not found:
            raise SystemExit(f"expected a line 'BUILD cpu ...' from {self.program}: {text}")
        cpu_s, wall_s, voxels, dag_nodes = map(float, found.groups())
        return {"cpu_s": cpu_s, "wall_s": wall_s, "voxels": voxels, "dag_nodes": dag_nodes}


def same_work(study, report):
    """True if the counts of the reference and of the build are close enough."""
    return (
        abs(study["voxels"] / report["voxels"] - 1) <= VOXELS_WITHIN
        and abs(study["dag_nodes"] / report["dag_nodes"] - 1) <= NODES_WITHIN
    )
