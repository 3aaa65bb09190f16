// Writes the surface as binary glTF 2.0. The surface consists of the faces between set and empty
// voxels. Coplanar faces are merged to rectangles. If the file has colors, each rectangle has one
// color. Positions are in cells from the low corner of the region. They are integers, so floats
// represent them exactly. The transform of the glTF node converts them to world space. The vertex
// colors (COLOR_0) are linear light, as glTF requires. They have 16 bits, because 8 bits of linear
// light cannot distinguish dark sRGB bytes.
#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>
#include <optional>

#include "core/base/text.h"
#include "core/geometry/morton.h"
#include "query/export/color/linear_colors.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/export/faces/brick_faces.h"
#include "query/export/faces/brick_map.h"
#include "query/export/faces/plane_sort.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kMaxGlbBytes = (uint64_t{1} << 32) - 1;  // the header has 32 bits for it
constexpr uint64_t kMaxGlbJsonBytes = 4096;                 // including chunk headers
constexpr uint64_t kQuadBytes = 4 * 3 * sizeof(float) + 6 * sizeof(uint32_t);
constexpr uint64_t kQuadColorBytes = 4 * 4 * sizeof(uint16_t);

// Returns the number of bytes of a rectangle in the file.
uint64_t quad_bytes(const ExportJob& job) {
  return kQuadBytes + (job.has_colors ? kQuadColorBytes : 0);
}
uint64_t max_quads(const ExportJob& job, uint64_t max_bytes) {
  return (max_bytes - kMaxGlbJsonBytes) / quad_bytes(job);
}

// A rectangle of faces perpendicular to `axis`. `plane` is the coordinate of the faces on this
// axis. The rectangle extends from u0 to u1 on the next axis, and from v0 to v1 on the axis after
// that; z is followed by x. All coordinates are in cells.
struct GlbQuad {
  uint32_t plane = 0, u0 = 0, v0 = 0, u1 = 0, v1 = 0;
  bool upward : 1 = false;  // the outer side of the faces is toward larger coordinates
  uint8_t axis : 2 = 0;
  voxdag_reader::Rgb color;
};
static_assert(sizeof(GlbQuad) == 24);

class GlbSurface {
 public:
  // Finds the rectangles of the surface. Stops as soon as there are more than `max_quads`.
  GlbSurface(const ExportJob& job, uint64_t max_quads)
      : job_(job), max_quads_(max_quads), colors_(job.file) {
    const Sizes sizes = count_bricks();
    bricks_charge_ = MemoryCharge(job_.budget, BrickMap::bytes(sizes.bricks, sizes.cubes), kMemory);
    map_.reserve(sizes.bricks, sizes.cubes);
    outer_bricks_ = sizes.bricks + sizes.side_bricks;
    find_bricks(sizes);
    ExportStage stage(job, "find faces", 6 * outer_bricks_, "bricks");
    for (uint8_t axis = 0; axis < 3; ++axis)
      for (const bool upward : {false, true})
        if (quads_.size() <= max_quads_) add_quads(axis, upward, stage);
  }

  uint64_t voxels() const { return voxels_; }
  const std::vector<GlbQuad>& quads() const { return quads_; }

 private:
  static constexpr const char* kMemory =
      "the surface (a smaller --region or a coarser --level needs less)";
  struct Sizes {
    uint64_t bricks = 0, cubes = 0;
    uint64_t side_bricks = 0;  // bricks of one side of all cubes
  };
  static uint64_t side_bricks(int64_t edge) {
    return static_cast<uint64_t>(edge / kBrickEdge) * static_cast<uint64_t>(edge / kBrickEdge);
  }
  static uint64_t brick_morton(const Position& low) {
    return morton_encode(static_cast<uint32_t>(low[0] / kBrickEdge),
                         static_cast<uint32_t>(low[1] / kBrickEdge),
                         static_cast<uint32_t>(low[2] / kBrickEdge));
  }

