"""Scenes in memory: meshes with colors and textures, objects of other libraries, and messages."""

import io
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import voxdag
from conftest import torus

# Two triangles side by side: x from 0 to 4 and from 4 to 8, each a half of a square.
VERTICES = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [4, 0, 1], [8, 0, 1], [4, 4, 1]], float)
TRIANGLES = np.array([[0, 1, 2], [3, 4, 5]])
RED, BLUE = (255, 0, 0), (0, 0, 255)


@pytest.fixture()
def colors_of(tmp_path):
    """Builds a scene, and returns the colors of a voxel in each of the two triangles."""

    def colors(scene, places=((0.5, 0.5, 0), (4.5, 0.5, 1))):
        output = tmp_path / "colored.vdag"
        bounds = (-1, -1, -1, 16)
        voxdag.build(scene, resolution=64, output=output, color=True, bounds=bounds, force=True)
        with voxdag.open(output) as dag:
            assert dag.lookup(places, world=True).all()
            return [tuple(color) for color in dag.colors(places, world=True).tolist()]

    return colors


def digest(scene, tmp_path, **options):
    output = tmp_path / "digest.vdag"
    return voxdag.build(scene, resolution=64, output=output, force=True, **options)["sha256"]


def test_colors_of_vertices_and_faces(colors_of):
    of_vertices = [RED] * 3 + [BLUE] * 3
    assert colors_of(voxdag.Mesh(VERTICES, TRIANGLES, colors=of_vertices)) == [RED, BLUE]
    floats = np.array(of_vertices, np.float32) / 255
    assert colors_of(voxdag.Mesh(VERTICES, TRIANGLES, colors=floats)) == [RED, BLUE]
    assert colors_of(voxdag.Mesh(VERTICES, TRIANGLES, face_colors=[RED, BLUE])) == [RED, BLUE]
    assert colors_of(voxdag.Mesh(VERTICES, TRIANGLES, colors=RED)) == [RED, RED]


def test_textures(colors_of):
    image = np.zeros((2, 2, 3), np.uint8)
    image[0] = RED  # the upper row, where v is 1
    image[1] = BLUE
    uv = [[0.5, 0.75]] * 3 + [[0.5, 0.25]] * 3
    of_vertices = voxdag.Mesh(VERTICES, TRIANGLES, uv=uv, texture=image)
    assert colors_of(of_vertices) == [RED, BLUE]
    shared = VERTICES[[0, 1, 2]], [[0, 1, 2]]
    corners = np.array(uv).reshape(2, 3, 2)
    assert colors_of(voxdag.Mesh(VERTICES, TRIANGLES, uv=corners, texture=image)) == [RED, BLUE]
    other = voxdag.Mesh(
        shared[0] + [4, 0, 1], shared[1], uv=[[0.5, 0.5]] * 3, texture=image[1:], material="blue"
    )
    first = voxdag.Mesh(*shared, uv=[[0.5, 0.5]] * 3, texture=image[:1], material="blue")
    assert colors_of([first, other]) == [RED, BLUE]


def test_names_of_textures_are_names_of_materials(tmp_path):
    image = np.full((2, 2, 4), 255, np.uint8)
    mesh = voxdag.Mesh(
        VERTICES, TRIANGLES, uv=np.zeros((6, 2)), texture=image, material='a/b: "c"', name="x/y"
    )
    voxdag.build(mesh, resolution=64, output=tmp_path / "a.vdag", attributes=["material"])
    with voxdag.open(tmp_path / "a.vdag") as dag:
        assert dag.material_names == ["a_b_ _c_", ""]


def test_meshes_files_and_arrays_are_one_scene(mesh, tmp_path):
    half = len(mesh[1]) // 2
    parts = [voxdag.Mesh(mesh[0], mesh[1][:half]), voxdag.Mesh(mesh[0], mesh[1][half:], name="b")]
    assert digest(parts, tmp_path) == digest(mesh, tmp_path)
    lines = "".join(f"v {x} {y} {z}\n" for x, y, z in mesh[0].tolist())
    lines += "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in mesh[1][:half].tolist())
    (tmp_path / "half.obj").write_text(lines)
    assert digest([tmp_path / "half.obj", parts[1]], tmp_path) == digest(mesh, tmp_path)
    tuples = [(mesh[0], mesh[1][:half]), (mesh[0], mesh[1][half:])]
    assert digest(tuples, tmp_path) == digest(mesh, tmp_path)
    assert digest([tuples[0], parts[1]], tmp_path) == digest(mesh, tmp_path)
    # A mesh without triangles adds nothing, unlike a mesh whose triangles are None (points).
    assert digest([mesh, (mesh[0] + 0.001, mesh[1][:0])], tmp_path) == digest(mesh, tmp_path)


