"""Checks the type annotations: mypy finds no error in the package, and finds wrong arguments."""

import os
import shutil
import subprocess
import sys
import textwrap

import pytest
import voxdag
from voxdag._types import SceneWarning


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
        report = voxdag.build(dag, resolution=64, output=dag, progress=True, solid="winding")
        report["voxel"]
        reveal_type(report["dropped"]["outside"])
        reveal_type(voxdag.plan("scene.glb", resolution=64)["voxels"]["likely"])
        reveal_type(dag[1, 2, 3])
        reveal_type(dag.lookup([[1, 2, 3]]))
        dag.render(sise=(8, 8))
        dag.export("a.ply", level=4, gray=True)["notes"]
        voxdag.from_points([[1, 2, 3]], 0.5, colors=None, memory="1GiB", thread=3)
        voxdag.build(7, resolution=64, output="scene.vdag")
        mesh = voxdag.Mesh([[0, 0, 0]], [[0, 0, 0]])
        voxdag.build([mesh, "a.glb"], resolution=64, output="scene.vdag", solid=True)
        voxdag.build(([[0, 0, 0]], [[0, 0, 0]]), resolution=64, output="scene.vdag")
        reveal_type((dag | dag) - dag)
        voxdag.combine(dag, "b.vdag", "or")
        reveal_type(dag.edit(cut=["box:0,0,0,1,1,1"], add=mesh, paste=[("b.vdag", (0, 0, 0))]))
        dag.edit(paste=["b.vdag"])
        voxdag.edit("a.vdag", fill=(0, 0, 0))
        reveal_type(dag.dilate(2).erode(outside_set=True, threads=1))
        dag.dilate(2, fill_color=(0, 0, 0))
    """)
    )
    checked = mypy(tmp_path, "--strict", "--allow-any-generics", "-p", "voxdag")
    assert checked.returncode == 0, checked.stdout
    shutil.rmtree(tmp_path / "voxdag")
    user = mypy(tmp_path, "--strict", "--allow-any-generics", "user.py").stdout.replace(
        "builtins.", ""
    )
    for expected in (
        'user.py:4: note: Revealed type is "int"',
        "user.py:6: error: Argument 1",
        "user.py:7: error: Argument",
        'user.py:8: error: Unexpected keyword argument "colors"',
        "user.py:9: error: Argument",
        'user.py:13: error: TypedDict "BuildReport" has no key "voxel"',
        'user.py:14: note: Revealed type is "int"',
        'user.py:15: note: Revealed type is "float"',
        'user.py:16: note: Revealed type is "bool"',
        "numpy.bool",
        'user.py:18: error: Unexpected keyword argument "sise"',
        'user.py:20: error: Unexpected keyword argument "thread"',
        "user.py:21: error: Argument 1",
        'user.py:25: note: Revealed type is "voxdag._dag.Dag"',
        "user.py:26: error: Argument 3",
        'user.py:27: note: Revealed type is "voxdag._dag.Dag"',
        "user.py:28: error: List item 0",
        'user.py:29: error: Unexpected keyword argument "fill"',
        'user.py:30: note: Revealed type is "voxdag._dag.Dag"',
        'user.py:31: error: Unexpected keyword argument "fill_color"',
        "Found 12 errors",
    ):
        assert expected in user, (expected, user)


def test_warnings_have_the_members_of_their_type(tmp_path):
    mesh = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.warns(UserWarning, match="no colors"):
        report = voxdag.build(mesh, resolution=16, output=tmp_path / "x.vdag", color=True)
    assert report["warnings"][0].keys() == SceneWarning.__annotations__.keys()
