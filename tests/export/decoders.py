"""Decoders of the formats that `voxdag export` writes, from the formats' descriptions.

Each decoder takes the path of the file and the resolution of the exported grid, and returns the
set cells as an n x 3 array, in any order. The decoders share no code with the exporter.
"""

import json
import struct
import subprocess
from xml.etree import ElementTree

import numpy

try:
    import pyopenvdb
except ImportError:
    pyopenvdb = None


def child_bits(masks):
    """Returns the pairs (row, bit) of all set bits of an array of 8-bit masks, by row and bit."""
    return numpy.nonzero(masks.astype(numpy.uint8)[:, None] >> numpy.arange(8) & 1)


def popcount_below(masks, bits):
    below = masks.astype(numpy.int64) & ((1 << bits.astype(numpy.int64)) - 1)
    return numpy.array([bin(i).count("1") for i in range(256)])[below]


def child_corners(corners, bits, axes=(4, 2, 1)):
    """Returns the corners of children, in units of their edge; `axes`: bits of x, y and z."""
    return 2 * corners + numpy.stack([(bits & axis) // axis for axis in axes], axis=1)


def ply(path, grid):
    with open(path, "rb") as file:
        lines = []
        while not lines or lines[-1] != b"end_header":
            lines.append(file.readline().rstrip(b"\n"))
        assert lines[:2] == [b"ply", b"format binary_little_endian 1.0"], lines
        properties = [line for line in lines if line.startswith(b"property")]
        assert properties == [b"property double " + axis for axis in (b"x", b"y", b"z")], lines
        (count,) = [int(line.split()[2]) for line in lines if line.startswith(b"element vertex")]
        data = file.read()
    assert len(data) == 24 * count
    return grid.cells(numpy.frombuffer(data, "<f8").reshape(-1, 3))


def npz(path, grid):
    with numpy.load(path) as arrays:  # also checks the CRC of each array
        assert (arrays["grid"] == [*grid.origin, grid.voxel]).all()
        assert arrays["cells"].dtype == numpy.int32
        if sorted(arrays.files) == ["cells", "grid"]:  # --compact
            return arrays["cells"]
        assert sorted(arrays.files) == ["cells", "grid", "positions"]
        assert arrays["positions"].dtype == numpy.float64
        assert (grid.cells(arrays["positions"]) == arrays["cells"]).all()
        return arrays["cells"]


def hexahedra(points, corners, grid):
    """Returns the cells of hexahedra, n x 8 numbers of points, in the order of VTK and Abaqus."""
    places = (points - grid.origin) / grid.voxel
    rounded = numpy.rint(places).astype(numpy.int64)
    assert numpy.abs(places - rounded).max() < 1e-3, "points are not corners of voxels"
    assert len(numpy.unique(rounded, axis=0)) == len(points), "a point comes twice"
    assert len(numpy.unique(corners)) == len(points), "a point belongs to no voxel"
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    offsets = numpy.array([[*xy, z] for z in (0, 1) for xy in square])
    cells = rounded[corners[:, 0]]
    assert (rounded[corners] - cells[:, None] == offsets).all(), "other corners"
    return cells


def vtu_arrays(path):
    """Returns the arrays by name, and the numbers of points and of cells."""
    with open(path, "rb") as file:
        text, data = file.read().split(b'<AppendedData encoding="raw">\n_', 1)
    end = b"\n</AppendedData>\n</VTKFile>\n"
    assert data.endswith(end)
    document = ElementTree.fromstring(text + b"<AppendedData/></VTKFile>")
    assert document.attrib == {
        "type": "UnstructuredGrid",
        "version": "1.0",
        "byte_order": "LittleEndian",
        "header_type": "UInt64",
    }
    (piece,) = document.iter("Piece")
    arrays, at = {}, 0
    for array in document.iter("DataArray"):
        offset, components = int(array.get("offset")), int(array.get("NumberOfComponents"))
        assert array.get("format") == "appended" and offset == at
        (size,) = struct.unpack_from("<Q", data, offset)
        at = offset + 8 + size
        values = numpy.frombuffer(data[offset + 8 : at], array.get("type").lower())
        arrays[array.get("Name")] = values.reshape(-1, components)
    assert at + len(end) == len(data)
    return arrays, int(piece.get("NumberOfPoints")), int(piece.get("NumberOfCells"))


def vtu(path, grid):
    arrays, points, cells = vtu_arrays(path)
    assert len(arrays["Points"]) == points and arrays["Points"].shape[1] == 3
    assert (arrays["offsets"][:, 0] == 8 * numpy.arange(1, cells + 1)).all()
    assert len(arrays["types"]) == cells and (arrays["types"] == 12).all()
    return hexahedra(arrays["Points"], arrays["connectivity"].reshape(cells, 8), grid)


def vtu_colors(path, grid):
    return vtu(path, grid), vtu_arrays(path)[0]["colors"].astype(numpy.int64)


def inp(path, grid):
    with open(path, encoding="ascii") as file:
        lines = file.read().splitlines()
    keywords = {line: i for i, line in enumerate(lines) if line.startswith("*")}
    names = ["*HEADING", "*NODE, NSET=VOXELS", "*ELEMENT, TYPE=C3D8, ELSET=VOXELS"]
    assert list(keywords) == names
    nodes, elements = keywords[names[1]] + 1, keywords[names[2]] + 1
    for line in lines[nodes : elements - 1][:: max(1, len(lines) // 1000)]:
        assert max(map(len, line.split(","))) <= 20  # CalculiX reads 20 characters
    points = numpy.array([line.split(",") for line in lines[nodes : elements - 1]], float)
    corners = numpy.array([line.split(",") for line in lines[elements:]], numpy.int64)
    for table in (points, corners):
        assert (table[:, 0] == numpy.arange(1, len(table) + 1)).all()
    return hexahedra(points[:, 1:], corners[:, 1:] - 1, grid)


def words_of(data, count, at):
    assert len(data) >= at + 4 * count, "too short"
    return numpy.frombuffer(data, "<u4", count, at).astype(numpy.int64)


def expand(words, roots, depth, children_of):
    """Returns the leaves `depth` levels below the root, with corners in units of a leaf's edge."""
    nodes, corners = roots, numpy.zeros((len(roots), 3), numpy.int64)
    for level in range(depth):
        masks, pointer = children_of(words, nodes, level)
        rows, bits = child_bits(masks)
        nodes = pointer(rows, bits)
        corners = child_corners(corners[rows], bits)
    return nodes, corners


def voxels_of_bricks(bricks, corners):
    """Returns the voxels of 64-bit masks with bit = 32x1 + 16y1 + 8z1 + 4x0 + 2y0 + z0."""
    rows, bits = numpy.nonzero(
        bricks[:, None] >> numpy.arange(64, dtype=numpy.uint64) & numpy.uint64(1)
    )
    inner = [(bits >> 2 - axis & 1) | (bits >> 5 - axis & 1) << 1 for axis in range(3)]
    return 4 * corners[rows] + numpy.stack(inner, axis=1)


def hashdag(path, grid):
    with open(path, "rb") as file:
        data = file.read()
    assert (numpy.frombuffer(data, "<f8", 6) == [*grid.origin, *(grid.origin + grid.edge)]).all()
    levels = int(words_of(data, 1, 48)[0])
    count = int(numpy.frombuffer(data, "<u8", 1, 52)[0])
    assert levels == grid.levels and len(data) == 60 + 4 * count
    words = words_of(data, count, 60)

    with open(path.replace(".dag.bin", ".uncompressed_colors.bin"), "rb") as file:
        colors = file.read()
    top_levels = int(words_of(colors, 1, 0)[0])
    entries = int(numpy.frombuffer(colors, "<u8", 1, 4)[0])
    enclosed = numpy.frombuffer(colors, "<u8", entries, 12).astype(numpy.int64)
    assert numpy.frombuffer(colors, "<u8", 1, 12 + 8 * entries)[0] == 1, "expected one color"
    assert len(colors) == 12 + 8 * entries + 8 + 4 and entries >= 1
    visited = []

    def children_of(words, nodes, level):
        masks, upper = words[nodes] & 255, words[nodes] >> 8
        visited.append((nodes, enclosed[upper] if level < top_levels else upper))
        return masks, lambda rows, bits: words[nodes[rows] + 1 + popcount_below(masks[rows], bits)]

    leaves, corners = expand(words, numpy.array([0]), levels - 2, children_of)
    bricks = (words[leaves] | words[leaves + 1] << 32).view(numpy.uint64)
    cells = voxels_of_bricks(bricks, corners)
    # On every level, the numbers of voxels stored in the visited nodes add up to all voxels.
    for _, counts in visited:
        assert counts.sum() == len(cells)
    return cells


def svdag(path, grid):
    with open(path, "rb") as file:
        data = file.read()
    box = numpy.frombuffer(data, "<f4", 7)
    assert numpy.allclose(box, [*grid.origin, *(grid.origin + grid.edge), grid.edge], rtol=1e-6)
    levels, _, first_leaf, count = words_of(data, 4, 28)
    assert levels == grid.levels and len(data) == 44 + 4 * count
    words = words_of(data, int(count), 44)

    def children_of(words, nodes, _):
        masks = words[nodes] & 255
        table = numpy.array([bin(i).count("1") for i in range(256)])
        return masks, lambda rows, bits: words[nodes[rows] + table[masks[rows] >> bits]]

    leaves, corners = expand(words, numpy.array([0]), int(levels) - 1, children_of)
    assert (leaves >= first_leaf).all() and (words[leaves] < 256).all()
    rows, bits = child_bits(words[leaves])
    return child_corners(corners[rows], bits)


def voxel(path, grid):
    with open(path, encoding="utf-8") as file:
        meta = json.load(file)
    with open(path.replace(".voxel.json", ".voxel.bin"), "rb") as file:
        data = file.read()
    assert meta["version"] == "1.1" and meta["leafSize"] == 4
    assert meta["treeDepth"] == grid.levels - 2 and meta["voxelResolution"] == grid.voxel
    assert (meta["gridBounds"]["min"] == grid.origin).all()
    assert numpy.allclose(meta["gridBounds"]["max"], grid.origin + grid.edge, rtol=1e-15)
    count, leaf_words = meta["nodeCount"], meta["leafDataCount"]
    assert len(data) == 4 * (count + leaf_words)
    nodes, leaf_data = words_of(data, count, 0), words_of(data, leaf_words, 4 * count)
    cells = []
    found, corners = nodes[:1], numpy.zeros((1, 3), numpy.int64)
    for level in range(meta["treeDepth"] + 1):
        solid = found == 0xFF000000
        edge = 4 << meta["treeDepth"] - level
        if solid.any():
            cells.append(cells_of_cubes(corners[solid] * edge, numpy.full(solid.sum(), edge)))
        found, corners = found[~solid], corners[~solid]
        if level == meta["treeDepth"]:
            break
        masks = found >> 24
        assert (masks != 0).all(), "a leaf above the last level"
        rows, bits = child_bits(masks)
        corners = child_corners(corners[rows], bits, axes=(1, 2, 4))
        found = nodes[(found[rows] & 0xFFFFFF) + popcount_below(masks[rows], bits)]
    assert (found >> 24 == 0).all()
    bricks = (leaf_data[2 * found] | leaf_data[2 * found + 1] << 32).view(numpy.uint64)
    rows, bits = numpy.nonzero(
        bricks[:, None] >> numpy.arange(64, dtype=numpy.uint64) & numpy.uint64(1)
    )
    inner = numpy.stack([bits & 3, bits >> 2 & 3, bits >> 4], axis=1)
    cells.append(4 * corners[rows] + inner)
    return numpy.concatenate(cells)


def cells_of_cubes(corners, edges):
    cells = []
    for edge in numpy.unique(edges):
        inside = numpy.stack(numpy.meshgrid(*[range(edge)] * 3), axis=-1).reshape(-1, 3)
        cells.append((corners[edges == edge][:, None] + inside).reshape(-1, 3))
    return numpy.concatenate(cells)


def bt(path, grid, reader):
    listed = subprocess.run([reader, path], capture_output=True, check=True)
    leaves = numpy.frombuffer(listed.stdout, "<i4").reshape(-1, 5)
    corners, edges, occupied = leaves[:, :3] - 32768, leaves[:, 3], leaves[:, 4] == 1
    # OctoMap's cells begin at multiples of the voxel size, so the origin of the grid is rounded.
    corners = corners - numpy.floor(grid.origin / grid.voxel + 0.5).astype(numpy.int64)
    assert ((edges[occupied] == 1) | (edges[occupied] >= 8)).all()
    # Known cells are in the region. Cells at its border can be unknown.
    assert (corners >= grid.low).all() and (corners + edges[:, None] <= grid.high).all()
    known = (edges.astype(numpy.int64) ** 3).sum()
    assert known >= numpy.maximum(grid.high - grid.low - 16, 0).prod()
    return cells_of_cubes(corners[occupied], edges[occupied])


class VoxChunks:
    """The chunks of a .vox file in order: (id, contents)."""

    def __init__(self, data):
        assert data[:4] == b"VOX " and struct.unpack_from("<i", data, 4)[0] == 150
        name, size, below = struct.unpack_from("<4sii", data, 8)
        assert name == b"MAIN" and size == 0 and 20 + below == len(data)
        self.data, self.at = data, 20

    def __iter__(self):
        while self.at < len(self.data):
            name, size, below = struct.unpack_from("<4sii", self.data, self.at)
            assert below == 0
            self.at += 12 + size
            yield name.decode(), self.data[self.at - size : self.at]


class VoxFields:
    def __init__(self, data):
        self.data, self.at = data, 0

    def number(self):
        self.at += 4
        return struct.unpack_from("<i", self.data, self.at - 4)[0]

    def text(self):
        size = self.number()
        self.at += size
        return self.data[self.at - size : self.at].decode()

    def dictionary(self):
        return {self.text(): self.text() for _ in range(self.number())}


def vox_node(name, data):
    fields = VoxFields(data)
    number, attributes = fields.number(), fields.dictionary()
    if name == "nTRN":
        child, _, _, frames = [fields.number() for _ in range(4)]
        assert frames == 1
        node = "nTRN", child, [int(x) for x in fields.dictionary().get("_t", "0 0 0").split()]
    else:
        count = fields.number()
        assert name == "nGRP" or count == 1
        node = name, [fields.number() for _ in range(count)]
        if name == "nSHP":
            assert fields.dictionary() == {}
    assert attributes == {} and fields.at == len(data)
    return number, node


def vox(path, grid):
    with open(path, "rb") as file:
        data = file.read()
    sizes, models, nodes, palettes = [], [], {}, 0
    for name, contents in VoxChunks(data):
        if name == "SIZE":
            sizes.append(numpy.frombuffer(contents, "<i4"))
            assert (sizes[-1] <= 256).all() and len(sizes[-1]) == 3
        elif name == "XYZI":
            assert struct.unpack_from("<i", contents)[0] * 4 + 4 == len(contents)
            voxels = numpy.frombuffer(contents, "<u1", offset=4).reshape(-1, 4)
            assert (voxels[:, 3] == 1).all() and (voxels[:, :3] < sizes[-1]).all()
            models.append(voxels[:, :3].astype(numpy.int64))
        elif name == "RGBA":
            assert len(contents) == 1024
            palettes += 1
        else:
            number, node = vox_node(name, contents)
            nodes[number] = node
    assert len(sizes) == len(models) and palettes == 1
    cells = []

    def visit(number, place):
        node = nodes[number]
        if node[0] == "nTRN":
            visit(node[1], place + node[2])
        elif node[0] == "nGRP":
            for child in node[1]:
                visit(child, place)
        else:
            model = node[1][0]
            cells.append(models[model] + place - sizes[model] // 2)

    visit(0, numpy.zeros(3, numpy.int64))
    x, y, z = numpy.concatenate(cells).T
    # In .vox files, z is up, and the origin is the middle of the grid's floor. The coordinate of a
    # voxel is that of its low corner. For the mirrored axis, this is the voxel's high corner in z.
    middle = grid.resolution // 2
    return numpy.stack([x + middle, z, middle - 1 - y], axis=1)


def vdb(path, grid):
    names = [grid.name for grid in pyopenvdb.readAllGridMetadata(path)]
    assert names == sorted(names), f"{names}: vdb_render reads only files with sorted names"
    name = next(name for name in names if name != "Cd")
    read = pyopenvdb.read(path, name)
    is_density = isinstance(read, pyopenvdb.FloatGrid)
    assert name == ("density" if is_density else "voxels")
    assert not is_density or read.gridClass == pyopenvdb.GridClass.FOG_VOLUME
    assert not read.background
    low, high = read.evalActiveVoxelBoundingBox()
    values = numpy.zeros(numpy.array(high) - low + 1, numpy.float32 if is_density else bool)
    read.copyToArray(values, ijk=low)
    assert set(numpy.unique(values)) <= {0, 1}
    cells = numpy.argwhere(values) + low
    assert len(cells) == read.activeVoxelCount()
    some = cells[:: max(1, len(cells) // 100)]
    centers = [read.transform.indexToWorld(tuple(map(int, cell))) for cell in some]
    assert (grid.cells(numpy.array(centers)) == some).all()
    return cells


def nvdb(path, grid, reader):
    listed = subprocess.run([reader, path], capture_output=True, check=True)
    return grid.cells(numpy.frombuffer(listed.stdout, "<f8").reshape(-1, 3))


def srgb_of(linear):
    """Returns the sRGB bytes nearest to linear light."""
    low, high = 12.92 * linear, 1.055 * numpy.maximum(linear, 0) ** (1 / 2.4) - 0.055
    return numpy.rint(255 * numpy.where(linear <= 0.0031308, low, high)).astype(numpy.int64)


def vdb_colors(path, grid):
    """Returns the cells, and red, green and blue of each cell."""
    read = pyopenvdb.read(path, "Cd")
    low, high = read.evalActiveVoxelBoundingBox()
    values = numpy.zeros((*(numpy.array(high) - low + 1), 3), numpy.float32)
    read.copyToArray(values, ijk=low)
    cells = vdb(path, grid)  # which are also the active voxels of this grid
    assert len(cells) == read.activeVoxelCount()
    accessor = read.getConstAccessor()
    assert all(accessor.isValueOn(tuple(map(int, cell))) for cell in cells[::97])
    return cells, srgb_of(values[tuple((cells - low).T)])


def nvdb_colors(path, grid, reader):
    listed = subprocess.run([reader, path, "Cd"], capture_output=True, check=True)
    numbers = numpy.frombuffer(listed.stdout, "<f8").reshape(-1, 6)
    return grid.cells(numbers[:, :3]), srgb_of(numbers[:, 3:])


def glb_rectangles(path, grid):
    """Returns the corners of all rectangles, n x 4 x 3, in cells of the grid."""
    with open(path, "rb") as file:
        data = file.read()
    magic, version, size, json_size, json_type = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, size, json_type) == (b"glTF", 2, len(data), b"JSON")
    document = json.loads(data[20 : 20 + json_size])
    binary_size, binary_type = struct.unpack_from("<I4s", data, 20 + json_size)
    binary = data[28 + json_size :]
    assert binary_type == b"BIN\0" and binary_size == len(binary) and binary_size % 4 == 0
    assert document["buffers"] == [{"byteLength": len(binary)}]
    views = [
        binary[view.get("byteOffset", 0) :][: view["byteLength"]]
        for view in document["bufferViews"]
    ]
    accessors = document["accessors"]
    assert document["extensionsRequired"] == ["KHR_mesh_quantization"]
    assert accessors[0]["componentType"] == 5123 and document["bufferViews"][0]["byteStride"] == 8
    positions = numpy.frombuffer(views[0], "<u2").reshape(-1, 4)[:, :3]
    indices = numpy.frombuffer(views[1], {5123: "<u2", 5125: "<u4"}[accessors[1]["componentType"]])
    assert accessors[0]["count"] == len(positions) and accessors[1]["count"] == len(indices)
    assert len(numpy.unique(positions, axis=0)) == len(positions), "a vertex comes twice"
    assert (positions.min(axis=0) == accessors[0]["min"]).all()
    assert (positions.max(axis=0) == accessors[0]["max"]).all()
    triangles = positions[indices].astype(numpy.float64).reshape(-1, 2, 3, 3)
    assert (triangles[:, 0, 0] == triangles[:, 1, 0]).all()
    assert (triangles[:, 0, 2] == triangles[:, 1, 1]).all()
    corners = numpy.concatenate([triangles[:, 0], triangles[:, 1, 2:]], axis=1)
    (node,) = document["nodes"]
    cells = (corners * node["scale"] + node["translation"] - grid.origin) / grid.voxel
    assert numpy.abs(cells - numpy.rint(cells)).max() < 1e-3
    return numpy.rint(cells).astype(numpy.int64)


def glb(path, grid):
    corners = glb_rectangles(path, grid)
    normals = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    low, high = corners.min(axis=1), corners.max(axis=1)
    found = []
    # Along each axis, backward and forward faces alternate, with the solid between them.
    for axis in range(3):
        here = normals[:, axis] != 0
        assert (low[here, axis] == high[here, axis]).all()
        u, v = [a for a in range(3) if a != axis]
        sizes = high[here] - low[here]
        areas = sizes[:, u] * sizes[:, v]
        quad = numpy.repeat(numpy.arange(len(areas)), areas)
        within = numpy.arange(len(quad)) - numpy.repeat(numpy.cumsum(areas) - areas, areas)
        faces = low[here][quad]
        faces[:, u] += within % sizes[quad, u]
        faces[:, v] += within // sizes[quad, u]
        signs = numpy.sign(normals[here][quad, axis])
        order = numpy.lexsort((faces[:, axis], faces[:, u], faces[:, v]))
        faces, signs = faces[order], signs[order]
        begins, ends = faces[0::2], faces[1::2]
        assert (signs[0::2] == -1).all() and (signs[1::2] == 1).all()
        assert (begins[:, [u, v]] == ends[:, [u, v]]).all()
        lengths = ends[:, axis] - begins[:, axis]
        cells = numpy.repeat(begins, lengths, axis=0)
        cells[:, axis] += numpy.arange(len(cells)) - numpy.repeat(
            numpy.cumsum(lengths) - lengths, lengths
        )
        found.append(cells[numpy.lexsort(cells.T)])
    assert (found[0] == found[1]).all() and (found[0] == found[2]).all()
    return found[0]


def missing(name, tools):
    """Returns the missing library that the decoder needs, or None."""
    if name == "bt" and not tools:
        return "liboctomap-dev"
    if name == "nvdb" and not tools:
        return "libnanovdb-dev"
    if name == "vdb" and not pyopenvdb:
        return "python3-openvdb"
    return None
