// Geometry that a file has compressed: EXT_meshopt_compression compresses buffer views,
// KHR_draco_mesh_compression primitives. Each becomes a buffer of the document of its own, so that
// all else reads it as if the file had stored it decoded. Where a file has the same geometry
// uncompressed too (a fallback), that is read: the result does not depend on what voxdag was built
// with.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "scene/gltf/json/json_element.h"

namespace voxdag::gltf {

struct BufferSource;
struct BufferView;
struct Document;
struct Primitive;

// Bytes of one of the file's own buffers.
struct CompressedBytes {
  int buffer = -1;
  uint64_t byte_offset = 0;
  uint64_t byte_length = 0;
};

// EXT_meshopt_compression of a buffer view.
struct MeshoptView {
  enum class Mode { kAttributes, kTriangles, kIndices };
  enum class Filter { kNone, kOctahedral, kQuaternion, kExponential };

  CompressedBytes from;
  uint64_t count = 0;   // elements
  uint64_t stride = 0;  // bytes of each
  Mode mode = Mode::kAttributes;
  Filter filter = Filter::kNone;

  uint64_t decoded_bytes() const { return count * stride; }
};

// KHR_draco_mesh_compression of a primitive, as the file has it: the ids of attributes that
// positions depend on, -1 for those that are not compressed.
struct DracoExtension {
  struct JointSet {
    int joints = -1;
    int weights = -1;
  };
  int view = -1;
  int position = -1;
  int color = -1;
  std::vector<int> texture_coordinates;
  std::vector<JointSet> joint_sets;
};

// What a Draco primitive decodes to: `corners` indices of 32 bits, then the attributes one after
// the other, each packed. What positions do not depend on is a part of its own, without indices:
// who reads the geometry alone does not decode it.
struct DracoPart {
  struct Attribute {
    int id = -1;  // in the Draco data
    std::string name;
    int component_type = 0;
    int components = 0;
    bool normalized = false;
  };
  CompressedBytes from;
  std::string where;  // "mesh 0: primitive 2"
  bool is_strip = false;
  uint64_t corners = 0;
  bool has_indices = true;  // false: attributes alone
  uint64_t vertices = 0;
  std::vector<Attribute> attributes;

  uint64_t decoded_bytes() const;
};

// Throws Violation for a member that is missing or of a wrong type, or a layout that the extension
// does not allow.
std::shared_ptr<const MeshoptView> read_meshopt(const JsonElement& extension);
std::shared_ptr<const DracoExtension> read_draco(const JsonElement& extension);

uint64_t heap_bytes(const DracoExtension& draco);

// Points every compressed view that has no uncompressed bytes at a buffer of its own.
void place_meshopt_views(Document& document);
// Does so with the accessors of a compressed primitive, which refer to copies of their own then.
// Call it before the primitive's accessors are checked. Throws Error{kInvalidInput}.
void place_draco_primitive(Document& document, Primitive& primitive, const std::string& where);
// Does so with the accessors of the primitive's look, if its positions were placed by the function
// above. `set` is the n of the TEXCOORD_n that the look has, unless it has none.
void place_draco_look(Document& document, Primitive& primitive, int set);
// Checks a buffer that was made by one of these. Throws Error{kInvalidInput}, also where voxdag was
// built without the library.
void check_compressed(const Document& document, const BufferSource& buffer,
                      const std::string& where);

}  // namespace voxdag::gltf
