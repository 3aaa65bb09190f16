// Writes the surface (surface.h) as binary glTF 2.0. Positions are in cells from the low corner of
// the region. They are integers of 16 bits (KHR_mesh_quantization), or floats if the surface has
// more than 65535 cells along an axis; floats represent these integers exactly. The transform of
// the glTF node converts positions to world space. The vertex colors (COLOR_0) are linear light, as
// glTF requires. They have 16 bits, because 8 bits of linear light cannot distinguish dark sRGB
// bytes.
#include <algorithm>
#include <array>
#include <optional>

#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "query/export/color/linear_colors.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/export/surface/surface_mesh.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kMaxGlbBytes = (uint64_t{1} << 32) - 1;  // the header has 32 bits for the size
constexpr uint64_t kMaxGlbJsonBytes = 4096;                 // including chunk headers
constexpr uint64_t kGlbColorBytes = 4 * sizeof(uint16_t);
// glTF reserves the largest 16-bit index, 65535.
constexpr uint32_t kMaxShortIndexedVertices = 65535;
constexpr uint32_t kMaxShortPosition = 65535;

// glTF's numbers for component types.
constexpr int kGlbShort = 5123, kGlbInt = 5125, kGlbFloat = 5126;

using Corner = std::array<uint32_t, 3>;

// The sizes and the bounding box of a mesh in the file.
struct GlbLayout {
  GlbLayout(const ExportJob& job, const SurfaceMesh& mesh)
      : vertices(mesh.vertices().size()),
        indices(mesh.indices().size()),
        has_short_indices(vertices <= kMaxShortIndexedVertices) {
    low.fill(~uint32_t{0});
    for (uint32_t i = 0; i < vertices; ++i) {
      const Corner at = PackedPlace::unpack(mesh.vertices().place(i));
      for (size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], at[axis]);
        high[axis] = std::max(high[axis], at[axis]);
      }
    }
    has_short_positions = *std::ranges::max_element(high) <= kMaxShortPosition;
    position_bytes = vertices * position_size();
    index_bytes = indices * (has_short_indices ? sizeof(uint16_t) : sizeof(uint32_t));
    color_offset = position_bytes + (index_bytes + 3) / 4 * 4;
    bytes = color_offset + (job.has_colors ? vertices * kGlbColorBytes : 0);
  }
  // Bytes of a position. Each position must begin at a multiple of four bytes.
  uint64_t position_size() const {
    return has_short_positions ? 4 * sizeof(uint16_t) : 3 * sizeof(float);
  }

  uint64_t vertices, indices;
  Corner low{}, high{};
  bool has_short_positions = false, has_short_indices;
  uint64_t position_bytes = 0, index_bytes = 0, color_offset = 0;
  uint64_t bytes = 0;  // size of the complete binary chunk
};

template <class Numbers>
std::string numbers_text(const Numbers& numbers) {
  std::string text = "[";
  for (size_t axis = 0; axis < 3; ++axis)
    text += (axis == 0 ? "" : ",") + number_text(static_cast<double>(numbers[axis]));
  return text + "]";
}

std::string glb_accessor(int view, int type, uint64_t count, const char* shape,
                         const std::string& more = "") {
  return "{\"bufferView\":" + std::to_string(view) + ",\"componentType\":" + std::to_string(type) +
         ",\"count\":" + std::to_string(count) + ",\"type\":\"" + shape + "\"" + more + "}";
}

std::string glb_view(uint64_t offset, uint64_t bytes, int target, uint64_t stride = 0) {
  return "{\"buffer\":0,\"byteOffset\":" + std::to_string(offset) +
         ",\"byteLength\":" + std::to_string(bytes) + ",\"target\":" + std::to_string(target) +
         (stride == 0 ? "" : ",\"byteStride\":" + std::to_string(stride)) + "}";
}

