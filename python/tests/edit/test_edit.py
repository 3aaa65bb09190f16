"""Edits from Python, against numpy and against the command voxdag edit."""

import io
import os
import subprocess
from types import SimpleNamespace

import numpy as np
import pytest
import voxdag

EDGE = 32


def box(low, high):
    cells = np.zeros((EDGE,) * 3, bool)
    cells[tuple(slice(a, b) for a, b in zip(low, high))] = True
    return cells


def ball(center, radius):
    centers = np.stack(np.meshgrid(*[np.arange(EDGE) + 0.5] * 3, indexing="ij"), axis=-1)
    return ((centers - center) ** 2).sum(axis=-1) <= radius**2


@pytest.fixture(scope="module")
def cells():
    return np.random.default_rng(3).random((EDGE,) * 3) < 0.4


@pytest.fixture(scope="module")
def file(cells):
    return voxdag.from_dense(cells)


def test_cuts(file, cells, tmp_path):
    cut = file.edit(cut="box:3,0,5,20,32,9")
    assert np.array_equal(cut.dense(), cells & ~box((3, 0, 5), (20, 32, 9)))
    shapes = ["sphere:16,16,10.5,7.5", "box:-5,30,0,40,40,40"]
    cut = voxdag.edit(file, tmp_path / "cut.vdag", cut=shapes, memory="64MiB", threads=1)
    expected = cells & ~ball((16, 16, 10.5), 7.5) & ~box((0, 30, 0), (32, 32, 32))
    assert np.array_equal(cut.dense(), expected)
    assert cut.path == str(tmp_path / "cut.vdag")
    assert cut == voxdag.from_dense(expected)


def test_pastes(file, cells):
    part = np.random.default_rng(4).random((8, 8, 8)) < 0.5
    moved = np.zeros_like(cells)
    moved[5:13, 20:28, 3:11] = part
    moved[28:32, 0:8, 0:8] |= part[:4]
    source = voxdag.from_dense(part, voxel_size=file.voxel_size)
    pasted = file.edit(paste=[(source, (5, 20, 3)), (source.path, (28, 0, 0))], clip=True)
    assert np.array_equal(pasted.dense(), cells | moved)
    # Cuts come before pastes.
    with pytest.warns(UserWarning, match="the result has no voxels"):
        both = file.edit(paste=[(source, (5, 20, 3))], cut="box:0,0,0,32,32,32")
    assert np.array_equal(np.argwhere(both.dense()), np.argwhere(part) + (5, 20, 3))
    with pytest.raises(voxdag.Error, match=r"outside of the grid .* or clip to drop them"):
        file.edit(paste=[(source, (28, 0, 0))])


def test_adds_meshes_and_files(dag, mesh, tmp_path):
    other = np.array([[-1, -1, -1], [1, -1, 0.5], [0, 2, 1]]), np.array([[0, 1, 2]])
    low, high = dag.bounds
    bounds = (*low, high[0] - low[0])
    expected = tmp_path / "both.vdag"
    voxdag.build(
        [voxdag.Mesh(*mesh), voxdag.Mesh(*other)], resolution=64, bounds=bounds, output=expected
    )
    added = dag.edit(add=other)
    assert added == voxdag.open(expected) and len(added) > len(dag)
    obj = tmp_path / "other.obj"
    obj.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in other[0]) + "f 1 2 3\n")
    header = "ply\nformat ascii 1.0\nelement vertex 3\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in other[0]) + "3 0 1 2\n"
    ply = io.BytesIO((header + rows).encode())
    for scene in (obj, [obj, voxdag.Mesh(*other)], ply):
        assert dag.edit(add=scene) == added


def test_equals_the_command(file, tmp_path):
    arguments = ["edit", file.path, "--cut", "sphere:3,3,3,9", "--paste", f"{file.path}@1,2,-3"]
    program = os.environ.get("VOXDAG_PROGRAM")
    if program is None:
        pytest.skip("VOXDAG_PROGRAM is not set")
    output = tmp_path / "command.vdag"
    subprocess.run([program, *arguments, "--clip", "-o", output], check=True)
    file.edit(tmp_path / "python.vdag", cut="sphere:3,3,3,9", paste=[(file, (1, 2, -3))], clip=True)
    assert (tmp_path / "python.vdag").read_bytes() == output.read_bytes()


