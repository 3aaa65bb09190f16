#include "scene/gltf/mesh_data/draco_counts.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/error.h"
#include "scene/gltf/compressed/codecs.h"
#include "scene/gltf/compressed/draco_header.h"
#include "scene/gltf/document/check_meshes.h"

namespace voxdag::gltf {
namespace {

// Number of bytes that read_header() reads first. A header without metadata is not larger.
constexpr uint64_t kCountedHeaderBytes = 64;

// Maximum number of faces per document that are decoded to check numbers of vertices. Such a check
// is needed if the Draco header neither confirms nor contradicts the number. Decoding more faces
// would take a noticeable time.
constexpr uint64_t kMaxCheckedFaces = 4096;

// Reads up to `size` bytes of the compressed data.
std::vector<std::byte> read_bytes(BufferReader& buffers, const CompressedBytes& from,
                                  uint64_t size) {
  std::vector<std::byte> bytes;
  for (size = std::min(size, from.byte_length); bytes.size() < size;) {
    const auto n =
        static_cast<size_t>(std::min<uint64_t>(size - bytes.size(), BufferReader::kWindowBytes));
    const auto window = buffers.window(from.buffer, from.byte_offset + bytes.size(), n);
    bytes.insert(bytes.end(), window.begin(), window.end());
  }
  return bytes;
}

DracoHeader read_header(BufferReader& buffers, const CompressedBytes& from) {
  try {
    std::vector<std::byte> bytes = read_bytes(buffers, from, kCountedHeaderBytes);
    return read_draco_header(bytes);
  } catch (const BrokenData&) {
    std::vector<std::byte> bytes = read_bytes(buffers, from, BufferReader::kWindowBytes);
    return read_draco_header(bytes);
  }
}

// True if header.vertices is the exact number of vertices of the decoded mesh.
bool has_exact_count(const DracoHeader& header) {
  return !header.is_edgebreaker || header.attribute_tables == 0;
}

// True if the header shows that the data cannot have this number of vertices.
bool contradicts(const DracoHeader& header, uint64_t vertices) {
  if (has_exact_count(header)) return vertices != header.vertices;
  return vertices < header.vertices || vertices > 3 * header.faces;
}

// True if a strip with this number of faces can declare part.corners corners. The strip also counts
// the degenerate triangles that join its pieces, but these triangles are not faces.
bool fits_strip(const DracoPart& part, uint64_t faces) {
  const uint64_t triangles = part.corners / 3;
  return part.is_strip && faces <= triangles && triangles <= kMaxStripTrianglesPerFace * faces;
}

// Returns a copy of the part, with the numbers of corners and vertices that its Draco data have. If
// the header contradicts part.vertices, decodes the faces to count the vertices. Does the same if
// the header neither confirms nor contradicts part.vertices, but only for at most `checked_faces`
// faces, and subtracts their number from `checked_faces`.
DracoPart correct(const DracoPart& part, BufferReader& buffers, uint64_t& checked_faces) {
  DracoPart out = part;
  buffers.check_length(part.from.buffer);
  const DracoHeader header = read_header(buffers, part.from);
  if (!fits_strip(part, header.faces)) out.corners = 3 * header.faces;
  if (!contradicts(header, part.vertices)) {
    if (has_exact_count(header) || header.faces > checked_faces) return out;
    checked_faces -= header.faces;
  }
  MemoryCharge charge(buffers.budget(), 2 * part.from.byte_length, "Draco");
  std::vector<std::byte> bytes = read_bytes(buffers, part.from, part.from.byte_length);
  out.vertices = count_draco_vertices(bytes, charge);
  return out;
}

// Returns the corrected part, or nothing if the data cannot be read.
std::optional<DracoPart> try_correct(const DracoPart& part, BufferReader& buffers,
                                     uint64_t& checked_faces) {
  try {
    return correct(part, buffers, checked_faces);
  } catch (const BrokenData&) {
    return std::nullopt;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
    return std::nullopt;
  }
}

// Stores the corrected part, and sets the counts and offsets of the primitive's accessors: of the
// indices, then of the attributes, in the order in which place_draco_primitive() added them.
void replace_part(Document& d, const Primitive& primitive, BufferSource& buffer, DracoPart part) {
  const auto indices = static_cast<size_t>(primitive.indices);
  const auto place = [&](size_t accessor, uint64_t count, uint64_t offset) {
    Accessor& a = d.accessors[accessor];
    BufferView& view = d.views[static_cast<size_t>(a.view)];
    a.count = count;
    view.byte_offset = offset;
    view.byte_length = count * element_bytes(a);
    return offset + view.byte_length;
  };
  uint64_t offset = place(indices, part.corners, 0);
  for (size_t k = 1; k <= part.attributes.size(); ++k)
    offset = place(indices + k, part.vertices, offset);
  buffer.byte_length = part.decoded_bytes();
  buffer.draco = std::make_shared<const DracoPart>(std::move(part));
}

void correct_primitive(Document& d, const Primitive& primitive, BufferReader& buffers,
                       uint64_t& checked_faces) {
  BufferSource* const buffer = decoded_buffer(d, primitive);
  if (!buffer) return;
  const std::shared_ptr<const DracoPart> part = buffer->draco;
  std::optional<DracoPart> corrected = try_correct(*part, buffers, checked_faces);
  if (corrected && (corrected->corners != part->corners || corrected->vertices != part->vertices)) {
    d.warn("draco-counts", part->where,
           "its accessors have other numbers of vertices or faces than its Draco data; the numbers "
           "of the Draco data are used");
    replace_part(d, primitive, *buffer, std::move(*corrected));
  }
  check_vertex_counts(d, primitive, part->where);
}

}  // namespace

void correct_draco_counts(Document& document, BufferReader& buffers) {
  uint64_t checked_faces = kMaxCheckedFaces;
  for (const Mesh& mesh : document.meshes)
    for (const Primitive& primitive : mesh.primitives)
      if (mesh.is_drawn && primitive.draco && primitive.makes_triangles())
        correct_primitive(document, primitive, buffers, checked_faces);
}

}  // namespace voxdag::gltf
