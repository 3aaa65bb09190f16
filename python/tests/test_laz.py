"""Builds of LAZ files, which laspy decompresses."""

import os
import sys

import numpy as np
import pytest
import voxdag

laspy = pytest.importorskip("laspy")
pytest.importorskip("lazrs")

COUNT = 20_000


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Returns a folder with the same points in a.las and a.laz."""
    folder = tmp_path_factory.mktemp("laz")
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [1000, 2000, 0]
    las = laspy.LasData(header)
    random = np.random.default_rng(5)
    las.X, las.Y, las.Z = random.integers(-1_000_000, 1_000_000, (3, COUNT))
    las.red, las.green, las.blue = random.integers(0, 65536, (3, COUNT))
    las.write(folder / "a.las")
    las.write(folder / "a.laz")
    assert (folder / "a.laz").stat().st_size < (folder / "a.las").stat().st_size
    return folder


def test_same_bytes_as_las(folder, tmp_path):
    options = {"resolution": 256, "color": True, "force": True}
    digests = {
        voxdag.build(folder / name, output=tmp_path / "a.vdag", **options)["sha256"]
        for name in ("a.las", "a.laz")
    }
    assert len(digests) == 1
    assert sorted(os.listdir(tmp_path)) == ["a.vdag", "a.vdag.report.json"]
    os.rename(folder / "a.laz", folder / "renamed")
    voxdag.build(folder / "renamed", resolution=256, output=tmp_path / "b.vdag")
    os.rename(folder / "renamed", folder / "a.laz")


def test_chunks_and_several_files(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("voxdag._laz._CHUNK_POINTS", 777)
    reports = [
        voxdag.build(scene, resolution=64, output=tmp_path / "a.vdag", force=True)
        for scene in ([folder / "a.laz", folder / "a.las"], [folder / "a.las", folder / "a.laz"])
    ]
    assert [report["triangles"] for report in reports] == [2 * COUNT] * 2
    assert reports[0]["sha256"] == reports[1]["sha256"]


def test_plan(folder):
    assert voxdag.plan(folder / "a.laz", resolution=1024)["voxels"]["likely"] > 0


def test_interrupted_build_resumes(folder, tmp_path):
    # Large cubes make the stage long enough for calls of stop().
    options = {"resolution": 4096, "point_radius": 20}
    output = tmp_path / "a.vdag"

    def stop(stage, *_):
        if stage == "build":
            raise KeyError("stop")

    with pytest.raises(KeyError):
        voxdag.build(folder / "a.laz", output=output, progress=stop, **options)
    assert not [name for name in os.listdir(tmp_path) if name.endswith(".las")]
    resumed = voxdag.build(folder / "a.laz", output=output, **options)
    whole = voxdag.build(folder / "a.las", output=tmp_path / "b.vdag", **options)
    assert resumed["sha256"] == whole["sha256"]


def test_faults(folder, tmp_path, monkeypatch):
    data = (folder / "a.laz").read_bytes()
    (tmp_path / "cut.laz").write_bytes(data[: len(data) // 2])
    with pytest.raises(voxdag.Error, match=r"cut\.laz: cannot be decompressed"):
        voxdag.build(tmp_path / "cut.laz", resolution=64, output=tmp_path / "a.vdag")
    assert os.listdir(tmp_path) == ["cut.laz"]
    monkeypatch.setitem(sys.modules, "laspy", None)
    with pytest.raises(voxdag.Error, match="pip install") as caught:
        voxdag.build(folder / "a.laz", resolution=64, output=tmp_path / "a.vdag")
    assert caught.value.code == "invalid_input"
