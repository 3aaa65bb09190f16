"""The yardstick: an in-memory speed study of the build stage, outside of this repository.

It is one C++ program that reads an OBJ file and prints the CPU seconds of its build stage. It is
compiled for the very machine it runs on (-march=native), which the shipped binary is not.
"""

import lzma
import re
import shutil
from pathlib import Path

from measure import run
from scenes import HAIRBALL, glb_to_obj

# Scenes that the study has a copy of, by its name.
MESHES = {"sponza": "sponza", "dragon_100k": "dragon"}

# The study's own cube and child order differ a little: its counts only tell that the work was alike.
VOXELS_WITHIN = 0.005
NODES_WITHIN = 0.03


class Study:
    def __init__(self, source, folder):
        """Copies the study into `folder` and compiles it there."""
        self.folder = Path(folder)
        self.source = Path(source)
        for path in self.source.iterdir():
            if path.suffix in (".h", ".cpp"):
                shutil.copyfile(path, self.folder / path.name)
        # One load asks for 32-byte alignment that its heap object does not have.
        header = self.folder / "build.h"
        text = header.read_text().replace("_mm256_load_si256(", "_mm256_loadu_si256(")
        header.write_text(text)
        self.program = self.folder / "study"
        run(["g++", "-std=c++20", "-O3", "-march=native", "-w", "-o", self.program,
             self.folder / "bench.cpp"])

    def knows(self, scene):
        return scene in MESHES or scene == HAIRBALL

    def mesh_of(self, scene, scene_path):
        """The scene as .obj: the study's own copy, or converted."""
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
        found = re.search(r"BUILD cpu ([\d.]+) s \(wall ([\d.]+)\) \| voxels ([\d.e+]+).*"
                          r"dag ([\d.e+]+) nodes", text)
        if not found:
            raise SystemExit(f"the study's answer has no 'BUILD cpu': {text}")
        cpu_s, wall_s, voxels, dag_nodes = map(float, found.groups())
        return {"cpu_s": cpu_s, "wall_s": wall_s, "voxels": voxels, "dag_nodes": dag_nodes}


def same_work(study, report):
    """Whether the study's counts are as near to the build's as they must be."""
    return (abs(study["voxels"] / report["voxels"] - 1) <= VOXELS_WITHIN
            and abs(study["dag_nodes"] / report["dag_nodes"] - 1) <= NODES_WITHIN)
