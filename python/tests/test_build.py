"""Builds from Python: their reports, options, errors and progress, and how they are stopped."""

import hashlib
import os
import resource
import shutil
import signal

import numpy as np
import pytest
import voxdag
from conftest import interrupted, torus
from voxdag._options import BuildOptions


def test_report_and_progress(mesh, tmp_path):
    seen = []
    report = voxdag.build(
        mesh,
        resolution=256,
        output=tmp_path / "a.vdag",
        threads=2,
        progress=lambda *status: seen.append(status),
    )
    data = (tmp_path / "a.vdag").read_bytes()
    assert report["sha256"] == hashlib.sha256(data).hexdigest()
    assert report["triangles"] == len(mesh[1])
    assert sorted(os.listdir(tmp_path)) == ["a.vdag", "a.vdag.report.json"]
    assert seen and all(len(status) == 4 and isinstance(status[1], int) for status in seen)


def test_the_same_bytes_from_floats_lists_and_integers(mesh, tmp_path):
    whole = np.round(mesh[0] * 16)
    digests = {
        voxdag.build(scene, resolution=64, output=tmp_path / f"{i}.vdag")["sha256"]
        for i, scene in enumerate(
            [
                (whole, mesh[1]),
                (whole.astype(np.float32), mesh[1].astype(np.uint16)),
                (whole.astype(np.int32), mesh[1][:, :]),
                (whole.tolist(), mesh[1].tolist()),
                (np.asfortranarray(whole), mesh[1].astype(np.uint64)),
            ]
        )
    }
    assert len(digests) == 1


def test_doubles_stay_doubles(tmp_path):
    # As float32, these x coordinates would be equal. As doubles they differ, so both have voxels.
    vertices = np.array([[1e9, 0, 0], [1e9 + 1, 0, 0], [1e9, 1, 0]])
    voxdag.build((vertices, [[0, 1, 2]]), resolution=16, output=tmp_path / "far.vdag")
    with voxdag.open(tmp_path / "far.vdag") as dag:
        assert dag.count() > 100
        assert dag.voxel_size == pytest.approx(1 / 16, rel=1e-3)


def test_bounds(mesh, tmp_path):
    voxdag.build(mesh, resolution=32, output=tmp_path / "part.vdag", bounds=(0, 0, 0, 4))
    with voxdag.open(tmp_path / "part.vdag") as dag:
        assert np.array_equal(dag.bounds, [[0, 0, 0], [4, 4, 4]])


def test_plan(mesh):
    estimate = voxdag.plan(mesh, resolution=1024)
    assert estimate["voxels"]["low"] <= estimate["voxels"]["likely"] <= estimate["voxels"]["high"]


def test_every_option_is_a_typed_and_documented_keyword(mesh):
    names = list(BuildOptions.__annotations__)
    assert {"hash_bits", "color", "memory", "work", "cache_size"} <= set(names)
    voxdag.plan(mesh, resolution=64, **dict.fromkeys(names))
    for function in voxdag.build, voxdag.plan:
        assert all(f"\n    {name} " in function.__doc__ for name in names)


@pytest.mark.parametrize(
    "scene, options, code, text",
    [
        ("nowhere.glb", {}, "not_found", "nowhere.glb"),
        (([[0, 0, 0]], [[0, 0, 1]]), {}, "invalid_input", "triangles[0]"),
        (([[0, 0, 0]], [[0, 0, 0.5]]), {}, "invalid_input", "integers"),
        (([[0, 0]], [[0, 0, 0]]), {}, "invalid_input", "(N, 3)"),
        (([[0, 0, 0]], [[0, 0, 0]]), {"resolution": 100}, "invalid_input", "100"),
        (([[0, 0, 0]], [[0, 0, 0]]), {"palette": True}, "invalid_input", "palette"),
        (([[0, 0, 0]], [[0, 0, 0]]), {"threads": "many"}, "invalid_input", "threads"),
        (([[0, 0, 0]], [[0, 0, 0]]), {"threads": -1}, "invalid_input", "threads=-1"),
        (([[0, 0, 0]], [[0, 0, 0]]), {"resolution": -4}, "invalid_input", "resolution=-4"),
        (([[0, 0, 0]], [[0, 0, 0]]), {"memory": "1MiB"}, "invalid_input", "memory"),
        (([[0, 0, 0]], [[0, 0, 0]]), {"hash_bits": 3}, "invalid_input", "from 4 to 64"),
        (([[0, 0, 0]], [[0, 0, 0]]), {"backend": "gpu"}, "invalid_input", "auto, cpu, cuda"),
        (([[0, 0, 0]], [[0, 0, 0]]), {"attributes": ["normals"]}, "invalid_input", "alpha"),
        (([[np.nan, 0, 0]], [[0, 0, 0]]), {}, "invalid_input", "finite"),
    ],
)
def test_refuses(tmp_path, scene, options, code, text):
    with pytest.raises(voxdag.Error) as refused:
        voxdag.build(scene, **{"resolution": 64, "output": tmp_path / "x.vdag", **options})
    assert refused.value.code == code, refused.value
    assert text in str(refused.value)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "argument",
    [{"output": 7}, {"resolution": 64.0}, {"resolution": "64"}, {"progress": 5}, {"work": 1.5}],
)
def test_types_that_cannot_be_meant(tmp_path, mesh, argument):
    with pytest.raises(TypeError):
        voxdag.build(mesh, **{"resolution": 64, "output": tmp_path / "x.vdag", **argument})
    with pytest.raises(TypeError):
        voxdag.open(7)
    assert os.listdir(tmp_path) == []


