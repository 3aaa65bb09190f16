"""Compares all queries of a file with an array of all its voxels."""

import threading

import numpy as np
import pytest
import voxdag


def coarse(cells, level):
    edge = 64 >> level
    n = 1 << level
    return cells.reshape(n, edge, n, edge, n, edge).any(axis=(1, 3, 5))


def morton(points):
    keys = np.zeros(len(points), np.int64)
    for bit in range(20):
        for axis in range(3):
            keys |= (points[:, axis] >> bit & 1) << (3 * bit + 2 - axis)
    return keys


def test_facts(dag, cells, mesh):
    assert dag.resolution == 64
    assert dag.voxels == cells.sum() > 1000
    assert [level["level"] for level in dag.levels] == [0, 1, 2, 3, 4]
    assert dag.levels[0]["nodes"] == 1
    low, high = dag.bounds
    assert np.all(low < mesh[0].min(axis=0)) and np.all(high > mesh[0].max(axis=0))
    assert dag.voxel_size == pytest.approx((high - low)[0] / 64)
    assert "64^3" in repr(dag)


def test_the_voxels_are_those_of_the_mesh(dag, cells, mesh):
    assert dag.lookup(mesh[0], world=True).all()
    centers = dag.to_world(np.argwhere(cells) + 0.5)
    ring = np.hypot(np.hypot(centers[:, 0], centers[:, 1]) - 3, centers[:, 2])
    assert np.all(np.abs(ring - 1.25) < 2 * dag.voxel_size)


@pytest.mark.parametrize("level", [0, 1, 3, 5, 6])
def test_levels(dag, cells, level):
    expected = coarse(cells, level)
    assert np.array_equal(dag.dense(level=level), expected)
    assert dag.count(level=level) == expected.sum()
    points = dag.points(level=level)
    assert set(map(tuple, points)) == set(map(tuple, np.argwhere(expected)))
    assert np.all(np.diff(morton(points)) > 0)
    assert dag.lookup(points, level).all()


@pytest.mark.parametrize(
    "region",
    [
        (10, 3, 20, 41, 64, 50),
        (-5, -5, -5, 9, 70, 70),
        (0, 0, 0, 1, 1, 1),
        (7, 7, 7, 7, 9, 9),
        (64, 0, 0, 80, 64, 64),
    ],
)
def test_regions(dag, cells, region):
    low, high = np.array(region).reshape(2, 3)
    expected = np.zeros(np.maximum(0, high - low), bool)
    inner_low, inner_high = np.clip(low, 0, 64), np.clip(high, 0, 64)
    expected[tuple(slice(a - c, b - c) for a, b, c in zip(inner_low, inner_high, low))] = cells[
        tuple(slice(a, b) for a, b in zip(inner_low, inner_high))
    ]
    assert np.array_equal(dag.dense(region), expected)
    assert dag.count(region) == expected.sum()
    assert set(map(tuple, dag.points(region))) == set(map(tuple, np.argwhere(expected) + low))


def test_world_regions(dag, cells):
    low, high = dag.bounds
    assert dag.count((*low, *high), world=True) == cells.sum()
    centers = dag.points(world=True)
    assert np.array_equal(dag.to_voxel(centers), dag.points())


def test_points_outside_are_not_set(dag):
    assert not dag.lookup([[-1, 0, 0], [64, 0, 0], [2**62, -(2**62), 0]]).any()


def test_rays_along_an_axis(dag, cells):
    y, z = np.meshgrid(np.arange(64), np.arange(64), indexing="ij")
    origins = np.stack([np.full(y.size, -10.0), y.ravel() + 0.5, z.ravel() + 0.5], axis=1)
    hits = dag.rays(origins, [[2.0, 0, 0]], threads=2)
    for i in range(len(origins)):
        column = np.flatnonzero(cells[:, y.flat[i], z.flat[i]])
        if len(column) == 0:
            assert not hits.hit[i] and (hits.voxel[i] == -1).all()
            continue
        assert hits.distance[i] == pytest.approx(column[0] + 10)
        assert tuple(hits.voxel[i]) == (column[0], y.flat[i], z.flat[i])
        assert tuple(hits.normal[i]) == (-1, 0, 0)
    near = dag.rays(origins, [[2.0, 0, 0]], max_distance=25.5)
    assert np.array_equal(near.hit, hits.distance <= 25.5)
    occluded = dag.occluded(origins, [[2.0, 0, 0]], threads=2)
    assert occluded.dtype == bool and np.array_equal(occluded, hits.hit)
    assert np.array_equal(dag.occluded(origins, [2.0, 0, 0], max_distance=25.5), near.hit)


