#!/usr/bin/env python3
"""Tests `pip install .` as a user runs it, in an empty virtual environment.

    tests/long/wheel.py [--folder DIR]

Builds the wheel of this checkout with `pip wheel`, which compiles the complete library, in a
separate build folder. Checks that the wheel has the name and the tags that this Python needs
(cp312-abi3 from 3.12 on, before that one tag for each version), and that it contains the package
with its types, the license, and no other file. Then installs the wheel, runs the program at the top
of docs/python.md in an empty folder, and checks that the program's picture is not empty and that
mypy knows the package's types. Needs PyPI.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import textwrap
import time
import zipfile
from pathlib import Path

REPO = Path(__file__).resolve().parents[2]
# Python must not find modules in the repository instead of the installed package.
ENVIRONMENT = {
    name: value for name, value in os.environ.items() if not name.startswith("PYTHON")
} | {"MPLBACKEND": "Agg"}


def run(command, folder, status=0):
    """Runs a command, which must end with this status. Returns its output."""
    done = subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        env=ENVIRONMENT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    if done.returncode != status:
        sys.exit(
            f"{' '.join(map(str, command))}\n"
            f"status {done.returncode}, expected {status}: {done.stdout}"
        )
    return done.stdout


def field(name):
    return re.search(
        rf'^{name} = "(.+)"$', (REPO / "pyproject.toml").read_text(), re.MULTILINE
    ).group(1)


def expected_tags():
    """Returns the expected tags of the wheel, and the suffix of its modules' names."""
    platform = re.sub("[-.]", "_", sysconfig.get_platform())
    if sys.version_info >= (3, 12):
        return f"cp312-abi3-{platform}", ".abi3.so"
    version = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{version}-{version}-{platform}", sysconfig.get_config_var("EXT_SUFFIX")


def check_wheel(wheel):
    name = f"voxdag-{field('version')}"
    tags, suffix = expected_tags()
    assert wheel.name == f"{name}-{tags}.whl", f"{wheel.name}, expected {name}-{tags}.whl"
    modules = {path.name for path in (REPO / "python" / "voxdag").iterdir() if path.suffix == ".py"}
    modules |= {"_options.py", "_reports.py"}  # generated
    package = {
        f"voxdag/{file}" for file in modules | {"py.typed", "_native.pyi", "_native" + suffix}
    }
    with zipfile.ZipFile(wheel) as archive:
        files = {file for file in archive.namelist() if not file.endswith("/")}
        information = {file for file in files if file.startswith(f"{name}.dist-info/")}
        assert files - information == package, f"files: {sorted((files - information) ^ package)}"
        licenses = {file for file in information if file.endswith("/LICENSE")}
        assert len(licenses) == 1, f"licenses: {licenses}"
        other = {Path(file).name for file in information - licenses}
        assert other == {"METADATA", "WHEEL", "RECORD"}, other
        assert archive.read(licenses.pop()) == (REPO / "LICENSE").read_bytes(), "another license"
        facts = archive.read(f"{name}.dist-info/WHEEL").decode().splitlines()
        assert f"Tag: {tags}" in facts and "Root-Is-Purelib: false" in facts, facts
        metadata = archive.read(f"{name}.dist-info/METADATA").decode().splitlines()
        for line in (
            "Name: voxdag",
            f"Version: {field('version')}",
            f"Requires-Python: {field('requires-python')}",
            "Requires-Dist: numpy",
        ):
            assert line in metadata, f"METADATA has no '{line}'"
        stub = archive.read("voxdag/_native.pyi").decode()
        assert "def build(" in stub and "class" in stub, "the stub says nothing"
    print(f"{wheel.name}: {len(files)} files, {wheel.stat().st_size / 2**20:.1f} MiB", flush=True)


def check_program(python, folder):
    """Runs the first program of docs/python.md, and checks the contents of its picture."""
    program = re.search(
        r"^```python\n(.*?)^```",
        (REPO / "docs" / "python.md").read_text(),
        re.MULTILINE | re.DOTALL,
    ).group(1)
    folder.mkdir()
    run([python, "-c", program], folder)
    made = sorted(file.name for file in folder.iterdir())
    assert made == ["scene.png", "scene.vdag", "scene.vdag.report.json"], made
    shown = run(
        [
            python,
            "-c",
            textwrap.dedent("""
        import matplotlib.pyplot as plt, numpy as np
        picture = plt.imread("scene.png")[:, :, :3]
        colors, counts = np.unique(picture.reshape(-1, 3), axis=0, return_counts=True)
        print(*picture.shape[:2], len(colors), counts.max() / counts.sum())
    """),
        ],
        folder,
    ).split()
    assert shown[:2] == ["300", "400"], shown
    # The tetrahedron covers a part of the picture, and its sides have different brightness.
    assert int(shown[2]) > 20 and float(shown[3]) < 0.95, f"a blank picture: {shown}"
    print(f"the program of docs/python.md: a picture of {shown[2]} colors", flush=True)


def check_types(python, folder):
    folder.mkdir()
    (folder / "good.py").write_text(
        textwrap.dedent("""
        import numpy as np
        import numpy.typing as npt
        import voxdag

        def count(path: str) -> int:
            dag = voxdag.open(path)
            set_voxels: npt.NDArray[np.bool_] = dag.lookup(np.zeros((1, 3), np.int64))
            return dag.count() + len(set_voxels)
    """)
    )
    (folder / "bad.py").write_text(
        textwrap.dedent("""
        import voxdag
        voxdag.open(7)
        voxdag.build("scene.glb", resolution="64", output="scene.vdag")
    """)
    )
    run([python, "-m", "mypy", "--strict", "good.py"], folder)
    found = run([python, "-m", "mypy", "--strict", "bad.py"], folder, status=1)
    assert "bad.py:3: error: Argument 1" in found and "bad.py:4: error: Argument" in found, found
    assert "Found 2 errors" in found, found
    print("mypy finds the types", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--folder", help="for all that is made; default: a temporary one")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(arguments.folder or temporary).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        for name in ("wheels", "program", "types"):
            shutil.rmtree(folder / name, ignore_errors=True)
        run([sys.executable, "-m", "venv", "--clear", folder / "venv"], folder)
        python = folder / "venv" / "bin" / "python"
        start = time.monotonic()
        run(
            [
                python,
                "-m",
                "pip",
                "wheel",
                ".",
                "--no-deps",
                "--no-cache-dir",
                "-w",
                folder / "wheels",
                "--config-settings",
                f"build-dir={folder / 'build'}",
            ],
            REPO,
        )
        print(f"pip wheel: {(time.monotonic() - start) / 60:.1f} minutes", flush=True)
        wheels = list((folder / "wheels").iterdir())
        assert len(wheels) == 1, wheels
        check_wheel(wheels[0])
        run([python, "-m", "pip", "install", "--quiet", wheels[0], "matplotlib", "mypy"], folder)
        check_program(python, folder / "program")
        check_types(python, folder / "types")
    return 0


if __name__ == "__main__":
    sys.exit(main())