// Returns the members of the document that describe the mesh.
std::string glb_mesh_json(const ExportJob& job, const GlbLayout& layout) {
  constexpr int kVertices = 34962, kIndices = 34963;
  const std::string box =
      ",\"min\":" + numbers_text(layout.low) + ",\"max\":" + numbers_text(layout.high);
  return std::string(",\"materials\":[{\"pbrMetallicRoughness\":{") +
         (job.has_colors ? "" : "\"baseColorFactor\":[0.7,0.7,0.7,1],") +
         "\"metallicFactor\":0}}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0" +
         (job.has_colors ? ",\"COLOR_0\":2" : "") +
         "},\"indices\":1,\"material\":0}]}],\"accessors\":[" +
         glb_accessor(0, layout.has_short_positions ? kGlbShort : kGlbFloat, layout.vertices,
                      "VEC3", box) +
         "," +
         glb_accessor(1, layout.has_short_indices ? kGlbShort : kGlbInt, layout.indices, "SCALAR") +
         (job.has_colors
              ? "," + glb_accessor(2, kGlbShort, layout.vertices, "VEC4", ",\"normalized\":true")
              : "") +
         "],\"bufferViews\":[" +
         glb_view(0, layout.position_bytes, kVertices, layout.position_size()) + "," +
         glb_view(layout.position_bytes, layout.index_bytes, kIndices) +
         (job.has_colors
              ? "," + glb_view(layout.color_offset, layout.vertices * kGlbColorBytes, kVertices)
              : "") +
         "],\"buffers\":[{\"byteLength\":" + std::to_string(layout.bytes) + "}]" +
         (layout.has_short_positions ? ",\"extensionsUsed\":[\"KHR_mesh_quantization\"],"
                                       "\"extensionsRequired\":[\"KHR_mesh_quantization\"]"
                                     : "");
}

// Returns the JSON text. The node has no mesh if the surface has no faces.
std::string glb_json(const ExportJob& job, const GlbLayout& layout) {
  std::array<double, 3> place{};
  for (size_t axis = 0; axis < 3; ++axis)
    place[axis] = job.world(axis, static_cast<double>(job.selection.region.low[axis]));
  const double edge = job.cell_edge();
  std::string json = std::string(
                         "{\"asset\":{\"version\":\"2.0\",\"generator\":\"voxdag\"},\"scene\":0,"
                         "\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{") +
                     (layout.indices > 0 ? "\"mesh\":0," : "") +
                     "\"translation\":" + numbers_text(place) +
                     ",\"scale\":" + numbers_text(std::array{edge, edge, edge}) + "}]" +
                     (layout.indices > 0 ? glb_mesh_json(job, layout) : "") + "}";
  json.append((4 - json.size() % 4) % 4, ' ');
  return json;
}

void put_positions(const GlbLayout& layout, const VertexTable& vertices, ExportFile& file,
                   ExportStage& stage) {
  for (uint32_t i = 0; i < layout.vertices; ++i) {
    const Corner at = PackedPlace::unpack(vertices.place(i));
    if (layout.has_short_positions) {
      const std::array<uint16_t, 4> place = {static_cast<uint16_t>(at[0]),
                                             static_cast<uint16_t>(at[1]),
                                             static_cast<uint16_t>(at[2]), 0};
      file.write(std::as_bytes(std::span(place)));
    } else {
      const std::array<float, 3> place = {static_cast<float>(at[0]), static_cast<float>(at[1]),
                                          static_cast<float>(at[2])};
      file.write(std::as_bytes(std::span(place)));
    }
    stage.advance(1);
  }
}

void put_indices(const GlbLayout& layout, const SurfaceMesh& mesh, ExportFile& file,
                 ExportStage& stage) {
  for (const uint32_t index : mesh.indices()) {
    if (layout.has_short_indices)
      file.put(static_cast<uint16_t>(index));
    else
      file.put(index);
    stage.advance(1);
  }
  for (uint64_t end = layout.position_bytes + layout.index_bytes; end < layout.color_offset; ++end)
    file.put<uint8_t>(0);
}

// Writes the colors of the vertices. Alpha is included because each color must start at a multiple
// of four bytes.
void put_colors(const VertexTable& vertices, ExportFile& file, ExportStage& stage) {
  const auto& linear = linear_of_srgb();
  for (uint32_t i = 0; i < vertices.size(); ++i) {
    const voxdag_reader::Rgb color = vertices.color(i);
    const std::array<uint16_t, 4> vertex = {linear[color.r], linear[color.g], linear[color.b],
                                            65535};
    file.write(std::as_bytes(std::span(vertex)));
    stage.advance(1);
  }
}