def test_open_files(mesh, tmp_path):
    vertices, triangles = mesh
    lines = [f"v {x} {y} {z}\n" for x, y, z in vertices.tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles.tolist()]
    data = "".join(lines).encode()
    expected = digest(mesh, tmp_path)
    assert digest(io.BytesIO(data), tmp_path) == expected
    (tmp_path / "mesh.obj").write_bytes(data)
    with open(tmp_path / "mesh.obj", "rb") as file:
        assert digest([file, io.BytesIO(b"4.25 0 0\n")], tmp_path) == expected
    with pytest.raises(ValueError, match="file in memory 0"):
        digest(io.BytesIO(b"glTF"), tmp_path)
    with pytest.raises(TypeError, match="expected a file open in binary mode"):
        digest(io.StringIO("0 0 0"), tmp_path)


def test_objects_with_vertices_and_faces(mesh, tmp_path):
    expected = digest(mesh, tmp_path)
    vertices, triangles = mesh
    padded = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    polydata = SimpleNamespace(
        points=vertices, faces=padded, point_data={}, cell_data={}, n_cells=len(triangles)
    )
    meshio = SimpleNamespace(
        points=vertices, cells=[SimpleNamespace(type="triangle", data=triangles)], point_data={}
    )
    for scene in (
        SimpleNamespace(vertices=vertices, faces=triangles),
        SimpleNamespace(vertices=vertices.tolist(), triangles=triangles.tolist()),
        polydata,
        SimpleNamespace(points=vertices, extract_surface=lambda: polydata),
        meshio,
        [SimpleNamespace(vertices=vertices, faces=triangles)],
    ):
        assert digest(scene, tmp_path) == expected


def test_quads_and_polygons(colors_of, tmp_path):
    square = np.array([[0, 0, 0], [8, 0, 0], [8, 4, 0], [0, 4, 0]], float)
    expected = digest((square, [[0, 1, 2], [0, 2, 3]]), tmp_path)
    quad = SimpleNamespace(type="quad", data=[[0, 1, 2, 3]])
    line = SimpleNamespace(type="line", data=[[0, 1]])
    with pytest.warns(UserWarning, match="cells of the types line make no voxels") as warned:
        meshio = SimpleNamespace(points=square, cells=[quad, line], point_data={})
        assert digest(meshio, tmp_path) == expected
    assert warned[0].filename == __file__
    assert digest(SimpleNamespace(vertices=square, faces=[[0, 1, 2, 3]]), tmp_path) == expected
    polydata = SimpleNamespace(
        points=VERTICES,
        faces=np.array([3, 0, 1, 2, 3, 3, 4, 5]),
        point_data={},
        cell_data={"RGB": np.array([(9, 9, 9), RED, BLUE], np.uint8)},  # the first cell is a line
        n_cells=3,
    )
    assert colors_of(polydata) == [RED, BLUE]


def test_open3d_triangle_meshes(colors_of):
    """Open3D has an image for each material, which begins with the lower row."""
    image = np.zeros((2, 1, 3), np.uint8)
    image[0], image[1] = RED, BLUE
    mesh = SimpleNamespace(
        vertices=VERTICES,
        triangles=TRIANGLES,
        vertex_colors=np.empty((0, 3)),
        triangle_uvs=np.array([[0.5, 0.25]] * 3 + [[0.5, 0.75]] * 3),
        triangle_material_ids=np.array([0, 0]),
        textures=[image],
    )
    assert colors_of(mesh) == [RED, BLUE]
    mesh.textures, mesh.triangle_material_ids = [image[:1], image[1:]], np.array([1, 0])
    assert colors_of(mesh) == [BLUE, RED]
    mesh.textures, mesh.vertex_colors = [], np.array([RED] * 3 + [BLUE] * 3) / 255
    assert colors_of(mesh) == [RED, BLUE]


