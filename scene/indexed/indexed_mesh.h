// Reads a mesh with vertex indices from a scene file, for one thread. A format implements only the
// reading of its files; IndexedCursor has the code that all formats share. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/color/surface.h"
#include "scene/vertices/position_source.h"

namespace voxdag {

class IndexedMesh {
 public:
  virtual ~IndexedMesh() = default;

  // Returns the path of the scene file, for messages.
  virtual const std::string& path() const = 0;
  // Returns the vertices, which are fewer than 2^32 - 1.
  virtual PositionSource& positions() = 0;
  // Writes the vertex indices of triangles [first, first + count) to `corners`, three per triangle.
  // The triangles must exist, but their vertex indices may be out of range. An index that is
  // negative or needs more than 32 bits is UINT32_MAX.
  virtual void read_corners(uint64_t first, uint64_t count, uint32_t* corners) = 0;

  // Prepares read_surfaces(). `cursors` is the number of cursors that share the memory budget.
  // Returns false if all triangles are white, with material 0.
  virtual bool open_surfaces(unsigned /*cursors*/) { return false; }
  // Sets the material and corners of out[i] for the triangle first + numbers[i]. `first` and
  // `corners` are as in the last call of read_corners(). The vertices of these triangles exist.
  virtual void read_surfaces(std::span<const uint32_t> /*numbers*/, const uint32_t* /*corners*/,
                             SurfaceTriangle* /*out*/) {}

  // Returns the place of a triangle in the file for messages, such as "face 5".
  virtual std::string place_of(uint64_t triangle) = 0;
  // Describes a vertex index that is out of range, for messages. It is the index of corner `corner`
  // of the triangle.
  virtual std::string name_index(uint64_t /*triangle*/, int /*corner*/, uint32_t index) {
    return index == UINT32_MAX ? "a vertex with a negative or too large index"
                               : "index " + std::to_string(index);
  }
  // Returns the name of a vertex for messages.
  virtual std::string name_vertex(uint32_t index) { return "vertex " + std::to_string(index); }
};

}  // namespace voxdag
