"""A Dag as a path, an array, a set of voxels, a value, and a picture in a notebook."""

import copy
import multiprocessing
import os
import pickle
import shutil

import numpy as np
import pytest
import voxdag


def test_membership_and_iteration(dag, cells):
    voxels = list(dag)
    assert len(voxels) == len(dag) == dag.voxels
    assert voxels == [tuple(v) for v in dag.points().tolist()]
    assert voxels[0] in dag and np.array(voxels[-1]) in dag
    assert tuple(np.argwhere(~cells)[0]) not in dag and (-1, 0, 0) not in dag
    with pytest.raises(voxdag.Error, match="a voxel x, y, z"):
        _ = [[1, 2, 3], [4, 5, 6]] in dag


@pytest.mark.parametrize(
    "key",
    [
        np.s_[3, 4, 5],
        np.s_[32, -1, -64],
        np.s_[10:20, :, 32],
        np.s_[5],
        np.s_[..., 32],
        np.s_[32, ..., 8:],
        np.s_[:],
        np.s_[::2, 40:3:-3, ::-1],
        np.s_[60:100, 5:5, -10:],
        np.s_[20:10, 1:2, np.int64(32)],
    ],
)
def test_indexing(dag, cells, key):
    found, expected = dag[key], cells[key]
    assert np.array_equal(found, expected) and np.shape(found) == np.shape(expected)
    assert isinstance(found, (bool, np.ndarray))


def test_wrong_indexes(dag):
    for key in ((64, 0, 0), (0, -65, 0), (0, 0, 0, 0), (..., ...)):
        with pytest.raises(IndexError):
            dag[key]
    for key in (1.5, [1, 2, 3], None, "x"):
        with pytest.raises(TypeError):
            dag[key]


def test_arrays(dag, cells):
    assert np.array_equal(np.asarray(dag), cells)
    assert np.array_equal(np.array(dag, np.uint8), cells.astype(np.uint8))


def test_bricks(dag, cells):
    found = np.zeros_like(cells)
    corners = []
    for (x, y, z), brick in dag.bricks():
        assert brick.shape == (4, 4, 4) and brick.any()
        found[x : x + 4, y : y + 4, z : z + 4] = brick
        corners.append((x // 4, y // 4, z // 4))
    assert np.array_equal(found, cells)
    assert corners == [tuple(c) for c in dag.points(level=4).tolist()]


def test_iteration_crosses_blocks(tmp_path):
    voxels = [(0, 0, 0), (63, 64, 65), (200, 3, 255), (255, 255, 255)]
    dag = voxdag.from_voxels(voxels, resolution=256)
    assert sorted(dag) == sorted(voxels)
    assert sum(brick.sum() for _, brick in dag.bricks()) == 4
    assert [corner for corner, _ in voxdag.from_voxels([(3, 3, 3)]).bricks()] == [(0, 0, 0)]


def test_a_dag_is_a_path(dag, path, tmp_path):
    assert os.fspath(dag) == str(path)
    dag.extract(tmp_path / "part.vdag", level=4)
    with voxdag.open(tmp_path / "part.vdag") as part:
        assert part.resolution == 16
    for name in ("a.npz", "a.ply", "a.voxel.json"):
        report = dag.export(tmp_path / name, level=4)
        assert report["files"][0] == str(tmp_path / name)
    assert dag.export(tmp_path / "b.txt", to="ply", level=4)["voxels"] == dag.count(level=4)
    with pytest.raises(ValueError, match="expected a name that ends with one of"):
        dag.export(tmp_path / "c.txt")
    assert dag.render(size=(8, 6), samples=1).shape == (6, 8, 3)
    assert voxdag.render(dag, size=(8, 6), samples=1).shape == (6, 8, 3)


def _count(dag):
    return dag.count()


def test_pickle(dag, path, tmp_path):
    again = pickle.loads(pickle.dumps(dag))
    assert again == dag and again is not dag and hash(again) == hash(dag)
    assert copy.copy(dag) == dag and {dag, again} == {dag}
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(_count, [dag]) == [dag.voxels]


def test_equality(dag, path, tmp_path):
    shutil.copy(path, tmp_path / "copy.vdag")
    with voxdag.open(tmp_path / "copy.vdag") as same:
        assert same == dag and same != dag.path
        saved = pickle.dumps(same)
    other = voxdag.from_voxels([(1, 2, 3)], output=tmp_path / "copy.vdag", force=True)
    assert other != dag
    with pytest.raises(voxdag.Error, match="changed since the Dag was pickled"):
        pickle.loads(saved)


def test_notebook(dag, path):
    assert dag._repr_png_().startswith(b"\x89PNG")
    text = dag._repr_html_()
    assert "data:image/png;base64," in text and f"{dag.voxels:,}" in text
    closed = voxdag.open(path)
    closed.close()
    assert closed._repr_png_() is None and "closed" in closed._repr_html_()