def test_colors(tmp_path):
    red = voxdag.from_voxels([[1, 2, 3], [4, 5, 6]], [[255, 0, 0]] * 2, resolution=16)
    plain = voxdag.from_voxels([[0, 0, 0]], resolution=16)
    kept = red.edit(cut="box:4,5,6,5,6,7")
    assert kept.points().tolist() == [[1, 2, 3]] and kept.attributes == ["color"]
    with pytest.raises(voxdag.Error, match="fill_color with a color for"):
        red.edit(paste=[(plain, (9, 9, 9))])
    filled = red.edit(paste=[(plain, (9, 9, 9))], fill_color=(0, 255, 0), color_resolution=16)
    assert np.allclose(filled.colors([[1, 2, 3], [9, 9, 9]]), [[255, 0, 0], [0, 255, 0]], atol=48)
    assert red.edit(paste=[(plain, (9, 9, 9))], no_attributes=True).attributes == []
    with pytest.warns(UserWarning, match="^fill_color has no effect"):
        red.edit(cut="box:4,5,6,5,6,7", fill_color=(0, 0, 0))
    blue = voxdag.Mesh([[9, 9, 9], [9.5, 9, 9], [9, 9.5, 9]], [[0, 1, 2]], colors=[0, 0, 255])
    added = red.edit(add=blue)
    assert np.allclose(added.colors([[1, 2, 3], [9, 9, 9]]), [[255, 0, 0], [0, 0, 255]], atol=48)


def test_warnings_name_the_callers_line(dag):
    line = SimpleNamespace(type="line", data=[[0, 1]])
    triangle = SimpleNamespace(type="triangle", data=[[0, 1, 2]])
    scene = SimpleNamespace(points=np.eye(3), cells=[triangle, line], point_data={})
    with pytest.warns(UserWarning) as warned:
        dag.edit(add=scene)
        dag.edit(cut="box:0,0,0,64,64,64")
    assert len(warned) == 2
    assert {warning.filename for warning in warned} == {__file__}


def test_progress_and_temporary_file(file):
    stages = []
    edited = file.edit(cut="box:0,0,0,4,4,4", progress=lambda stage, *_: stages.append(stage))
    folder = os.path.dirname(edited.path)
    edited.close()
    assert not os.path.exists(folder)

    def stop(*_):
        raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        file.edit(cut=["box:0,0,0,4,4,4"] * 40, progress=stop)


@pytest.mark.parametrize(
    "options, message",
    [
        ({}, "no edit was given: expected cut, add, paste, dilate or erode"),
        ({"cut": "cube:1,2,3"}, "shape 'cube:1,2,3': expected"),
        ({"cut": ["box:0,0,0,1,1,1", "sphere:0.3,0,0,1"]}, "multiples of 0.5"),
        ({"cut": "box:0,0,0,4,4,4", "memory": "8MiB"}, "at least 64MiB"),
        ({"cut": "box:0,0,0,4,4,4", "threads": -1}, "threads=-1"),
        ({"cut": "box:0,0,0,4,4,4", "color_resolution": -1}, "color_resolution=-1"),
        ({"cut": "box:0,0,0,4,4,4", "color_resolution": 3}, "power of two"),
        ({"cut": "box:0,0,0,4,4,4", "fill_color": (0, 0, 256)}, "three integers from 0 to 255"),
        ({"paste": [("missing.vdag", (0, 0, 0))]}, "missing.vdag"),
        ({"paste": ["missing.vdag"]}, "expected a list of pairs"),
        ({"paste": 7}, "expected a list of pairs"),
        ({"paste": [("a.vdag", (0, 0.5, 0))]}, "expected three integers"),
        ({"paste": [("a.vdag", (1 << 70, 0, 0))]}, "expected integers of 64 bits"),
        ({"add": "missing.glb"}, "missing.glb"),
        ({"cut": "box:0,0,0,4,4,4", "output": "a\0b"}, "without NUL"),
    ],
)
def test_refuses(file, options, message):
    with pytest.raises(voxdag.Error, match=message):
        file.edit(**options)


def test_refuses_outputs(file, tmp_path):
    with pytest.raises(voxdag.Error) as error:
        file.edit(file.path, cut="box:0,0,0,4,4,4", force=True)
    assert error.value.code == "invalid_input"
    (tmp_path / "old.vdag").write_text("old")
    with pytest.raises(voxdag.Error, match="exists"):
        file.edit(tmp_path / "old.vdag", cut="box:0,0,0,4,4,4")
    mesh = np.eye(3), [[0, 1, 2]]
    assert file.edit(tmp_path / "old.vdag", cut="box:0,0,0,4,4,4", add=mesh, force=True).voxels
    file.reorder(tmp_path / "other.vdag")
    with pytest.raises(voxdag.Error, match="reorder"):
        voxdag.edit(tmp_path / "other.vdag", cut="box:0,0,0,4,4,4")
    with pytest.raises(TypeError):
        file.edit(cut="box:0,0,0,4,4,4", colors=True)
