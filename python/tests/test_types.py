"""Checks the type annotations: mypy finds no error in the package, and finds wrong arguments."""

import os
import shutil
import subprocess
import sys
import textwrap

import voxdag


def mypy(folder, *arguments):
    # mypy does not report errors in installed packages, so it gets a copy of the package.
    package = os.path.dirname(voxdag.__file__)
    shutil.copytree(
        package, folder / "voxdag", ignore=shutil.ignore_patterns("*.so", "__pycache__")
    )
    return subprocess.run(
        [sys.executable, "-m", "mypy", "--cache-dir", str(folder / "cache"), *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
    )


def test_types(tmp_path):
    (tmp_path / "user.py").write_text(
        textwrap.dedent("""
        import voxdag
        dag = voxdag.open(b"scene.vdag")
        reveal_type(dag.count())
        dag.count(dag.bounds, world=True)
        voxdag.open(7)
        voxdag.build("scene.glb", resolution="64", output="scene.vdag")
        voxdag.build("scene.glb", resolution=64, output="scene.vdag", colors=True)
        voxdag.plan("scene.glb", resolution=64, backend="gpu")
        voxdag.build("scene.glb", resolution=64, output="scene.vdag", color=True, memory="8GiB",
                     bounds=(0, 0, 0, 1), attributes=["alpha"], backend="cpu", work=b"folder")
    """)
    )
    checked = mypy(tmp_path, "-p", "voxdag")
    assert checked.returncode == 0, checked.stdout
    shutil.rmtree(tmp_path / "voxdag")
    user = mypy(tmp_path, "user.py").stdout
    assert 'user.py:4: note: Revealed type is "int"' in user.replace("builtins.", ""), user
    assert "user.py:6: error: Argument 1" in user and "user.py:7: error: Argument" in user, user
    assert 'user.py:8: error: Unexpected keyword argument "colors"' in user, user
    assert "user.py:9: error: Argument" in user, user
    assert "Found 4 errors" in user, user