void put_glb(const ExportJob& job, const SurfaceMesh& mesh, const GlbLayout& layout,
             ExportFile& file) {
  const std::string json = glb_json(job, layout);
  const uint64_t binary_chunk = layout.indices > 0 ? 8 + layout.bytes : 0;
  file.write("glTF");
  file.put<uint32_t>(2);
  file.put(static_cast<uint32_t>(12 + 8 + json.size() + binary_chunk));
  file.put(static_cast<uint32_t>(json.size()));
  file.write("JSON");
  file.write(json);
  if (binary_chunk == 0) return;
  file.put(static_cast<uint32_t>(layout.bytes));
  file.write(std::string_view("BIN\0", 4));
  ExportStage stage(job, "export", (job.has_colors ? 2 : 1) * layout.vertices + layout.indices,
                    "numbers");
  put_positions(layout, mesh.vertices(), file, stage);
  put_indices(layout, mesh, file, stage);
  if (job.has_colors) put_colors(mesh.vertices(), file, stage);
}

// Refuses the file, and suggests grids that fit even if no faces are merged and no cells share a
// vertex: a cell has up to 6 faces of 2 triangles, and 8 vertices.
[[noreturn]] void refuse_glb(const ExportJob& job, uint64_t max_bytes) {
  constexpr uint64_t kCellBytes = 6 * 6 * sizeof(uint32_t) + 8 * 3 * sizeof(float);
  const uint64_t cell_bytes = kCellBytes + (job.has_colors ? 8 * kGlbColorBytes : 0);
  CellLimit cells(job, (max_bytes - kMaxGlbJsonBytes) / cell_bytes);
  refuse_size(job,
              std::string("the mesh ") +
                  (job.has_colors ? "with colors (" + option_text("gray") + " merges more) " : "") +
                  "is too large: a .glb file has at most " + size_text(max_bytes),
              [&](uint32_t level) { return cells.fits(level); });
}

void report_mesh(const SurfaceMesh& mesh, uint64_t rectangles, ExportReport& report) {
  const uint64_t triangles = mesh.indices().size() / 3;
  report.notes.push_back(count_text(rectangles) + " rectangles, " + count_text(triangles) +
                         " triangles, " + count_text(mesh.vertices().size()) + " vertices");
  report.add_fact("rectangles", rectangles);
  report.add_fact("triangles", triangles);
  report.add_fact("vertices", uint64_t{mesh.vertices().size()});
}

}  // namespace

ExportReport write_glb(const ExportJob& job) { return write_glb_within(job, kMaxGlbBytes); }

ExportReport write_glb_within(const ExportJob& job, uint64_t max_bytes) {
  const uint64_t most = max_bytes - kMaxGlbJsonBytes;
  // A vertex belongs to at most 12 rectangles. So a mesh with more rectangles than this has more
  // than 65535 vertices and needs 32-bit indices.
  constexpr uint64_t kFewRectangles = 3 * uint64_t{kMaxShortIndexedVertices};
  std::optional<Surface> surface(std::in_place, job,
                                 std::max(kFewRectangles, most / (6 * sizeof(uint32_t))));
  ExportReport report;
  report.voxels = surface->voxels();
  const uint64_t rectangles = surface->rectangles().size();
  std::optional<SurfaceMesh> mesh;
  if (rectangles <= std::max(kFewRectangles, most / (6 * sizeof(uint32_t))))
    mesh.emplace(job, *surface);
  surface.reset();
  std::optional<GlbLayout> layout;
  if (mesh) layout.emplace(job, *mesh);
  if (!layout || layout->bytes > most) {
    mesh.reset();  // frees memory for the search
    refuse_glb(job, max_bytes);
  }
  require_space(job, layout->bytes + kMaxGlbJsonBytes);
  ExportFile file(job.files, job.output);
  put_glb(job, *mesh, *layout, file);
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  report_mesh(*mesh, rectangles, report);
  return report;
}

}  // namespace voxdag::query
