"""Colors, alpha, normals and materials of cells, from a mesh without materials."""

import numpy as np
import pytest
import voxdag


@pytest.fixture(scope="module")
def torus(mesh, tmp_path_factory):
    output = tmp_path_factory.mktemp("attributes") / "torus.vdag"
    voxdag.build(
        mesh,
        resolution=64,
        output=output,
        memory="64MiB",
        attributes=["color", "alpha", "normal", "material"],
    )
    with voxdag.open(output) as opened:
        yield opened


def test_values(torus):
    assert torus.attributes == ["color", "alpha", "normal", "material"]
    assert torus.material_names == [""]
    cells = torus.points()
    assert np.all(torus.colors(cells) == 255)
    assert np.all(torus.alphas(cells) == 255)
    assert np.all(torus.materials(cells) == 0)
    normals = torus.normals(cells)
    assert normals.shape == cells.shape and normals.dtype == np.float32
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    # The normals point away from `ring`, the nearest points on the center line of the tube, because
    # the triangles face outwards.
    positions = torus.to_world(cells + 0.5)
    across = positions[:, :2]
    ring = np.concatenate(
        [3 * across / np.linalg.norm(across, axis=1, keepdims=True), np.zeros((len(cells), 1))],
        axis=1,
    )
    outwards = positions - ring
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    assert np.sum(normals * outwards, axis=1).min() > 0.9


def test_cells_that_are_not_set(torus):
    nowhere = [[0, 0, 0], [-5, 3, 2], [64, 1, 1]]
    assert np.all(torus.colors(nowhere) == 0) and np.all(torus.normals(nowhere) == 0)
    assert np.all(torus.alphas(nowhere) == 0) and np.all(torus.materials(nowhere) == -1)


def test_points_with_attributes(torus):
    region = (0, 0, 0, 16, 32, 16)
    cells, values = torus.points(region, 5, attributes=["normal", "material"])
    assert np.array_equal(cells, torus.points(region, 5))
    assert sorted(values) == ["material", "normal"]
    assert np.array_equal(values["normal"], torus.normals(cells, 5))
    centers, values = torus.points(level=5, world=True, attributes=["normal"])
    assert np.array_equal(torus.normals(centers, 5, world=True), values["normal"])


def test_files_without(dag):
    assert dag.attributes == [] and dag.material_names == []
    with pytest.raises(voxdag.Error, match="has no 'normal'"):
        dag.normals([[1, 2, 3]])
    with pytest.raises(voxdag.Error, match="has no 'tint'"):
        dag.points(attributes=["tint"])


def test_names_are_checked(mesh, tmp_path):
    with pytest.raises(voxdag.Error, match=r"attributes=\['normals'\]: expected"):
        voxdag.build(mesh, resolution=64, output=tmp_path / "a.vdag", attributes=["normals"])
