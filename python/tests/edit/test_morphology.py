"""Dilation and erosion from Python, against numpy."""

import numpy as np
import pytest
import voxdag

EDGE = 32


def shifted(cells, axis, distance, outside):
    """Moves an array along an axis. `outside` is the value of cells from outside the array."""
    moved = np.full_like(cells, outside)
    to = [slice(None)] * 3
    source = [slice(None)] * 3
    to[axis] = slice(max(distance, 0), EDGE + min(distance, 0))
    source[axis] = slice(max(-distance, 0), EDGE + min(-distance, 0))
    if abs(distance) < EDGE:
        moved[tuple(to)] = cells[tuple(source)]
    return moved


def changed(cells, distance, combine, outside=False):
    for axis in range(3):
        moved = [shifted(cells, axis, d, outside) for d in range(-distance, distance + 1)]
        cells = combine.reduce(moved)
    return cells


@pytest.mark.filterwarnings("ignore:the result has no voxels")
@pytest.mark.parametrize("distance", [1, 2, 3, 5, 12, 100])
@pytest.mark.parametrize("share", [0.001, 0.03, 0.9, 0.999])
def test_equals_numpy(share, distance):
    cells = np.random.default_rng(distance).random((EDGE,) * 3) < share
    dag = voxdag.from_dense(cells)
    dilated = dag.dilate(distance)
    assert dilated == voxdag.from_dense(changed(cells, distance, np.logical_or))
    expected = changed(cells, distance, np.logical_and)
    eroded = dag.erode(distance, no_attributes=True)
    assert np.array_equal(eroded.dense(), expected)
    expected = changed(cells, distance, np.logical_and, True)
    assert np.array_equal(dag.erode(distance, outside_set=True).dense(), expected)


def test_torus(dag, cells, tmp_path):
    closed = dag.dilate(2).erode(
        2, tmp_path / "closed.vdag", outside_set=True, memory="64MiB", threads=1
    )
    assert closed.path == str(tmp_path / "closed.vdag")
    assert not (cells & ~closed.dense()).any()
    with pytest.raises(voxdag.Error, match="exists"):
        dag.erode(1, tmp_path / "closed.vdag")
    assert len(dag.erode(1, tmp_path / "closed.vdag", force=True)) < len(dag)


def test_any_node_order_and_after_other_edits(dag, tmp_path):
    dag.reorder(tmp_path / "other.vdag")
    other = voxdag.open(tmp_path / "other.vdag")
    assert other.dilate() == dag.dilate(np.int64(1))
    box = "box:0,0,0,32,64,64"
    assert dag.edit(cut=box, dilate=2) == dag.edit(cut=box).dilate(2)


def test_colors_are_those_of_the_nearest_voxel():
    voxels = [[3, 4, 5], [12, 4, 5]]
    colors = [[255, 0, 0], [0, 0, 255]]
    dag = voxdag.from_voxels(voxels, colors, resolution=16)
    dilated = dag.dilate(4)
    points = dilated.points()
    assert len(points) == 16 * 9 * 9  # x from 0 to 15, y from 0 to 8, z from 1 to 9
    nearest, _ = dag.nearest(points)
    expected = np.where(nearest[:, :1] == 3, colors[0], colors[1])
    assert np.allclose(dilated.colors(points), expected, atol=48)
    assert dag.dilate(4, no_attributes=True).attributes == []
    kept = dilated.erode(4, color_resolution=16)
    points = kept.points()
    assert points.tolist() == [[x, 4, 5] for x in range(4, 12)]
    assert np.allclose(kept.colors(points), dilated.colors(points), atol=48)


def test_all_attributes_are_those_of_the_nearest_voxel(mesh, tmp_path):
    attributes = ["alpha", "normal", "material"]
    voxdag.build(mesh, resolution=64, output=tmp_path / "a.vdag", attributes=attributes)
    dag = voxdag.open(tmp_path / "a.vdag")
    dilated = dag.dilate(3, memory="64MiB", threads=2)
    points = dilated.points()
    nearest, _ = dag.nearest(points)
    assert set(dilated.attributes) == set(dag.attributes) >= set(attributes)
    for name in ("alphas", "normals", "materials"):
        assert np.array_equal(getattr(dilated, name)(points), getattr(dag, name)(nearest)), name


@pytest.mark.parametrize("distance", [0, -1, 1 << 21, 1 << 70])
def test_refuses_distances(dag, distance):
    for change in (dag.dilate, dag.erode):
        with pytest.raises(voxdag.Error, match=f"voxels={distance}: expected 1 to 2"):
            change(distance)
    if distance != 0:
        with pytest.raises(voxdag.Error, match=f"erode={distance}: expected 0 to 2"):
            dag.edit(erode=distance)


def test_refuses(dag):
    for wrong in (1.5, "1", None, (1, 1, 1)):
        with pytest.raises(TypeError):
            dag.dilate(wrong)
    with pytest.raises(voxdag.Error, match="outside_set was given without an erosion"):
        dag.edit(dilate=1, outside_set=True)
    with pytest.raises(voxdag.Error, match="dilate and erode were both given"):
        dag.edit(dilate=1, erode=1)
    closed = voxdag.open(dag.path)
    closed.close()
    assert closed.dilate(1) == dag.dilate(1)