  Sizes count_bricks() {
    ExportStage stage(job_, "count", 0, "bricks");
    Sizes sizes;
    for_each_brick_or_full_cube(
        job_.dag, job_.selection,
        [&](const Brick& brick) {
          ++sizes.bricks;
          voxels_ += static_cast<uint64_t>(std::popcount(brick.mask));
          stage.advance(1);
        },
        [&](const Position&, int64_t edge) {
          ++sizes.cubes;
          sizes.side_bricks += side_bricks(edge);
          voxels_ += cells_of_cube(edge);
          stage.advance(1);
        });
    if (voxels_ == 0) refuse_empty(job_);
    return sizes;
  }

  void find_bricks(const Sizes& sizes) {
    ExportStage stage(job_, "read", sizes.bricks + sizes.cubes, "bricks");
    for_each_brick_or_full_cube(
        job_.dag, job_.selection,
        [&](const Brick& brick) {
          stage.advance(1);
          map_.add(BrickMask{brick_morton(brick.low), brick.mask});
        },
        [&](const Position& low, int64_t edge) {
          stage.advance(1);
          map_.add(FullCube{brick_morton(low), edge});
        });
  }

  // Calls visit(morton, mask, from) for each brick that can have faces on the surface perpendicular
  // to `axis`: upper faces of cells if `upward` is true, otherwise lower faces. `morton` is the
  // Morton code of the brick. `from` is the index at which BrickMap::mask_at() must begin its
  // search for the next brick in this direction.
  template <class Visit>
  void for_each_outer_brick(uint8_t axis, bool upward, const Visit& visit) const {
    const std::vector<BrickMask>& bricks = map_.bricks();
    for (size_t i = 0; i < bricks.size(); ++i) visit(bricks[i].morton, bricks[i].mask, i);
    // All cells of a full cube are set, so only the bricks at its upper or lower side can have such
    // faces.
    for (const FullCube& cube : map_.cubes()) {
      Position low = corner_of(cube.morton), at = low;
      if (upward) at[axis] += cube.edge - kBrickEdge;
      const size_t u = (axis + 1u) % 3, v = (axis + 2u) % 3;
      for (at[u] = low[u]; at[u] < low[u] + cube.edge; at[u] += kBrickEdge)
        for (at[v] = low[v]; at[v] < low[v] + cube.edge; at[v] += kBrickEdge)
          visit(brick_morton(at), ~uint64_t{0}, upward ? 0 : bricks.size());
    }
  }

  // Returns the result of faces_of_brick() for a brick. The arguments are as in
  // for_each_outer_brick().
  uint64_t exposed(uint64_t morton, uint64_t mask, size_t from, uint8_t axis, bool upward) const {
    uint64_t neighbor = 0;
    if (mask & side_cells(axis, upward))
      neighbor = map_.mask_at(BrickMap::next_morton(morton, axis, upward), from, upward);
    return faces_of_brick(mask, neighbor, axis, upward);
  }

  static Position corner_of(uint64_t morton) {
    uint32_t x, y, z;
    morton_decode(morton, x, y, z);
    return {int64_t{x} * kBrickEdge, int64_t{y} * kBrickEdge, int64_t{z} * kBrickEdge};
  }

  void add_quads(uint8_t axis, bool upward, ExportStage& stage) {
    const uint64_t planes = (uint64_t{1} << job_.selection.grid_levels) + kBrickEdge + 1;
    PlaneSort faces(job_.budget, planes, kMemory);
    const MemoryCharge charge(job_.budget, outer_bricks_ * sizeof(uint64_t), kMemory);
    std::vector<uint64_t> masks;  // results of exposed(), in the order of for_each_outer_brick()
    masks.reserve(outer_bricks_);
    for_each_outer_brick(axis, upward, [&](uint64_t morton, uint64_t mask, size_t from) {
      const uint64_t found = masks.emplace_back(exposed(morton, mask, from, axis, upward));
      stage.advance(1);
      if (found == 0) return;
      const auto plane = static_cast<uint64_t>(corner_of(morton)[axis] + upward);
      for (size_t i = 0; i < kBrickEdge; ++i)
        faces.count(plane + i,
                    static_cast<uint64_t>(std::popcount(found & kBrickLayers.of[axis][i])));
    });
    faces.reserve();
    size_t next = 0;
    for_each_outer_brick(axis, upward, [&](uint64_t morton, uint64_t, size_t) {
      if (const uint64_t found = masks[next++]; found != 0)
        add_faces({corner_of(morton), found}, axis, upward, faces);
    });
    job_.cancel.check();
    merge(faces.sort(), axis, upward);
  }

