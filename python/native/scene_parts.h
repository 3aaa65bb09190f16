// The scene of a build or an edit, as Python passes it: paths, files in memory and meshes in
// memory.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "python/native/path_text.h"
#include "scene/mesh_files.h"

namespace voxdag::python {

namespace nb = nanobind;

// The vertices of a mesh, one per row, as float32 or float64. add_parts() throws for any other
// type.
using Vertices = nb::ndarray<nb::ro, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
template <class Number, ssize_t Columns>
using Matrix = nb::ndarray<const Number, nb::shape<-1, Columns>, nb::c_contig, nb::device::cpu>;

// A scene file in memory: a path, which is its name in messages, and its bytes.
using FileBytes = std::pair<std::string, nb::bytes>;

// A mesh of a scene: a path, which is its name in messages; vertices; triangles; the colors of the
// vertices; and a texture: the name of its material, the bytes of an image file, and the texture
// coordinates of the vertices.
using MeshArrays =
    std::tuple<std::string, Vertices, Matrix<uint32_t, 3>, std::optional<Matrix<uint8_t, 4>>,
               std::string, nb::bytes, std::optional<Matrix<float, 2>>>;

// The parts of one scene. `bytes` are files in memory.
struct SceneParts {
  std::vector<PathText> files;
  std::vector<FileBytes> bytes;
  std::vector<MeshArrays> meshes;
};

// Adds the files and meshes in memory to `files`, and the paths of all parts to `scenes`. `parts`
// must remain valid while `files` is used. Needs the interpreter's lock.
void add_parts(const SceneParts& parts, MeshFiles& files, std::vector<std::string>& scenes);

}  // namespace voxdag::python
