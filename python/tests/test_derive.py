"""Extracts and exports from Python; what they write is tested in C++ and in tests/export."""

import os

import numpy as np
import pytest

import voxdag


def test_extract_a_level(path, dag, tmp_path):
    report = voxdag.extract(path, tmp_path / "coarse.vdag", level=4, memory="64MiB")
    with voxdag.open(tmp_path / "coarse.vdag") as coarse:
        assert coarse.resolution == 16
        assert np.array_equal(coarse.dense(), dag.dense(level=4))
        assert report["voxels"] == coarse.voxels


def test_extract_a_region(path, dag, tmp_path):
    region = (5, 0, 10, 30, 64, 40)
    voxdag.extract(path, tmp_path / "part.vdag", region=region, threads=2)
    with voxdag.open(tmp_path / "part.vdag") as part:
        assert part.count() == dag.count(region)
        assert np.array_equal(part.dense(region), dag.dense(region))


def test_export(path, dag, tmp_path):
    report = voxdag.export(path, tmp_path / "voxels.npz", to="npz", level=5)
    assert report["files"] == [str(tmp_path / "voxels.npz")]
    assert report["voxels"] == dag.count(level=5)
    arrays = np.load(tmp_path / "voxels.npz")
    assert np.array_equal(arrays["cells"], dag.points(level=5))
    assert np.allclose(arrays["positions"], dag.to_world(dag.points(level=5) + 0.5, 5))
    assert "hashdag" in voxdag.export_formats()


def test_export_in_gray(mesh, tmp_path):
    colored = tmp_path / "colored.vdag"
    voxdag.build(mesh, resolution=64, output=colored, memory="64MiB", color=True)
    for gray in (False, True):
        voxdag.export(colored, tmp_path / "c.npz", to="npz", level=5, gray=gray, force=True)
        assert ("colors" in np.load(tmp_path / "c.npz")) == (not gray)


@pytest.mark.parametrize("derive, code", [
    (lambda path, out: voxdag.extract(path, path, force=True), "invalid_input"),
    (lambda path, out: voxdag.extract(path, out, region=(70, 0, 0, 80, 9, 9)), "invalid_input"),
    (lambda path, out: voxdag.extract(path, out, level=9), "invalid_input"),
    (lambda path, out: voxdag.extract(path, out, level=1), "invalid_input"),
    (lambda path, out: voxdag.extract(path, out, memory="8MiB"), "invalid_input"),
    (lambda path, out: voxdag.export(path, out, to="svdag", level=0), "invalid_input"),
    (lambda path, out: voxdag.export(path, out, to="bt", level=1), "invalid_input"),
    (lambda path, out: voxdag.extract(str(path) + "x", out), "not_found"),
    (lambda path, out: voxdag.export(path, out, to="obj"), "invalid_input"),
])
def test_refuses(path, tmp_path, derive, code):
    with pytest.raises(voxdag.Error) as refused:
        derive(path, tmp_path / "out")
    assert refused.value.code == code, refused.value
    assert os.listdir(tmp_path) == []


def test_nothing_is_overwritten(path, tmp_path):
    output = tmp_path / "notes.txt"
    output.write_text("mine")
    with pytest.raises(voxdag.Error, match="force"):
        voxdag.extract(path, output)
    assert output.read_text() == "mine"
