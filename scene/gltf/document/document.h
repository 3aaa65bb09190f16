// A glTF 2.0 file without its geometry. Arrays that can have an element per node or mesh of a large
// scene consist of compact structs, each charged to the memory budget. Materials, textures,
// samplers and images are in tinygltf's model. read_document() fills a document, and
// check_document() checks it once. After that:
//   1. every index in nodes of the scene and in drawn meshes is in range, or -1 if the file has no
//      index there;
//   2. every accessor that is read has the type its use requires. Its bytes are inside its buffer
//      view, the view is inside its buffer, and the buffer is inside the existing bytes;
//   3. the nodes below `roots` form trees, and no root is below another one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/warning.h"
#include "scene/gltf/document/compression.h"
#include "scene/gltf/document/tinygltf_model.h"
#include "scene/gltf/json/file_range.h"
#include "scene/growing_charge.h"
#include "scene/vertices/transform.h"

namespace voxdag::gltf {

struct DocumentMaterials;
struct RestartIndex;

// The source of a buffer's bytes.
struct BufferSource {
  enum class Kind {
    kNone,      // no uri, and not the BIN chunk: only extensions can use it
    kBinChunk,  // the bytes `range` of the scene file
    kExternal,  // the file `uri`, percent-encoded and relative to the scene file
    kBase64,    // the base64 characters `range` of the scene file
    kMemory,    // `bytes`, decoded from the data: URI at `range`
    kDecoded,   // the decoded bytes of `meshopt` or `draco`; not a buffer of the file
  };
  Kind kind = Kind::kNone;
  uint64_t byte_length = 0;
  bool is_read = false;  // some triangles use it; set by check_document()
  // The buffer is a fallback for readers without meshopt extensions. It is never the BIN chunk.
  bool is_fallback = false;
  FileRange range;
  std::string uri;
  std::string bytes;
  bool is_base64 = true;  // the data: URI is base64, not percent-encoded
  std::shared_ptr<const MeshoptView> meshopt;
  std::shared_ptr<const DracoPart> draco;
};

struct BufferView {
  int buffer = -1;
  uint64_t byte_offset = 0;
  uint64_t byte_length = 0;
  uint64_t byte_stride = 0;                    // 0: elements are packed
  std::shared_ptr<const MeshoptView> meshopt;  // null: not compressed
};

enum ComponentType : int {
  kByte = 5120,
  kUnsignedByte = 5121,
  kShort = 5122,
  kUnsignedShort = 5123,
  kUnsignedInt = 5125,
  kFloat = 5126
};

// Replacements of some elements of an accessor, at strictly increasing indices.
struct Sparse {
  uint64_t count = 0;
  int index_view = -1;
  uint64_t index_offset = 0;
  int index_type = 0;
  int value_view = -1;
  uint64_t value_offset = 0;
};

struct Accessor {
  std::string name;
  int view = -1;  // -1: all zeros
  uint64_t byte_offset = 0;
  uint64_t count = 0;
  int component_type = 0;
  int components = 0;  // 1 for SCALAR, 3 for VEC3, 16 for MAT4
  bool normalized = false;
  bool is_sparse = false;
  Sparse sparse;
  int same_as = -1;  // index of the original accessor; -1: this is not a copy
};

// The accessors JOINTS_n and WEIGHTS_n for one n: four influences per vertex.
struct JointSet {
  int joints = -1;
  int weights = -1;
};

// Primitive modes with triangles. Smaller values are points and lines.
enum Mode : int { kTriangleList = 4, kTriangleStrip = 5, kTriangleFan = 6 };

// Material and attributes of a primitive's triangles. Set by resolve_materials().
struct PrimitiveSurface {
  uint32_t material = 0;         // index in DocumentMaterials
  int texture_coordinates = -1;  // accessor; -1: not needed
  int color = -1;                // accessor; -1: white
};

struct Primitive {
  static constexpr int kBrokenMaterial = -2;

  int mode = kTriangleList;
  int position = -1;
  int indices = -1;
  std::vector<int> targets;  // POSITION of each morph target, -1 if it has none
  std::vector<JointSet> joint_sets;
  // Index of the material as in the file; -1 if the file has none, and kBrokenMaterial if its value
  // is not an index. This index and the next two members are not checked.
  int material = -1;
  int color = -1;                        // COLOR_0
  std::vector<int> texture_coordinates;  // TEXCOORD_n
  PrimitiveSurface surface;
  std::shared_ptr<const DracoExtension> draco;  // null: not compressed
  // Positions of the triangles of a strip or fan that can have restarts. Set by index_restarts().
  // Null for all other primitives.
  std::shared_ptr<const RestartIndex> restarts;