def test_paths_of_bytes(tmp_path, mesh):
    output = os.fsencode(tmp_path / "x.vdag")
    voxdag.build(mesh, resolution=64, output=output, work=os.fsencode(tmp_path / "work"))
    with voxdag.open(output) as dag:
        assert dag.path == os.fsdecode(output)
    with pytest.raises(voxdag.Error, match=r"nowhere\.glb"):
        voxdag.build([b"nowhere.glb", b"there.glb"], resolution=64, output=output, force=True)


def test_keeps_results_of_other_scenes(tmp_path, mesh, path):
    """As on the command line, only force=True replaces a file that is not an earlier result of the
    same scene."""
    output = tmp_path / "x.vdag"
    shutil.copy(path, output)
    before = output.read_bytes()
    with pytest.raises(voxdag.Error, match="no report shows that mesh in memory is its scene"):
        voxdag.build(mesh, resolution=32, output=output)
    with pytest.raises(voxdag.Error, match="force replaces it"):
        voxdag.from_voxels([(1, 2, 3)], output=output)
    assert output.read_bytes() == before
    voxdag.build(mesh, resolution=32, output=output, force=True)
    voxdag.build(mesh, resolution=64, output=output)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(voxdag.Error, match="is the result of another scene, mesh in memory"):
        voxdag.build(tmp_path / "a.obj", resolution=32, output=output)


def test_a_mesh_needs_no_file(tmp_path, mesh):
    found = set()
    output = tmp_path / "x.vdag"
    report = voxdag.build(
        mesh, resolution=1024, output=output, progress=lambda *_: found.update(tmp_path.rglob("*"))
    )
    assert not [path for path in found if path.suffix == ".ply"]
    as_floats = (mesh[0].astype(np.float32), mesh[1].astype(">i8"))
    as_doubles = (as_floats[0].astype(">f8"), mesh[1])
    first, second = (
        voxdag.build(scene, resolution=1024, output=tmp_path / name, keep_work=True)["sha256"]
        for scene, name in ((as_floats, "floats.vdag"), (as_doubles, "doubles.vdag"))
    )
    assert first == second
    assert report["triangles"] == len(mesh[1])


def test_output_that_cannot_be_written(tmp_path, mesh):
    with pytest.raises(voxdag.Error) as refused:
        voxdag.build(mesh, resolution=64, output=tmp_path / ("n" * 250 + ".vdag"))
    assert refused.value.code == "invalid_input"
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 12, limit[1]))
    try:
        with pytest.raises(voxdag.Error) as refused:
            voxdag.build(mesh, resolution=64, output=tmp_path / "x.vdag")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, before)
    assert refused.value.code == "no_space"
    assert not (tmp_path / "x.vdag").exists()


def test_a_folder_that_is_not_there_is_made(tmp_path, mesh):
    voxdag.plan(mesh, resolution=64, output=tmp_path / "new" / "x.vdag")
    assert not (tmp_path / "new").exists()
    voxdag.build(mesh, resolution=64, output=tmp_path / "new" / "x.vdag")
    assert not list((tmp_path / "new").glob("*.ply"))


def test_what_progress_raises_ends_the_build(mesh, tmp_path):
    def stop(*_):
        raise ZeroDivisionError("enough")

    with pytest.raises(ZeroDivisionError, match="enough"):
        voxdag.build(mesh, resolution=16384, output=tmp_path / "x.vdag", progress=stop)
    assert not (tmp_path / "x.vdag").exists()


def test_ctrl_c(tmp_path):
    """Ctrl-C stops a build, and the same call resumes it and gives the same file."""
    interrupted(f"""
        from conftest import torus
        output = {str(tmp_path / "x.vdag")!r}
        voxdag.build(torus(400, 200), resolution=16384, output=output, threads=1, progress=say)
    """)
    assert not (tmp_path / "x.vdag").exists()
    scene = torus(400, 200)
    resumed = voxdag.build(scene, resolution=16384, output=tmp_path / "x.vdag")
    whole = voxdag.build(scene, resolution=16384, output=tmp_path / "whole.vdag")
    assert resumed["sha256"] == whole["sha256"]
    assert not [name for name in os.listdir(tmp_path) if name.endswith(".ply")]


def test_a_voxel_size_alone_chooses_the_resolution(tmp_path):
    mesh = ([[0, 0, 0], [3, 0, 0], [0, 3, 1]], [[0, 1, 2]])
    report = voxdag.build(mesh, voxel_size=0.25, output=tmp_path / "a.vdag")
    assert report["resolution"] == 16 and report["bounds"]["edge"] == 4
    same = voxdag.build(mesh, resolution=16, voxel_size=0.25, output=tmp_path / "b.vdag")
    assert same["sha256"] == report["sha256"]
    assert voxdag.plan(mesh, voxel_size=0.25)["triangles"] == 1
    with pytest.raises(voxdag.Error, match="expected a resolution, or a voxel_size"):
        voxdag.build(mesh, output=tmp_path / "c.vdag")