@pytest.mark.parametrize(
    "mesh, message",
    [
        (
            ([[0, 0, 0], [0, np.nan, 0]], [[0, 0, 1]]),
            r"vertices\[1\] is not finite.*triangles\[0\]",
        ),
        (([[np.inf, 0, 0]], np.empty((0, 3), int)), r"vertices\[0\] is not finite"),
        (([[0, 0, 0]], np.empty((0, 3), int)), "mesh in memory: has no triangles"),
        (SimpleNamespace(vertices=VERTICES, faces=TRIANGLES[:0]), "has no triangles"),
        (voxdag.Mesh([[0, 0, 0]], [[0, 0, 1]], name="a"), r"mesh 'a': triangles\[0\] is"),
        (voxdag.Mesh([[0, 0, 0]], [[0, 0, 0]], colors=[[2.0, 0, 0]]), r"colors\[0\] is \[2.0"),
        (voxdag.Mesh([[0, 0, 0]], [[0, 0, 0]], colors=[[1, 2]]), r"colors is an array \(1, 2\)"),
        (voxdag.Mesh([[0, 0, 0]], [[0, 0, 0]], uv=[[1]], texture=b"x"), r"uv is an array \(1, 1\)"),
        (voxdag.Mesh([[0, 0, 0]], [[0, 0, 0]], uv=[[0, 0]], texture=[[1.0]]), "the texture is an"),
        (voxdag.Mesh([[0, 0, 0]], [[0, 0, 0]], RED, RED), "not both"),
        (SimpleNamespace(points=[], cells=[], point_data={}), "cells of the types none"),
    ],
)
def test_refuses(tmp_path, mesh, message):
    with pytest.raises(ValueError, match=message):
        voxdag.build(mesh, resolution=64, output=tmp_path / "x.vdag", color=True)


def test_vertices_that_no_triangle_uses(mesh, tmp_path):
    surplus = np.concatenate([mesh[0], [[np.nan] * 3]])
    assert digest((surplus, mesh[1]), tmp_path) == digest(mesh, tmp_path)


def test_skip_invalid(mesh, tmp_path):
    bad = np.concatenate([mesh[1], [[0, 1, 99999], [-1, 0, 1]]])
    report = voxdag.build(
        (mesh[0], bad), resolution=64, output=tmp_path / "x.vdag", skip_invalid=True
    )
    assert report["dropped"]["invalid"] == 2
    assert report["sha256"] == digest(mesh, tmp_path)


def test_scenes_that_cannot_be_meant(tmp_path):
    for scene in (7, None, 1.5):
        with pytest.raises(TypeError, match="expected a path, a mesh"):
            voxdag.build(scene, resolution=64, output=tmp_path / "x.vdag")


def test_warnings_name_the_line_of_the_user(tmp_path):
    (tmp_path / "odd.ply").write_text(
        "ply\nformat ascii 1.0\nnonsense here\nelement vertex 3\nproperty float x\n"
        "property float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        voxdag.build(tmp_path / "odd.ply", resolution=64, output=tmp_path / "x.vdag")
    assert [w.filename for w in caught] == [__file__], [str(w.message) for w in caught]


def test_trimesh(colors_of, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    vertices, triangles = torus()
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert digest(mesh, tmp_path) == digest((vertices, triangles), tmp_path)
    mesh = trimesh.Trimesh(VERTICES, TRIANGLES, face_colors=[RED, BLUE], process=False)
    assert colors_of(mesh) == [RED, BLUE]
    mesh = trimesh.Trimesh(VERTICES, TRIANGLES, vertex_colors=[RED] * 3 + [BLUE] * 3, process=False)
    assert colors_of(mesh) == [RED, BLUE]
    image = np.zeros((2, 2, 3), np.uint8)
    image[0], image[1] = RED, BLUE
    from PIL import Image

    uv = [[0.5, 0.75]] * 3 + [[0.5, 0.25]] * 3
    for material in (
        trimesh.visual.material.SimpleMaterial(image=Image.fromarray(image)),
        trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(image)),
    ):
        visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
        mesh = trimesh.Trimesh(VERTICES, TRIANGLES, visual=visual, process=False)
        assert colors_of(mesh) == [RED, BLUE]
    scene = trimesh.Scene()
    half = trimesh.Trimesh(VERTICES[:3], [[0, 1, 2]], face_colors=[RED], process=False)
    scene.add_geometry(half, node_name="left")
    half = trimesh.Trimesh(VERTICES[:3], [[0, 1, 2]], face_colors=[BLUE], process=False)
    move = trimesh.transformations.translation_matrix([4, 0, 1])
    scene.add_geometry(half, node_name="right", transform=move)
    assert colors_of(scene) == [RED, BLUE]
    cloud = trimesh.PointCloud([(0.5, 0.5, 0), (4.5, 0.5, 1)], colors=[RED, BLUE])
    # The colors in a file are lossy.
    assert np.abs(np.subtract(colors_of(cloud), [RED, BLUE])).max() < 20
