// The part of a glTF 2.0 file that makes triangles, as plain structs. Filled by read_document()
// and then checked once by check_document(); after that:
//   1. every index is in range, or -1 where none is given;
//   2. every accessor that is read has the type its use asks for, and its bytes lie inside its
//      buffer view, its view inside its buffer, and its buffer inside the bytes that are there;
//   3. nodes form trees, and `roots` are parentless.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/scene/gltf/geometry/transform.h"

namespace voxdag::gltf {

// Bytes [begin, begin + size) of a file.
struct FileRange {
  uint64_t begin = 0;
  uint64_t size = 0;
};

// Where the bytes of a buffer come from.
struct Buffer {
  enum class Source {
    kNone,      // no uri, and not the GLB's own: usable by extensions only
    kFile,      // the scene file itself from `text.begin` on: the BIN chunk of a GLB
    kExternal,  // the file `uri`, percent-encoded and relative to the scene file
    kBase64,    // base64 characters in the scene file at `text`
    kMemory,    // base64 characters that had JSON escapes among them, in `characters`
  };
  Source source = Source::kNone;
  uint64_t byte_length = 0;
  bool is_read = false;  // some of it makes triangles; set by check_document()
  FileRange text;
  std::string uri;
  std::string characters;
};

struct BufferView {
  int buffer = -1;
  uint64_t byte_offset = 0;
  uint64_t byte_length = 0;
  uint64_t byte_stride = 0;  // 0: elements are tightly packed
};

enum ComponentType : int {
  kByte = 5120,
  kUnsignedByte = 5121,
  kShort = 5122,
  kUnsignedShort = 5123,
  kUnsignedInt = 5125,
  kFloat = 5126
};

// Elements that replace those of the base, by strictly increasing index.
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
};

// JOINTS_n and WEIGHTS_n of one n: four influences per vertex.
struct JointSet {
  int joints = -1;
  int weights = -1;
};

// Primitive modes; the smaller ones are points and lines.
enum Mode : int { kTriangleList = 4, kTriangleStrip = 5, kTriangleFan = 6 };

struct Primitive {
  int mode = kTriangleList;
  int position = -1;
  int indices = -1;
  std::vector<int> targets;  // POSITION of each morph target, -1 if it moves nothing
  std::vector<JointSet> joint_sets;
  bool draco = false;  // carries KHR_draco_mesh_compression

  bool makes_triangles() const { return mode >= kTriangleList; }
};

struct Mesh {
  std::string name;
  std::vector<Primitive> primitives;
  std::vector<double> weights;
};

// Accessors of EXT_mesh_gpu_instancing, -1 where one is absent.
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
  std::vector<double> weights;  // empty: the mesh's
  int parent = -1;
  int mesh = -1;
  int skin = -1;
  Instancing instancing;
};

struct Skin {
  std::string name;
  std::vector<int> joints;
  int inverse_bind = -1;  // -1: identities
};

struct Document {
  std::string path;
  bool quantized = false;  // KHR_mesh_quantization is used
  std::vector<Buffer> buffers;
  std::vector<BufferView> views;
  std::vector<Accessor> accessors;
  std::vector<Mesh> meshes;
  std::vector<Skin> skins;
  std::vector<Node> nodes;
  std::vector<std::vector<int>> scenes;  // roots of each
  int scene = -1;                        // the default one
  std::vector<int> roots;                // of the scene to draw, set by check_document()
  std::vector<std::string> warnings;     // the first few
  uint64_t further_warnings = 0;
  MemoryCharge charge;  // for memory_bytes()

  // Adds "<path>: <what>" to the warnings.
  void warn(const std::string& what);

  // "node 3 \"wheel\"", for messages.
  std::string name_node(int node) const;
  std::string name_mesh(int mesh) const;
  std::string name_accessor(int accessor) const;
  std::string name_skin(int skin) const;

  // About what all of this takes.
  uint64_t memory_bytes() const;
};

// Bytes of one component; 0 for what is no component type of glTF 2.0.
int component_bytes(int component_type);
const char* component_name(int component_type);

inline uint64_t element_bytes(const Accessor& accessor) {
  return static_cast<uint64_t>(component_bytes(accessor.component_type) * accessor.components);
}

// Triangles of a primitive: whole ones only.
uint64_t triangle_count(const Document& document, const Primitive& primitive);
// Times the node's mesh is drawn.
uint64_t instance_count(const Document& document, const Node& node);

// A text from the file as messages show it: control characters replaced, cut if overlong.
std::string printable(const std::string& text);

// "16 \"name\"", or the bare number for what has no name.
std::string numbered(int index, const std::string& name);

// Throws Error{kInvalidInput}: "<scene file>: <what>".
[[noreturn]] void refuse(const std::string& path, const std::string& what);

}  // namespace voxdag::gltf
