"""Converts meshes of other libraries to Mesh. Recognizes these meshes by their attributes, so the
libraries do not need to be installed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol, Union

import numpy as np

from ._colors import srgb_of, tinted
from ._error import Error, warn
from ._mesh import Mesh


class HasVertices(Protocol):
    """A mesh of trimesh or Open3D, or another object with `vertices` and `faces` or `triangles`."""

    @property
    def vertices(self) -> Any: ...


class HasPoints(Protocol):
    """An object of PyVista or meshio, or a point cloud."""

    @property
    def points(self) -> Any: ...


class HasGeometry(Protocol):
    """A Scene of trimesh."""

    @property
    def geometry(self) -> Any: ...
    @property
    def graph(self) -> Any: ...


SceneObject = Union[Mesh, HasVertices, HasPoints, HasGeometry]


def is_mesh(scene: Any) -> bool:
    """True for a Mesh, and for the objects of other libraries that meshes_of() converts."""
    return isinstance(scene, Mesh) or any(
        has_attributes(scene) for has_attributes, _ in _CONVERSIONS
    )


def meshes_of(scene: Any) -> list[Mesh]:
    """Returns the meshes of an object for which is_mesh() is true: a Mesh, or an object of trimesh,
    Open3D, PyVista or meshio."""
    if isinstance(scene, Mesh):
        return [scene]
    convert = next(convert for has_attributes, convert in _CONVERSIONS if has_attributes(scene))
    meshes: list[Mesh] = convert(scene)
    return meshes


def _has(*names: str) -> Any:
    return lambda scene: all(hasattr(scene, name) for name in names)


def _of_trimesh_scene(scene: Any) -> list[Mesh]:
    meshes = []
    for node in sorted(scene.graph.nodes_geometry):
        matrix, name = scene.graph[node]
        for mesh in meshes_of(scene.geometry[name]):
            vertices = np.asarray(mesh.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
            parts = {**vars(mesh), "vertices": vertices, "name": str(node)}
            meshes.append(Mesh(**parts))
    return meshes


def _of_vertices(mesh: Any) -> list[Mesh]:
    """Converts an object with vertices and faces, or with vertices and triangles."""
    if hasattr(mesh, "entities"):  # paths of trimesh
        warn("lines make no voxels, and are left out")
        return []
    faces = getattr(mesh, "faces", None)
    triangles = _fans(mesh.triangles if faces is None else faces)
    if hasattr(mesh, "triangle_uvs") or hasattr(mesh, "triangle_material_ids"):
        return _of_open3d(mesh, triangles)
    return [Mesh(mesh.vertices, triangles, **_visuals_of(mesh))]


def _visuals_of(mesh: Any) -> dict[str, Any]:
    visual: Any = getattr(mesh, "visual", None)
    kind = getattr(visual, "kind", None)
    if kind == "vertex":
        return {"colors": visual.vertex_colors}
    if kind == "face":
        return {"face_colors": visual.face_colors}
    if kind == "texture":
        return _texture_of(visual)
    if visual is None:
        colors = {"colors": "vertex_colors", "face_colors": "face_colors"}
        found = {key: getattr(mesh, name, None) for key, name in colors.items()}
        return {key: value for key, value in found.items() if value is not None and len(value)}
    return {}


def _texture_of(visual: Any) -> dict[str, Any]:
    """Returns the texture, or the single color, of a material of trimesh."""
    material = visual.material
    image = getattr(material, "baseColorTexture", None)
    factor = getattr(material, "baseColorFactor", None)  # in linear light; trimesh uses 0 to 255
    if factor is not None:
        factor = np.asarray(factor, np.float64) / 255
    if image is None:
        image = getattr(material, "image", None)
    if image is not None and visual.uv is not None:
        if factor is not None:
            image = tinted(np.asarray(image.convert("RGBA")), factor)
        name = getattr(material, "name", None) or "texture"
        return {"uv": visual.uv, "texture": image, "material": name}
    if factor is not None:
        return {"colors": np.append(srgb_of(factor[:3]), factor[3:])}
    color = getattr(material, "diffuse", None)
    return {} if color is None else {"colors": np.asarray(color)}


def _of_open3d(mesh: Any, triangles: Any) -> list[Mesh]:
    """Converts a TriangleMesh of Open3D, in which each triangle can have a different texture. The
    images of its textures begin with the lower row."""
    vertices = np.asarray(mesh.vertices)
    textures = [np.asarray(texture) for texture in getattr(mesh, "textures", [])]
    uv = np.asarray(mesh.triangle_uvs).reshape(-1, 3, 2)
    colors = np.asarray(mesh.vertex_colors)
    if not any(texture.size for texture in textures) or len(uv) != len(triangles):
        return [Mesh(vertices, triangles, colors if len(colors) else None)]
    numbers = np.asarray(mesh.triangle_material_ids)
    if len(numbers) != len(triangles):
        numbers = np.zeros(len(triangles), int)
    meshes = []
    for number in np.unique(numbers):
        rows = numbers == number
        if 0 <= number < len(textures) and textures[number].size:
            image = textures[number][::-1]
            name = f"texture {number}"
            meshes.append(
                Mesh(vertices, triangles[rows], uv=uv[rows], texture=image, material=name)
            )
        else:
            meshes.append(Mesh(vertices, triangles[rows], colors if len(colors) else None))
    return meshes


def _of_open3d_tensors(mesh: Any) -> list[Mesh]:
    return meshes_of(mesh.to_legacy())


def _of_pyvista(mesh: Any) -> list[Mesh]:
    """Converts a PolyData of PyVista. Its array `faces` has, for each face, the number of corners
    and then the corners. In its cell data, the rows of the faces follow the rows of the vertices
    and lines."""
    points = np.asarray(mesh.points)
    faces = np.asarray(mesh.faces)
    if faces.ndim != 1:
        return [Mesh(points, _fans(faces))]
    if len(faces) == 0:
        return [Mesh(points, colors=_pyvista_colors(mesh.point_data, len(points)))]
    triangles, face_of = _triangles_of_padded(faces)
    colors = _pyvista_colors(mesh.point_data, len(points))
    of_cells = None if colors is not None else _pyvista_colors(mesh.cell_data, mesh.n_cells)
    if of_cells is not None:
        of_cells = of_cells[len(of_cells) - 1 - face_of[-1] + face_of]
    return [Mesh(points, triangles, colors=colors, face_colors=of_cells)]


def _pyvista_colors(data: Any, rows: int) -> Any:
    """Returns the first array of colors in `data`, the data of points or cells: an array of uint8
    with 3 or 4 columns and this number of rows. Returns None if there is no such array."""
    for name in data.keys():  # noqa: SIM118 -- a DataSetAttributes, not a dict
        values = np.asarray(data[name])
        if values.dtype == np.uint8 and values.shape in ((rows, 3), (rows, 4)):
            return values
    return None


def _triangles_of_padded(faces: Any) -> tuple[Any, Any]:
    """Divides faces into fans of triangles. Returns the triangles, and for each triangle the index
    of its face. `faces` has, for each face, the number of corners and then the corners."""
    if len(faces) % 4 == 0 and np.all(faces[::4] == 3):
        return faces.reshape(-1, 4)[:, 1:], np.arange(len(faces) // 4)
    triangles, face_of, at, face = [], [], 0, 0
    while at < len(faces):
        count = int(faces[at])
        corners = faces[at + 1 : at + 1 + count]
        triangles += [(corners[0], corners[k], corners[k + 1]) for k in range(1, count - 1)]
        face_of += [face] * max(0, count - 2)
        at, face = at + 1 + count, face + 1
    return np.array(triangles, np.int64).reshape(-1, 3), np.array(face_of, np.int64)


def _of_volume(mesh: Any) -> list[Mesh]:
    """Converts the surface of a grid of PyVista."""
    return meshes_of(mesh.extract_surface())


def _of_meshio(mesh: Any) -> list[Mesh]:
    blocks = [(block.type, np.asarray(block.data)) for block in mesh.cells]
    faces = [_fans(data) for kind, data in blocks if kind in _MESHIO_FACES]
    others = sorted({kind for kind, _ in blocks} - set(_MESHIO_FACES))
    if not faces and others != ["vertex"]:
        raise Error(
            f"the mesh has cells of the types {', '.join(others) or 'none'}: expected triangles, "
            "quads or polygons",
            "invalid_input",
        )
    if faces and others:
        warn(f"cells of the types {', '.join(others)} make no voxels, and are left out")
    points = np.asarray(mesh.points)
    if points.ndim == 2 and points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    triangles = np.concatenate(faces) if faces else None
    colors = next((v for k, v in mesh.point_data.items() if _is_color(k, np.asarray(v))), None)
    return [Mesh(points, triangles, colors=colors)]


_MESHIO_FACES = ("triangle", "quad", "polygon")


def _is_color(name: str, values: Any) -> bool:
    return (
        name.lower() in ("rgb", "rgba", "color", "colors")
        and values.ndim == 2
        and values.shape[1] in (3, 4)
    )


def _of_points(cloud: Any) -> list[Mesh]:
    """Converts a point cloud of trimesh or Open3D."""
    points = np.asarray(cloud.vertices if hasattr(cloud, "vertices") else cloud.points)
    colors = np.asarray(cloud.colors)
    return [Mesh(points, colors=colors if len(colors) == len(points) > 0 else None)]


def _fans(faces: Any) -> Any:
    """Divides faces, an array with a row of corners for each face, into fans of triangles."""
    faces = np.asarray(faces)
    if faces.ndim != 2 or faces.shape[1] <= 3:
        return faces
    corners = range(1, faces.shape[1] - 1)
    return np.stack([faces[:, [0, k, k + 1]] for k in corners], axis=1).reshape(-1, 3)


_CONVERSIONS: Iterable[tuple[Any, Any]] = (
    (_has("geometry", "graph"), _of_trimesh_scene),
    (lambda scene: isinstance(getattr(scene, "cells", None), list), _of_meshio),
    (_has("vertex", "to_legacy"), _of_open3d_tensors),
    (_has("points", "faces", "point_data"), _of_pyvista),
    (_has("points", "extract_surface"), _of_volume),
    (_has("vertices", "faces"), _of_vertices),
    (_has("vertices", "triangles"), _of_vertices),
    (_has("vertices", "entities"), _of_vertices),
    (_has("vertices", "colors"), _of_points),
    (_has("points", "colors"), _of_points),
)