  bool makes_triangles() const { return mode >= kTriangleList && position >= 0; }
};

struct Mesh {
  std::string name;
  std::vector<Primitive> primitives;
  std::vector<double> weights;
  bool is_drawn = false;  // a node of the scene draws it; set by check_document()
};

// Accessors of EXT_mesh_gpu_instancing; -1 for missing ones.
struct Instancing {
  bool present = false;
  int translation = -1;
  int rotation = -1;
  int scale = -1;
};

struct Node {
  std::string name;
  Transform local;
  std::vector<int> children;
  std::vector<double> weights;  // empty: the mesh's weights are used
  int parent = -1;
  int mesh = -1;
  int skin = -1;
  bool is_hidden = false;  // KHR_node_visibility hides the node and its descendants
  Instancing instancing;
};

struct Skin {
  std::string name;
  std::vector<int> joints;
  int inverse_bind = -1;  // -1: identity matrices
};

struct Asset {
  std::string version = "2.0";
  std::string min_version;  // empty if it is absent
};

struct Document {
  Document(std::string scene_path, MemoryBudget& budget)
      : path(std::move(scene_path)), charge(budget, "the structure of " + path) {}

  std::string path;
  GrowingCharge charge;        // charge for the arrays
  GrowingCharge model_charge;  // charge for the model

  Asset asset;
  std::deque<std::string> extensions_used;
  std::deque<std::string> extensions_required;
  // Required extensions that are not read, because the user has asked to ignore them.
  std::vector<std::string> ignored_extensions;
  // Materials, textures, samplers and images, as read by tinygltf. The model's other arrays are
  // empty. The model has no image data: a data: URI in it ends at the comma.
  std::shared_ptr<tinygltf::Model> model;
  std::vector<RawString> image_uris;  // one per image of the model; size 0 for an image without uri
  WarningList material_warnings;      // about members of `model`; not in `warnings`

  bool quantized = false;     // KHR_mesh_quantization is used
  bool has_restarts = false;  // KHR_mesh_primitive_restart is used
  // Deques, because the old and the new array of a growing vector would exist together and need
  // twice the memory.
  std::deque<BufferSource> buffers;
  std::deque<BufferView> views;
  std::deque<Accessor> accessors;
  std::deque<Mesh> meshes;
  std::deque<Skin> skins;
  std::deque<Node> nodes;
  std::deque<std::vector<int>> scenes;                 // root nodes of each scene
  std::shared_ptr<const DocumentMaterials> materials;  // set by resolve_materials()
  int scene = -1;                                      // the default scene; -1: none
  std::vector<int> roots;                // roots of the drawn nodes; set by check_document()
  std::map<int, Transform> above_roots;  // for a root with a parent: the parent's global transform
  // Messages about buffers, bufferViews, accessors, meshes and skins that break a rule of glTF, by
  // section and index. check_usable() throws the message.
  std::map<std::pair<std::string, int>, std::string> broken;
  WarningList warnings;

  // Adds a warning about `place`, an element of the document; "" is the document.
  void warn(const char* code, const std::string& place, const std::string& message,
            uint64_t count = 1);

  // Records that element `index` of `section` breaks a rule. This is an error only if the element
  // is used.
  void add_broken(std::string_view section, int index, const std::string& message);
  // Throws Error{kInvalidInput} if add_broken() was called for the element.
  void check_usable(const char* section, int index) const;

  // Return a kind, an index and a name for messages: node 3 "wheel".
  std::string name_node(int node) const;
  std::string name_mesh(int mesh) const;
  std::string name_accessor(int accessor) const;
  std::string name_skin(int skin) const;
};

// Returns the bytes of one component; 0 if glTF 2.0 has no such component type.
int component_bytes(int component_type);
const char* component_name(int component_type);

inline uint64_t element_bytes(const Accessor& accessor) {
  return static_cast<uint64_t>(component_bytes(accessor.component_type) * accessor.components);
}

// Returns the number of complete triangles of a primitive.
uint64_t triangle_count(const Document& document, const Primitive& primitive);
// Returns the number of instances of the node's mesh.
uint64_t instance_count(const Document& document, const Node& node);

}  // namespace voxdag::gltf
