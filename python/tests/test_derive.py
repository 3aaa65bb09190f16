"""Extracts and exports from Python. C++ tests and tests/export check the files' contents."""

import os
import pickle

import numpy as np
import pytest
import voxdag
from conftest import interrupted


def test_extract_a_level(path, dag, tmp_path):
    report = voxdag.extract(path, tmp_path / "coarse.vdag", level=4, memory="64MiB")
    with voxdag.open(tmp_path / "coarse.vdag") as coarse:
        assert coarse.resolution == 16
        assert np.array_equal(coarse.dense(), dag.dense(level=4))
        assert report["voxels"] == coarse.voxels


def test_extract_by_majority(path, dag, tmp_path):
    voxdag.extract(path, tmp_path / "coarse.vdag", level=4, majority=True)
    counts = dag.dense().reshape(16, 4, 16, 4, 16, 4).sum(axis=(1, 3, 5))
    with voxdag.open(tmp_path / "coarse.vdag") as coarse:
        assert np.array_equal(coarse.dense(), counts >= 32)


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


def test_facts_of_an_export_are_integers_where_they_count(path, tmp_path):
    facts = voxdag.export(path, tmp_path / "map.bt", to="bt", level=5)["facts"]
    assert isinstance(facts["nodes"], int) and facts["nodes"] > 0
    assert isinstance(facts["reader_memory_bytes"], int)
    assert len(facts["translation"]) == 3


def test_export_in_gray(mesh, tmp_path):
    colored = tmp_path / "colored.vdag"
    voxdag.build(mesh, resolution=64, output=colored, memory="64MiB", color=True)
    for gray in (False, True):
        voxdag.export(colored, tmp_path / "c.npz", to="npz", level=5, gray=gray, force=True)
        assert ("colors" in np.load(tmp_path / "c.npz")) == (not gray)


@pytest.mark.parametrize(
    "derive, code",
    [
        (lambda path, out: voxdag.extract(path, path, force=True), "invalid_input"),
        (lambda path, out: voxdag.extract(path, out, region=(70, 0, 0, 80, 9, 9)), "invalid_input"),
        (lambda path, out: voxdag.export(path, out, to="npz", up="x"), "invalid_input"),
        (lambda path, out: voxdag.export(path, out, to="npz", band=0), "invalid_input"),
        (lambda path, out: voxdag.export(path, out, to="npz", watertight=True), "invalid_input"),
        (lambda path, out: voxdag.extract(path, out, level=9), "invalid_input"),
        (lambda path, out: voxdag.extract(path, out, level=1), "invalid_input"),
        (lambda path, out: voxdag.extract(path, out, memory="8MiB"), "invalid_input"),
        (lambda path, out: voxdag.export(path, out, to="svdag", level=0), "invalid_input"),
        (lambda path, out: voxdag.export(path, out, to="bt", level=1), "invalid_input"),
        (lambda path, out: voxdag.extract(str(path) + "x", out), "not_found"),
        (lambda path, out: voxdag.export(path, out, to="obj"), "invalid_input"),
    ],
)
def test_refuses(path, tmp_path, derive, code):
    with pytest.raises(voxdag.Error) as refused:
        derive(path, tmp_path / "out")
    assert refused.value.code == code, refused.value
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "derive",
    [
        lambda path, out, **more: voxdag.extract(path, out, **more),
        lambda path, out, **more: voxdag.export(path, out, to="ply", **more),
    ],
)
def test_outputs(path, tmp_path, derive):
    """Outputs that cannot be written are refused before `progress` is called."""
    for output, code in [
        (tmp_path / "none" / "out", "not_found"),
        (tmp_path, "invalid_input"),
        ("", "invalid_input"),
        (path, "invalid_input"),
    ]:
        for force in (False, True):
            started = []
            with pytest.raises(voxdag.Error) as refused:
                derive(
                    path,
                    output,
                    force=force,
                    progress=lambda *_, started=started: started.append(1),
                )
            assert (refused.value.code, started) == (code, []), refused.value
    assert os.listdir(tmp_path) == []
    for _ in range(2):
        derive(path, tmp_path / "out", force=True)
    with pytest.raises(voxdag.Error, match="force"):
        derive(path, tmp_path / "out")


def test_names_of_any_bytes(path, mesh, tmp_path):
    """Paths need not be UTF-8, because Linux does not require it."""
    folder = os.fsencode(tmp_path)
    names = [os.path.join(folder, name) for name in (b"a\xff.vdag", b"b\xff.vdag", b"c\xff.npz")]
    voxdag.build(mesh, resolution=64, output=names[0], memory="64MiB")
    voxdag.extract(names[0], names[1], level=5)
    report = voxdag.export(names[1], os.fsdecode(names[2]), to="npz")
    assert report["files"] == [os.fsdecode(names[2])]
    with voxdag.open(names[1]) as coarse, voxdag.open(path) as dag:
        assert np.array_equal(coarse.dense(), dag.dense(level=5))
    with pytest.raises(voxdag.Error, match="exists") as refused:
        voxdag.extract(names[0], names[1])
    copy = pickle.loads(pickle.dumps(refused.value))
    assert isinstance(copy, voxdag.Error)
    assert (str(copy), copy.code) == (str(refused.value), "invalid_input")
    with pytest.raises(voxdag.Error, match="vdag") as missing:
        voxdag.open(names[0] + b"x")
    assert missing.value.code == "not_found"


def test_ctrl_c(mesh, tmp_path):
    """An interrupted export stops and leaves no files."""
    fine, output = tmp_path / "fine.vdag", tmp_path / "fine.npz"
    voxdag.build(mesh, resolution=1024, output=fine, memory="64MiB")
    interrupted(f"voxdag.export({str(fine)!r}, {str(output)!r}, to='npz', level=10, progress=say)")
    assert not [name for name in os.listdir(tmp_path) if name.startswith("fine.npz")]


def test_threads(path, dag, tmp_path):
    calls = [
        lambda n: voxdag.extract(path, tmp_path / "x.vdag", threads=n),
        lambda n: dag.lookup([[1, 2, 3]], threads=n),
        lambda n: dag.nearest([[1, 2, 3]], threads=n),
        lambda n: dag.rays([[1, 2, 3]], [[1, 0, 0]], threads=n),
        lambda n: dag.occluded([[1, 2, 3]], [[1, 0, 0]], threads=n),
    ]
    for call in calls:
        for threads in (-1, 1 << 40):
            with pytest.raises(voxdag.Error, match="threads"):
                call(threads)
        call(np.int64(2))


def test_nothing_is_overwritten(path, tmp_path):
    output = tmp_path / "notes.txt"
    output.write_text("mine")
    with pytest.raises(voxdag.Error, match="force"):
        voxdag.extract(path, output)
    assert output.read_text() == "mine"
