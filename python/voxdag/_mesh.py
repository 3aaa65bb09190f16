"""Meshes in memory, and the checks of their arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._colors import byte_colors
from ._error import Error
from ._png import png_of

# Arguments of a mesh of the native module: its path in messages, vertices, triangles, colors of the
# vertices, and the name, the image file and the coordinates of its texture.
NativeMesh = tuple[
    str,
    NDArray[Any],
    NDArray[np.uint32],
    Optional[NDArray[np.uint8]],
    str,
    bytes,
    Optional[NDArray[np.float32]],
]

# The index of a vertex that does not exist. The native module drops its triangle or refuses it.
_NO_VERTEX = 0xFFFFFFFF


@dataclass(frozen=True)
class Mesh:
    """A mesh of triangles, or a point cloud, in memory. build() and plan() take it as a scene.

    vertices      array (N, 3) of numbers: the positions of the vertices. float64 is not rounded to
                  float32.
    triangles     array (M, 3) of integers: for each triangle, the indexes of its three vertices. If
                  it is None, the vertices are points. Each point sets one voxel, unless the option
                  `point_radius` is given. A mesh whose array has no rows sets no voxels.
    colors        array (N, 3) or (N, 4): red, green, blue and optionally alpha of each vertex, as
                  integers from 0 to 255 or floats from 0 to 1. Colors are in sRGB; alpha is linear.
    face_colors   array (M, 3) or (M, 4): the color of each triangle, in the same form. A mesh
                  cannot have both `colors` and `face_colors`.
    uv            texture coordinates: an array (N, 2) for the vertices, or (M, 3, 2) for the
                  corners of the triangles. The coordinate v is 0 at the lower edge of the image.
    texture       an image: an array (height, width, 3 or 4) of uint8 with the upper row first, an
                  object that numpy converts to such an array (such as a Pillow image), or the bytes
                  of a PNG, JPEG or WebP file. A mesh with `uv` and `texture` has only the colors of
                  the texture.
    material      name of the texture's material
    name          name of the mesh in messages

    build() stores colors only with color=True or attributes=[...]. Do not change the arrays before
    build() returns.
    """

    vertices: Any
    triangles: Any = None
    colors: Any = None
    face_colors: Any = None
    uv: Any = None
    texture: Any = None
    material: str = "texture"
    name: str = ""


def native_meshes(
    meshes: Sequence[Mesh], with_colors: bool, skip_invalid: bool
) -> list[NativeMesh]:
    """Checks meshes, and converts them to the types that the native module requires. Omits colors
    and textures unless `with_colors` is True. Raises Error for an invalid triangle. If
    `skip_invalid` is True, keeps invalid triangles instead, and the native module drops them."""
    textures = _TextureNames()
    names: set[str] = set()
    return [
        _native_mesh(mesh, _path_of(mesh.name, names), textures, with_colors, skip_invalid)
        for mesh in meshes
    ]


def _path_of(name: str, taken: set[str]) -> str:
    """Returns a path for the mesh `name` that is not in `taken`, and adds it to `taken`."""
    path = f"mesh {_plain(name)!r}" if name else "mesh in memory"
    stem, number = path, 1
    while path in taken:
        number += 1
        path = f"{stem} ({number})"
    taken.add(path)
    return path


def _plain(name: str) -> str:
    """Returns `name` with at most 100 characters. Replaces characters that have a special meaning
    in paths and in file headers."""
    plain = "".join("_" if c in '/\\:"' or not c.isprintable() else c for c in name)
    return plain.encode(errors="replace").decode().strip()[:100]


class _TextureNames:
    """Gives each image a unique name, so that meshes with the same image share it."""

    def __init__(self) -> None:
        self._names: dict[int, str] = {}
        self._images: list[Any] = []  # keeps the images, and so their ids, alive

    def name_of(self, image: Any, wanted: str) -> str:
        if id(image) not in self._names:
            stem = _plain(wanted) or "texture"
            name, number = stem, 1
            while name in self._names.values():
                number += 1
                name = f"{stem} ({number})"
            self._names[id(image)] = name
            self._images.append(image)
        return self._names[id(image)]


def _native_mesh(
    mesh: Mesh, path: str, textures: _TextureNames, with_colors: bool, skip_invalid: bool
) -> NativeMesh:
    where = f"mesh {mesh.name!r}: " if mesh.name else ""
    vertices = _checked_vertices(mesh.vertices, where)
    triangles = _checked_triangles(mesh.triangles, len(vertices), where, skip_invalid)
    if not skip_invalid:
        _refuse_infinite(vertices, triangles, where)
    if not with_colors:
        return path, vertices, triangles, None, "", b"", None
    if mesh.uv is not None and mesh.texture is not None:
        uv = _checked_uv(mesh.uv, len(vertices), len(triangles), where)
        if uv.ndim == 3:
            vertices, triangles = _with_own_corners(vertices, triangles)
            uv = uv.reshape(-1, 2)
        name = textures.name_of(mesh.texture, mesh.material)
        image = _image_file(mesh.texture, where)
        return path, vertices, triangles, None, name, image, np.ascontiguousarray(uv)
    if mesh.colors is not None:
        if mesh.face_colors is not None:
            raise Error(f"{where}expected colors or face_colors, not both", "invalid_input")
        colors = byte_colors(mesh.colors, len(vertices), f"{where}colors")
        return path, vertices, triangles, colors, "", b"", None
    if mesh.face_colors is not None:
        colors = byte_colors(mesh.face_colors, len(triangles), f"{where}face_colors")
        vertices, triangles = _with_own_corners(vertices, triangles)
        return path, vertices, triangles, np.repeat(colors, 3, axis=0), "", b"", None
    return path, vertices, triangles, None, "", b"", None


def _checked_vertices(given: ArrayLike, where: str) -> NDArray[Any]:
    vertices = np.asarray(given)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or vertices.dtype.kind not in "fiu":
        raise Error(
            f"{where}the vertices are an array {vertices.shape} of {vertices.dtype}: "
            "expected (N, 3) numbers",
            "invalid_input",
        )
    if len(vertices) > (1 << 32) - 2:
        raise Error(
            f"{where}the mesh has {len(vertices)} vertices: expected at most 2^32 - 2", "limit"
        )
    is_float = vertices.dtype == np.float32
    return np.ascontiguousarray(vertices, dtype=np.float32 if is_float else np.float64)


def _checked_triangles(
    given: ArrayLike | None, vertices: int, where: str, skip_invalid: bool
) -> NDArray[np.uint32]:
    if given is None:
        return np.empty((0, 3), np.uint32)
    triangles = np.asarray(given)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise Error(
            f"{where}the triangles are an array {triangles.shape} of {triangles.dtype}: "
            "expected (M, 3) integers",
            "invalid_input",
        )
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= vertices):
        is_bad = (triangles < 0) | (triangles >= vertices)
        bad = np.flatnonzero(is_bad.any(axis=1))[0]
        if not skip_invalid:
            raise Error(
                f"{where}triangles[{bad}] is {triangles[bad].tolist()}: expected numbers from 0 to "
                f"below {vertices}, the number of vertices",
                "invalid_input",
            )
        triangles = np.where(is_bad, _NO_VERTEX, triangles)
    return np.ascontiguousarray(triangles, dtype=np.uint32)


def _refuse_infinite(vertices: NDArray[Any], triangles: NDArray[np.uint32], where: str) -> None:
    """Raises Error if a vertex of a triangle is not finite. Without triangles, checks all
    vertices."""
    if len(vertices) == 0 or (np.isfinite(vertices.min()) and np.isfinite(vertices.max())):
        return
    is_bad = ~np.isfinite(vertices).all(axis=1)
    use = ""
    if len(triangles):
        users = np.flatnonzero(is_bad[triangles].any(axis=1))
        if len(users) == 0:
            return
        corners = triangles[users[0]]
        vertex = int(corners[is_bad[corners]][0])
        use = f" (triangles[{users[0]}] uses it)"
    else:
        vertex = int(np.flatnonzero(is_bad)[0])
    raise Error(
        f"{where}vertices[{vertex}] is not finite: it is {vertices[vertex].tolist()}{use}",
        "invalid_input",
    )


def _checked_uv(given: ArrayLike, vertices: int, triangles: int, where: str) -> NDArray[np.float32]:
    """Returns texture coordinates as (N, 2) for vertices, or as (M, 3, 2) for corners."""
    uv = np.asarray(given)
    if uv.dtype.kind in "fiu" and uv.shape == (vertices, 2):
        pass
    elif uv.dtype.kind in "fiu" and uv.size == 6 * triangles and uv.shape[-1:] == (2,):
        uv = uv.reshape(-1, 3, 2)
    else:
        raise Error(
            f"{where}uv is an array {uv.shape} of {uv.dtype}: expected ({vertices}, 2) numbers "
            f"for the vertices, or ({triangles}, 3, 2) for the corners of the triangles",
            "invalid_input",
        )
    if not np.isfinite(uv).all():
        raise Error(
            f"{where}uv has numbers that are not finite: expected finite numbers", "invalid_input"
        )
    return uv.astype(np.float32)


def _with_own_corners(
    vertices: NDArray[Any], triangles: NDArray[np.uint32]
) -> tuple[NDArray[Any], NDArray[np.uint32]]:
    """Returns the vertices and indexes of the same triangles, with three separate vertices for
    each triangle."""
    exists = triangles < len(vertices)
    corners = vertices[np.where(exists, triangles, 0)].reshape(-1, 3)
    own = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
    return np.ascontiguousarray(corners), np.where(exists, own, np.uint32(_NO_VERTEX))


def _image_file(texture: Any, where: str) -> bytes:
    if isinstance(texture, (bytes, bytearray, memoryview)):
        return bytes(texture)
    if hasattr(texture, "convert") and hasattr(texture, "mode"):  # a Pillow image
        texture = texture.convert("RGBA" if "A" in texture.getbands() else "RGB")
    pixels = np.asarray(texture)
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[:, :, None], 3, axis=2)
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.dtype != np.uint8:
        raise Error(
            f"{where}the texture is an array {pixels.shape} of {pixels.dtype}: expected "
            "(height, width, 3 or 4) uint8, a Pillow image, or the bytes of an image file",
            "invalid_input",
        )
    return png_of(pixels)
