// Writes the arrays of an assimp mesh to a .glb: positions, texture coordinates, colors, and the
// indices of its triangles.
#pragma once

#include <assimp/mesh.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
#include "scene/glb_arrays.h"
#include "scene/glb_file.h"
#include "scene/polygon/triangulator.h"

namespace voxdag {

class MeshExport {
 public:
  // `where` names the mesh in messages. `uv_channel` is the set of texture coordinates to write.
  // Adds a warning with the number of points and lines, which are left out. Throws
  // Error{kInvalidInput} for an index that is out of range. The mesh must outlive this object.
  MeshExport(const aiMesh& mesh, std::string where, unsigned uv_channel, WarningList& warnings);

  uint64_t triangles() const { return triangles_; }
  // Adds the layouts of the arrays to `arrays`, in the order in which write() writes the arrays.
  // Returns the JSON of the glTF primitive, without its material.
  nlohmann::json add_to(GlbArrays& arrays) const;
  // Writes the arrays. Triangulates polygons as the PLY reader does (scene/polygon).
  void write(GlbFile& file, MemoryBudget& budget, WarningList& warnings) const;

 private:
  void write_indices(GlbFile& file, MemoryBudget& budget, WarningList& warnings) const;

  const aiMesh& mesh_;
  const std::string where_;
  const aiVector3D* const texcoords_;  // null: none
  const aiColor4D* const colors_;      // null: none
  uint64_t triangles_ = 0;
};

}  // namespace voxdag