def test_rays_in_the_scene(dag):
    hits = dag.rays([[0, -100, 0]], [[0, 1, 0]], world=True)
    assert hits.distance[0] == pytest.approx(100 - 4.25, abs=dag.voxel_size)
    assert tuple(hits.normal[0]) == (0, -1, 0)
    distance = hits.distance[0]
    for limit in (0.99 * distance, 1.01 * distance):
        occluded = dag.occluded([[0, -100, 0]], [[0, 1, 0]], limit, world=True)
        assert occluded.tolist() == [limit > distance]


def test_a_ray_from_inside(dag, cells):
    voxel = np.argwhere(cells)[0]
    hits = dag.rays(voxel + 0.5, [1, 1, 1])
    assert hits.distance[0] == 0 and tuple(hits.voxel[0]) == tuple(voxel)
    assert tuple(hits.normal[0]) == (0, 0, 0)


def test_nearest(dag, cells):
    points = np.random.default_rng(1).integers(-20, 84, (200, 3))
    voxels, distances = dag.nearest(points)
    all_set = dag.points()
    for point, voxel, distance in zip(points, voxels, distances):
        squares = ((all_set - point) ** 2).sum(axis=1)
        assert distance == pytest.approx(np.sqrt(squares.min()))
        assert tuple(voxel) == tuple(all_set[squares.argmin()])  # the first in Morton order


def test_nearest_at_the_distance_that_it_returns(dag):
    _, distances = dag.nearest([[-7, -9, -11], [31, 32, 33]])
    for point, distance in zip([[-7, -9, -11], [31, 32, 33]], distances):
        assert dag.nearest([point], distance)[1][0] == distance
        assert np.isinf(dag.nearest([point], np.nextafter(distance, 0))[1][0])


def test_no_rays(dag):
    assert len(dag.rays([[0, 0, 0]], np.empty((0, 3))).distance) == 0
    assert dag.occluded([[0, 0, 0]], np.empty((0, 3))).shape == (0,)


def test_threads(dag, cells):
    wrong = []

    def ask():
        for _ in range(20):
            if dag.count() != cells.sum() or not np.array_equal(
                dag.dense(level=4), coarse(cells, 4)
            ):
                wrong.append(1)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


@pytest.mark.parametrize(
    "ask, code",
    [
        (lambda dag: dag.lookup([[0.5, 0, 0]]), "invalid_input"),
        (lambda dag: dag.lookup([[0, 0]]), "invalid_input"),
        (lambda dag: dag.lookup([[np.nan, 0, 0]], world=True), "invalid_input"),
        (lambda dag: dag.rays([[0, 0, 0]], [[0, 0, 0]]), "invalid_input"),
        (lambda dag: dag.rays([[0, 0, 0]], [[np.nan, 0, 1]]), "invalid_input"),
        (lambda dag: dag.occluded([[0, 0, 0]], [[0, 0, 0]]), "invalid_input"),
        (lambda dag: dag.occluded([[0, 0, 0]], [[1, 0, 0]], -1), "invalid_input"),
        (lambda dag: dag.rays([[0, 0, 0]] * 2, [[1, 0, 0]] * 3), "invalid_input"),
        (lambda dag: dag.count(level=7), "invalid_input"),
        (lambda dag: dag.count((0, 0, 0, 1)), "invalid_input"),
        (lambda dag: dag.count((5, 0, 0, 1, 9, 9)), "invalid_input"),
        (lambda dag: dag.count((0.5, 0, 0, 1, 9, 9)), "invalid_input"),
        (lambda dag: dag.nearest(np.array([[2**64 - 1, 0, 0]], np.uint64)), "invalid_input"),
        (lambda dag: dag.rays(np.array([[1j, 0, 0]]), [[1, 0, 0]]), "invalid_input"),
        (lambda dag: dag.points(attributes="color"), "invalid_input"),
        (lambda dag: voxdag.open(dag.path + "\0"), "invalid_input"),
        (lambda dag: voxdag.open("\ud800.vdag"), "invalid_input"),
        (lambda dag: voxdag.render(dag.path, view="below"), "invalid_input"),
    ],
)
def test_refuses(dag, ask, code):
    with pytest.raises(voxdag.Error) as refused:
        ask(dag)
    assert refused.value.code == code


def test_files_that_are_none(tmp_path):
    with pytest.raises(voxdag.Error) as refused:
        voxdag.open(tmp_path / "nothing.vdag")
    assert refused.value.code == "not_found" and "nothing.vdag" in str(refused.value)
    (tmp_path / "text.vdag").write_text("hello")
    with pytest.raises(voxdag.Error) as refused:
        voxdag.open(tmp_path / "text.vdag")
    assert refused.value.code == "corrupt"


def test_a_closed_file(path):
    dag = voxdag.open(path)
    dag.close()
    with pytest.raises(voxdag.Error):
        dag.count()
    assert "closed" in repr(dag)