  void add_faces(const Brick& brick, uint8_t axis, bool upward, PlaneSort& faces) const {
    const size_t u = (axis + 1u) % 3, v = (axis + 2u) % 3;
    const Position& low = job_.selection.region.low;
    for_each_cell_of(brick, [&](const Position& cell) {
      faces.add(static_cast<uint64_t>(cell[axis] + upward),
                face_of(static_cast<uint64_t>(cell[axis] - low[axis] + upward),
                        static_cast<uint64_t>(cell[v] - low[v]),
                        static_cast<uint64_t>(cell[u] - low[u])));
    });
  }

  // Returns the color of the cell to which a face belongs; black if the job has no colors.
  voxdag_reader::Rgb color_of(uint64_t face, uint8_t axis, bool upward) {
    if (!job_.has_colors) return {};
    std::array<int64_t, 3> cell = job_.selection.region.low;
    cell[(axis + 1u) % 3] += static_cast<int64_t>(face & kFaceCoordinateMask);
    cell[(axis + 2u) % 3] +=
        static_cast<int64_t>(face >> kFaceCoordinateBits & kFaceCoordinateMask);
    cell[axis] += static_cast<int64_t>(face >> 2 * kFaceCoordinateBits) - upward;
    return color_of_cell(job_, colors_, cell);
  }

  // Makes rectangles of sorted faces. Divides each row, which is the faces of one plane and one v,
  // into the longest runs of one color. If the previous row has a run with the same color, u0 and
  // u1, the run extends that run's rectangle; otherwise it begins a new rectangle.
  void merge(std::span<const uint64_t> faces, uint8_t axis, bool upward) {
    std::vector<size_t> row, previous;  // rectangles of the current row and of the previous row
    size_t candidate = 0;
    GlbQuad last{};
    voxdag_reader::Rgb next;  // color of the first face after the current run
    if (!faces.empty()) next = color_of(faces[0], axis, upward);
    for (size_t i = 0; i < faces.size() && quads_.size() <= max_quads_;) {
      GlbQuad run;
      run.color = next;
      size_t end = i;
      while (++end < faces.size()) {
        if (end % 65536 == 0) job_.cancel.check();
        next = color_of(faces[end], axis, upward);
        if (faces[end] != faces[end - 1] + 1 || next != run.color) break;
      }
      run.axis = axis;
      run.upward = upward;
      run.u0 = static_cast<uint32_t>(faces[i] & kFaceCoordinateMask);
      run.u1 = run.u0 + static_cast<uint32_t>(end - i);
      run.v0 = static_cast<uint32_t>(faces[i] >> kFaceCoordinateBits & kFaceCoordinateMask);
      run.v1 = run.v0 + 1;
      run.plane = static_cast<uint32_t>(faces[i] >> 2 * kFaceCoordinateBits);
      i = end;
      if (run.plane != last.plane || run.v0 != last.v0) {
        previous.clear();
        if (run.plane == last.plane && run.v0 == last.v0 + 1) previous.swap(row);
        row.clear();
        candidate = 0;
      }
      last = run;
      while (candidate < previous.size() && quads_[previous[candidate]].u0 < run.u0) ++candidate;
      if (candidate < previous.size() && quads_[previous[candidate]].u0 == run.u0 &&
          quads_[previous[candidate]].u1 == run.u1 &&
          quads_[previous[candidate]].color == run.color) {
        quads_[previous[candidate]].v1 = run.v1;
        row.push_back(previous[candidate]);
      } else {
        row.push_back(add(run));
      }
    }
  }

