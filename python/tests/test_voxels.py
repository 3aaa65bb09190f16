"""DAGs of points, voxels and dense arrays."""

import gc
import os

import numpy as np
import pytest
import voxdag


def test_dense_arrays():
    array = np.random.default_rng(3).random((9, 17, 5)) < 0.3
    dag = voxdag.from_dense(array)
    assert (dag.resolution, dag.voxel_size) == (32, 1)
    expected = np.zeros((32, 32, 32), bool)
    expected[:9, :17, :5] = array
    assert np.array_equal(dag.dense(), expected)
    again = voxdag.from_dense(np.asarray(dag), memory="64MiB", threads=1)
    assert again == dag and again.path != dag.path


def test_voxels_and_their_colors():
    random = np.random.default_rng(4)
    voxels = np.unique(random.integers(0, 1000, (500, 3)), axis=0)
    colors = random.integers(0, 256, (len(voxels), 3)).astype(np.uint8)
    dag = voxdag.from_voxels(voxels, colors, voxel_size=0.1, origin=(-7, 0.3, 1e3))
    assert dag.resolution == 1024 and dag.voxels == len(voxels)
    assert dag.lookup(voxels).all()
    assert np.abs(dag.colors(voxels).astype(int) - colors).max() < 16  # the file's colors are lossy
    assert np.allclose(dag.bounds[0], (-7, 0.3, 1e3)) and dag.voxel_size == pytest.approx(0.1)


def test_every_voxel_of_a_fine_grid_is_exact():
    """The corners of the grid, and voxels next to a boundary between subvolumes."""
    edge = 1 << 20
    numbers = [0, 1, 63, 64, edge // 2 - 1, edge // 2, edge - 1]
    voxels = np.stack(np.meshgrid(*[numbers] * 3), axis=-1).reshape(-1, 3)
    dag = voxdag.from_voxels(voxels, voxel_size=1 / 3, origin=(1e3, -1e5, 0.1))
    assert dag.resolution == edge
    assert {tuple(v) for v in dag.points().tolist()} == {tuple(v) for v in voxels.tolist()}


def test_points():
    points = np.random.default_rng(5).normal(0, 3, (1000, 3))
    dag = voxdag.from_points(points, 0.25)
    expected = np.unique(np.floor(points / 0.25).astype(int), axis=0)
    low = np.rint(dag.bounds[0] / 0.25).astype(int)
    assert np.array_equal(low, expected.min(axis=0))
    found = dag.points() + low
    assert {tuple(v) for v in found.tolist()} == {tuple(v) for v in expected.tolist()}
    assert dag.voxel_size == 0.25
    with pytest.raises(voxdag.Error, match=r"points\[\d+\] is .* in the voxel"):
        voxdag.from_points(points, 0.25, origin=(0, 0, 0))
    mixed = voxdag.from_points([[0, 0, 0], [0.5, 0.5, 0.5]], 1, [[255, 0, 0], [255, 0, 0]])
    assert mixed.colors([[0, 0, 0]]).tolist() == [[255, 0, 0]]
    white_and_black = voxdag.from_points([[0, 0, 0], [0.5, 0.5, 0.5]], 1, [[1.0] * 3, [0.0] * 3])
    assert white_and_black.colors([[0, 0, 0]]).tolist() == [[188] * 3]  # the mean in linear light


def test_grids_far_from_zero():
    """Voxels far from 0 are right or refused, and never lost."""
    dense = np.ones((4, 2, 3), bool)
    assert voxdag.from_dense(dense, origin=(1.5e14, -1e14, 0)).voxels == dense.sum()
    far = (0, 0, -3e14)
    with pytest.raises(voxdag.Error, match="too imprecise there"):
        voxdag.from_dense(dense, origin=far)
    with pytest.raises(voxdag.Error, match="too imprecise there"):
        voxdag.from_points(np.argwhere(dense) + np.array(far), 1)


def test_nothing():
    for dag in (
        voxdag.from_dense(np.zeros((4, 4, 4))),
        voxdag.from_voxels([]),
        voxdag.from_points(np.empty((0, 3)), 1, np.empty((0, 3))),
    ):
        assert (dag.voxels, dag.resolution) == (0, 4)
        assert list(dag) == [] and not dag.dense().any()


def test_files(tmp_path):
    dag = voxdag.from_voxels([[1, 2, 3]], output=tmp_path / "a.vdag")
    dag.close()
    with voxdag.open(tmp_path / "a.vdag") as again:
        assert list(again) == [(1, 2, 3)]
    temporary = voxdag.from_voxels([[1, 2, 3]])
    folder = os.path.dirname(temporary.path)
    assert temporary == again and os.path.exists(folder)
    del temporary
    gc.collect()
    assert not os.path.exists(folder)
    with voxdag.from_voxels([[1, 2, 3]]) as dag:
        folder = os.path.dirname(dag.path)
    assert not os.path.exists(folder)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: voxdag.from_voxels([[-1, 0, 0]]), r"voxels\[0\] is \[-1, 0, 0\]"),
        (lambda: voxdag.from_voxels([[0, 1 << 20, 0]]), r"expected 0 to 1048575"),
        (lambda: voxdag.from_voxels([[0.5, 0, 0]]), "integers"),
        (lambda: voxdag.from_voxels([[9, 0, 0]], resolution=8), "at least 16"),
        (lambda: voxdag.from_voxels([[9, 0, 0]], resolution=17), "17"),
        (lambda: voxdag.from_voxels([[9, 0, 0]], [[0, 0]]), "colors is an array"),
        (lambda: voxdag.from_voxels([[9, 0, 0]], voxel_size=0), "voxel_size=0"),
        (lambda: voxdag.from_dense(np.zeros((2, 2))), r"the shape \(2, 2\)"),
        (lambda: voxdag.from_dense(np.zeros((2, 2, 2)), np.zeros(3)), "the colors are"),
        (lambda: voxdag.from_points([[0, 0, np.nan]], 1), r"points\[0\] is not finite"),
        (lambda: voxdag.from_points([[0, 0]], 1), r"expected \(N, 3\)"),
        (lambda: voxdag.from_points([[0, 0, 0]], -1), "voxel_size=-1"),
    ],
)
def test_refuses(make, message):
    with pytest.raises(ValueError, match=message) as refused:
        make()
    assert refused.value.code == "invalid_input"
