"""Points and regions in the units of the scene."""

import numpy as np
import pytest
import voxdag


@pytest.fixture(scope="module")
def fine(tmp_path_factory):
    """A few voxels in a grid of 131072^3. The grid's corner and edge are not round numbers, so that
    positions in world space have rounding errors."""
    output = tmp_path_factory.mktemp("fine") / "fine.vdag"
    corners = np.array([[0.01, 0.02, 0.03], [0.05, 0.02, 0.09], [0.02, 0.07, 0.03]])
    voxdag.build(
        (corners, np.array([[0, 1, 2]])),
        resolution=131072,
        output=output,
        memory="64MiB",
        bounds=(-1920.9469616, -126.4427185, -1861.3, 3720.9632874),
    )
    with voxdag.open(output) as dag:
        yield dag


def test_corners_of_voxels(fine):
    """A voxel contains its low corner in world space, and a region between two such corners has no
    additional layer of voxels."""
    voxels = np.random.default_rng(7).integers(0, 131072, (20000, 3))
    assert np.array_equal(fine.to_voxel(fine.to_world(voxels)), voxels)
    assert np.array_equal(fine.to_voxel(fine.to_world(voxels + 0.5)), voxels)
    for low in voxels[:200]:
        box = np.concatenate([fine.to_world(low), fine.to_world(low + (3, 1, 2))])
        assert fine.dense(box, world=True).shape == (3, 1, 2)
    cells = fine.points()
    assert np.array_equal(fine.lookup(fine.to_world(cells), world=True), np.ones(len(cells), bool))


def test_shapes(fine):
    points = fine.to_world(np.arange(24).reshape(2, 4, 3))
    assert np.array_equal(fine.to_voxel(points), np.arange(24).reshape(2, 4, 3))
    assert np.array_equal(fine.to_voxel(points[0, 0]), [0, 1, 2])
    with pytest.raises(voxdag.Error, match="expected"):
        fine.to_voxel([1.0, 2.0])


def test_regions_without_end(path, dag, tmp_path):
    """A region with an infinite coordinate ends at the border of the grid."""
    inf = np.inf
    everything = (-inf, -inf, -inf, inf, inf, inf)
    assert dag.count(everything, world=True) == dag.voxels
    assert dag.dense(everything, world=True).shape == (64, 64, 64)
    middle = dag.to_world((32, 32, 32))
    half = (-inf, -inf, -inf, middle[0], inf, inf)
    assert dag.count(half, world=True) == dag.count((0, 0, 0, 32, 64, 64))
    report = voxdag.extract(path, tmp_path / "half.vdag", region=half, world=True)
    assert report["voxels"] == dag.count(half, world=True)
    for wrong in (np.nan, "a"):
        with pytest.raises((voxdag.Error, ValueError)):
            dag.count((0, 0, 0, wrong, 1, 1), world=True)