  size_t add(const GlbQuad& quad) {
    if (quads_.size() == quads_.capacity()) {
      const size_t count = std::max<size_t>(1024, 2 * quads_.capacity());
      MemoryCharge charge(job_.budget, count * sizeof(GlbQuad), kMemory);
      quads_.reserve(count);
      quads_charge_ = std::move(charge);
    }
    quads_.push_back(quad);
    return quads_.size() - 1;
  }

  const ExportJob& job_;
  const uint64_t max_quads_;
  voxdag_reader::ColorCursor colors_;
  MemoryCharge bricks_charge_, quads_charge_;
  BrickMap map_;
  uint64_t outer_bricks_ = 0;  // calls of for_each_outer_brick()'s visitor
  std::vector<GlbQuad> quads_;
  uint64_t voxels_ = 0;
};

// Returns the corners of a rectangle, counterclockwise as seen from outside.
std::array<std::array<float, 3>, 4> corners_of(const GlbQuad& quad) {
  const std::array<std::array<uint32_t, 2>, 4> around = {
      {{quad.u0, quad.v0}, {quad.u1, quad.v0}, {quad.u1, quad.v1}, {quad.u0, quad.v1}}};
  std::array<std::array<float, 3>, 4> corners{};
  for (size_t i = 0; i < 4; ++i) {
    const auto& at = around[quad.upward ? i : 3 - i];
    corners[i][quad.axis] = static_cast<float>(quad.plane);
    corners[i][(quad.axis + 1u) % 3] = static_cast<float>(at[0]);
    corners[i][(quad.axis + 2u) % 3] = static_cast<float>(at[1]);
  }
  return corners;
}

std::string numbers_text(const std::array<double, 3>& numbers) {
  return "[" + number_text(numbers[0]) + "," + number_text(numbers[1]) + "," +
         number_text(numbers[2]) + "]";
}

std::string glb_json(const ExportJob& job, const std::vector<GlbQuad>& quads) {
  std::array<double, 3> low{}, high{}, place{};
  low.fill(1e9);
  for (const GlbQuad& quad : quads)
    for (const auto& corner : corners_of(quad))
      for (size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], static_cast<double>(corner[axis]));
        high[axis] = std::max(high[axis], static_cast<double>(corner[axis]));
      }
  for (size_t axis = 0; axis < 3; ++axis)
    place[axis] = job.world(axis, static_cast<double>(job.selection.region.low[axis]));
  const uint64_t positions = quads.size() * 4 * 3 * sizeof(float);
  const uint64_t indices = quads.size() * 6 * sizeof(uint32_t);
  const uint64_t colors = job.has_colors ? quads.size() * kQuadColorBytes : 0;
  const std::string vertices = std::to_string(quads.size() * 4);
  const double edge = job.cell_edge();
  std::string json =
      "{\"asset\":{\"version\":\"2.0\",\"generator\":\"voxdag\"},\"scene\":0,"
      "\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0,\"translation\":" +
      numbers_text(place) + ",\"scale\":" + numbers_text({edge, edge, edge}) +
      "}],\"materials\":[{\"pbrMetallicRoughness\":{" +
      (job.has_colors ? "" : "\"baseColorFactor\":[0.7,0.7,0.7,1],") +
      "\"metallicFactor\":0}}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0" +
      (job.has_colors ? ",\"COLOR_0\":2" : "") +
      "},\"indices\":1,\"material\":0}]}],\"accessors\":[{\"bufferView\":0,\"componentType\":5126,"
      "\"count\":" +
      vertices + ",\"type\":\"VEC3\",\"min\":" + numbers_text(low) +
      ",\"max\":" + numbers_text(high) +
      "},{\"bufferView\":1,\"componentType\":5125,\"count\":" + std::to_string(quads.size() * 6) +
      ",\"type\":\"SCALAR\"}" +
      (job.has_colors ? ",{\"bufferView\":2,\"componentType\":5123,\"normalized\":true,\"count\":" +
                            vertices + ",\"type\":\"VEC4\"}"
                      : "") +
      "],\"bufferViews\":[{\"buffer\":0,\"byteLength\":" + std::to_string(positions) +
      ",\"target\":34962},{\"buffer\":0,\"byteOffset\":" + std::to_string(positions) +
      ",\"byteLength\":" + std::to_string(indices) + ",\"target\":34963}" +
      (job.has_colors ? ",{\"buffer\":0,\"byteOffset\":" + std::to_string(positions + indices) +
                            ",\"byteLength\":" + std::to_string(colors) + ",\"target\":34962}"
                      : "") +
      "],\"buffers\":[{\"byteLength\":" + std::to_string(positions + indices + colors) + "}]}";
  json.append((4 - json.size() % 4) % 4, ' ');
  return json;
}

