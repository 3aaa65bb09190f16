"""Tests a wheel that contains its libraries:

    tests/install/wheel_alone.py WHEEL

Installs it in an empty virtual environment, outside of the checkout. There, it must build files
from a mesh, a texture and voxels, read and draw them, and load no library of the system that
Python itself does not load. The licenses of the bundled libraries are in the wheel.
"""

import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

PROGRAM = r"""
import bz2, ctypes, hashlib, lzma, pathlib, sqlite3, ssl, zlib
import numpy as np


def loaded():
    lines = pathlib.Path("/proc/self/maps").read_text().splitlines()
    return {pathlib.Path(line.split()[-1]) for line in lines if ".so" in line}


of_python = loaded()
import voxdag

dag = voxdag.from_voxels([(1, 2, 3), (4, 5, 6)], [(255, 0, 0), (0, 0, 255)], output="two.vdag")
assert list(dag) == [(1, 2, 3), (4, 5, 6)], list(dag)
assert dag.render(size=(64, 48)).std() > 0
vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
voxdag.build((vertices, triangles), resolution=64, output="mesh.vdag")
texture = np.zeros((4, 4, 3), np.uint8)
texture[:, :, 0] = 200
mesh = voxdag.Mesh(vertices, triangles, uv=np.zeros((4, 2)), texture=texture)
voxdag.build(mesh, resolution=64, color=True, output="texture.vdag")
with voxdag.open("texture.vdag") as textured:
    red, green, blue = textured.colors(textured.points()[:1])[0]
    assert red > 150 and green < 50 and blue < 50, (red, green, blue)

packages = pathlib.Path(voxdag.__file__).resolve().parent.parent
bundled = {path.name for path in loaded() if packages / "voxdag.libs" in path.parents}
assert bundled, "no library of the wheel is loaded"
foreign = sorted(
    str(path)
    for path in loaded() - of_python
    if packages not in path.parents and "lib-dynload" not in path.parts
    and not path.name.startswith(("libstdc++.so", "libgcc_s.so"))
)
assert not foreign, f"the wheel loads libraries of the system: {foreign}"
print(f"{len(bundled)} bundled libraries are loaded: {', '.join(sorted(bundled))}")
"""


def check_licenses(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    libraries = [name for name in names if name.startswith("voxdag.libs/")]
    licenses = [name for name in names if ".dist-info/licenses/libraries/" in name]
    assert libraries and licenses, f"libraries: {libraries}, licenses: {licenses}"
    for package in ("libzstd1", "libtinygltf-dev"):
        assert any(name.endswith(f"/{package}") for name in licenses), licenses
    print(f"{len(libraries)} libraries, {len(licenses)} licenses")


def main(wheel):
    wheel = Path(wheel).resolve()
    check_licenses(wheel)
    environment = {name: value for name, value in os.environ.items() if name[:6] != "PYTHON"}
    environment.pop("LD_LIBRARY_PATH", None)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "venv", f"{folder}/venv"], check=True)
        python = f"{folder}/venv/bin/python"
        subprocess.run([python, "-m", "pip", "install", "--quiet", wheel], check=True)
        subprocess.run([python, "-c", PROGRAM], check=True, cwd=folder, env=environment)
    print(f"{wheel.name} works in an empty environment")


if __name__ == "__main__":
    main(*sys.argv[1:])
