// Compressed geometry: EXT_meshopt_compression and KHR_meshopt_compression compress buffer views,
// KHR_draco_mesh_compression compresses primitives. For each compressed view or primitive, the
// document gets additional buffers for the decoded bytes. All other code reads these buffers like
// stored bytes. If a file also has the uncompressed geometry (a fallback), the fallback is read. So
// the result does not depend on the libraries that voxdag was built with.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "scene/gltf/json/json_element.h"

namespace voxdag::gltf {

struct BufferSource;
struct BufferView;
struct Document;
struct Primitive;

// A range of bytes in a buffer that the file stores.
struct CompressedBytes {
  int buffer = -1;
  uint64_t byte_offset = 0;
  uint64_t byte_length = 0;
};

// The extension EXT_meshopt_compression or KHR_meshopt_compression of a buffer view.
struct MeshoptView {
  enum class Mode { kAttributes, kTriangles, kIndices };
  enum class Filter { kNone, kOctahedral, kQuaternion, kExponential, kColor };

  const char* extension = "";  // the extension's name
  CompressedBytes from;
  uint64_t count = 0;   // number of elements
  uint64_t stride = 0;  // bytes per element
  Mode mode = Mode::kAttributes;
  Filter filter = Filter::kNone;

  uint64_t decoded_bytes() const { return count * stride; }
};

// The extension KHR_draco_mesh_compression of a primitive: the Draco ids of the attributes that
// voxdag reads, -1 for an attribute that is not compressed.
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

// The decoded form of a Draco primitive: `corners` indices of 32 bits, then the values of each
// attribute, packed. The attributes of the surface (colors, texture coordinates) form a second part
// without indices, so that reading only geometry does not decode them.
struct DracoPart {
  struct Attribute {
    int id = -1;  // id in the Draco data
    std::string name;
    int component_type = 0;
    int components = 0;
    bool normalized = false;
  };
  CompressedBytes from;
  std::string where;  // "mesh 0: primitive 2"
  bool is_strip = false;
  uint64_t corners = 0;
  bool has_indices = true;  // false: only attributes
  uint64_t vertices = 0;
  std::vector<Attribute> attributes;

  uint64_t decoded_bytes() const;
};

// Returns the meshopt extension in the extensions of a buffer or buffer view, and the extension's
// name. Returns nullopt if `extensions` has none.
std::optional<std::pair<JsonElement, const char*>> find_meshopt(const JsonElement& extensions);

// read_meshopt() reads the meshopt extension of a buffer view from the view's `extensions`. It
// returns null if they have no such extension. read_draco() reads the Draco extension of a
// primitive. Both throw Violation for a member that is missing or of a wrong type, or for a layout
// that the extension does not allow.
std::shared_ptr<const MeshoptView> read_meshopt(const JsonElement& extensions);
std::shared_ptr<const DracoExtension> read_draco(const JsonElement& extension);

uint64_t heap_bytes(const DracoExtension& draco);

// For each meshopt-compressed view without a fallback, adds a buffer to which the view then refers.
void place_meshopt_views(Document& document);
// Adds a buffer for the decoded indices, positions, joints and weights of a compressed primitive.
// Replaces the primitive's accessors by copies that refer to this buffer. Call it before the
// accessors are checked. Throws Error{kInvalidInput}.
void place_draco_primitive(Document& document, Primitive& primitive, const std::string& where);
// If place_draco_primitive() added a buffer for this primitive, adds another one for the decoded
// texture coordinates and colors of its PrimitiveSurface. Replaces the accessors of these values by
// copies that refer to this buffer. `set` is the n of the surface's TEXCOORD_n, if it has one.
void place_draco_surface(Document& document, Primitive& primitive, int set);
// Checks a view whose buffer one of the functions above added. `where` names the view. Throws
// Error{kInvalidInput} if the compressed bytes do not exist, if the view does not fit the decoded
// bytes, or if voxdag was built without the library that decodes them.
void check_compressed(const Document& document, const BufferView& view, const std::string& where);

}  // namespace voxdag::gltf