// Writes the colors of a rectangle's four vertices. Alpha is included because each color must start
// at a multiple of four bytes.
void put_colors(voxdag_reader::Rgb color, ExportFile& file) {
  const auto& linear = linear_of_srgb();
  const std::array<uint16_t, 4> vertex = {linear[color.r], linear[color.g], linear[color.b], 65535};
  for (int i = 0; i < 4; ++i) file.write(std::as_bytes(std::span(vertex)));
}

void put_glb(const ExportJob& job, const std::vector<GlbQuad>& quads, ExportFile& file) {
  const std::string json = glb_json(job, quads);
  const uint64_t binary = quads.size() * quad_bytes(job);
  file.write("glTF");
  file.put<uint32_t>(2);
  file.put(static_cast<uint32_t>(12 + 8 + json.size() + 8 + binary));
  file.put(static_cast<uint32_t>(json.size()));
  file.write("JSON");
  file.write(json);
  file.put(static_cast<uint32_t>(binary));
  file.write(std::string_view("BIN\0", 4));
  ExportStage stage(job, "export", (job.has_colors ? 3 : 2) * quads.size(), "rectangles");
  for (const GlbQuad& quad : quads) {
    for (const auto& corner : corners_of(quad)) file.write(std::as_bytes(std::span(corner)));
    stage.advance(1);
  }
  for (uint32_t i = 0; i < quads.size(); ++i) {
    for (const uint32_t corner : {0, 1, 2, 0, 2, 3}) file.put(4 * i + corner);
    stage.advance(1);
  }
  if (job.has_colors)
    for (const GlbQuad& quad : quads) {
      put_colors(quad.color, file);
      stage.advance(1);
    }
}

}  // namespace

ExportReport write_glb(const ExportJob& job) { return write_glb_within(job, kMaxGlbBytes); }

ExportReport write_glb_within(const ExportJob& job, uint64_t max_bytes) {
  const uint64_t limit = max_quads(job, max_bytes);
  std::optional<GlbSurface> made(std::in_place, job, limit);
  const uint64_t quads = made->quads().size();
  if (quads > limit) {
    made.reset();  // frees memory for the search below
    // Finds grids that fit even if no faces are merged, because a cell has at most 6 faces.
    CellLimit cells(job, limit / 6);
    refuse_size(job,
                "over " + count_text(limit) + " rectangles are needed" +
                    (job.has_colors ? " with colors (--gray merges more)" : "") +
                    ", but a .glb file has at most " + size_text(max_bytes),
                [&](uint32_t level) { return cells.fits(level); });
  }
  const GlbSurface& surface = *made;
  require_space(job, quads * quad_bytes(job) + kMaxGlbJsonBytes);
  ExportReport report;
  report.voxels = surface.voxels();
  ExportFile file(job.files, job.output);
  put_glb(job, surface.quads(), file);
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  report.notes.push_back(count_text(quads) + " rectangles, " + count_text(2 * quads) +
                         " triangles");
  return report;
}

}  // namespace voxdag::query
