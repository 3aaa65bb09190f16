#include "scheduler/stages/attributes/cube_baker.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/geometry/morton.h"
#include "core/geometry/octree_descent.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/attributes/region_record.h"

namespace voxdag {
namespace {

// Memory of a surface: the surface, and a copy for its region. Up to 14 nested cubes also list the
// surface's index and the mask of the children that the surface touches.
constexpr uint64_t kSurfaceBytes =
    2 * sizeof(FixedSurface) + 14 * (sizeof(uint32_t) + sizeof(uint8_t));
// Bytes of records that are collected for a child cube before they go to the store.
constexpr size_t kPartBytes = 16 << 10;

// Memory of a baked cell: its weight, its sum, a sorted copy of the sum, and its colors.
constexpr uint64_t kCellBytes =
    sizeof(color::CellWeight) + sizeof(ColorSum) + sizeof(ColoredCell) + 8;
// Other memory of a baker: positions of cells, the next coarser level, two parts of the records,
// and FlatRegion.
constexpr uint64_t kFixedBytes = uint64_t{6} << 20;

uint32_t max_cells_of(uint64_t region_bytes) {
  constexpr uint32_t kTriangleCells = RegionBaker<TextureReader>::kTriangleCells;
  static_assert(ColorMemory::kRegionBytes > kFixedBytes + 2 * kTriangleCells * kCellBytes);
  static_assert(FlatRegion::kMaxBytes < kFixedBytes / 2);
  static_assert(kTriangleCells <= FlatRegion::kMaxWaiting / 4);
  static_assert(ColorMemory::kSolidRegionBytes >
                kFixedBytes + (color::RegionCells::kMaxCells + kTriangleCells) * kCellBytes);
  return static_cast<uint32_t>(std::min<uint64_t>(
      (region_bytes - kFixedBytes) / kCellBytes - kTriangleCells, color::RegionCells::kMaxCells));
}

uint64_t morton_of(const Cube& cube) {
  return morton_encode(cube.position[0], cube.position[1], cube.position[2]);
}

AttributeSet set_of(std::span<const StoredAttribute> attributes) {
  AttributeSet set;
  for (const StoredAttribute& attribute : attributes) set.add(attribute.kind);
  return set;
}

}  // namespace

CubeBaker::CubeBaker(const ColorGrid& grid, std::span<const StoredAttribute> attributes,
                     std::span<const Material> materials, TextureReader& textures,
                     RecordStore& store, uint64_t region_bytes, uint64_t surface_bytes,
                     MemoryBudget& budget, const CancelToken& cancel, const Cutouts* cutouts)
    : grid_(grid),
      attributes_(attributes),
      materials_(materials),
      store_(store),
      surface_bytes_(surface_bytes),
      max_cells_(max_cells_of(region_bytes)),
      budget_(budget),
      cancel_(cancel),
      cutouts_(cutouts),
      charge_(budget, region_bytes + ColorMemory::value_bytes(set_of(attributes)), "baking colors"),
      sum_charge_(budget, 0, "normals and materials of a region"),
      baker_(grid, materials, textures, set_of(attributes), cutouts),
      flat_region_(grid) {}

void CubeBaker::bake(const Cube& cube, ChunkList& bin, Records& records, const TakeRecords& take) {
  bake(cube, bin, {records, take});
}

void CubeBaker::bake(const Cube& cube, ChunkList& bin, const Sink& sink) {
  if (bin.records == 0) return;
  const uint64_t bytes = bin.records * kSurfaceBytes;
  if (bytes > surface_bytes_) return divide(cube, bin, sink);
  const MemoryCharge charge(budget_, bytes, "surfaces to be baked");
  surfaces_.clear();
  surfaces_.reserve(bin.records);
  for_each_surface(store_, bin, [&](const FixedSurface& surface) { surfaces_.push_back(surface); });
  store_.clear(bin);
  std::vector<uint32_t> all(surfaces_.size());
  std::iota(all.begin(), all.end(), 0u);
  descend(cube, all, sink);
  surfaces_ = {};
  touching_ = {};
}

// Bakes a cube whose surfaces do not fit in memory: distributes the surfaces to the cube's eight
// children and bakes each child. If the cube is a single region, calls bake_in_parts() instead.
void CubeBaker::divide(const Cube& cube, ChunkList& bin, const Sink& sink) {
  if (cube.level == grid_.region_level()) return bake_in_parts(cube, bin, sink);
  std::array<ChunkList, 8> children;
  {
    ChunkWriter writer = surface_writer(store_, children, kPartBytes * children.size());
    std::vector<std::byte> record;
    const int64_t units = cube.edge_voxels(grid_.levels) * kUnitsPerVoxel;
    for_each_surface(store_, bin, [&](const FixedSurface& surface) {
      record.clear();
      // Passes true for has_image, so that texture coordinates are never dropped. A surface that
      // was stored without them, because its material has no image, gets zeros, which have no
      // effect.
      append_surface(surface, true, record);
      for (uint32_t mask = touched_children(surface.position, cube, units); mask; mask &= mask - 1)
        writer.append(static_cast<size_t>(lowest_bit(mask)), record, 1);
    });
    store_.clear(bin);
    writer.flush();
  }
  for (int child = 0; child < 8; ++child) {
    cancel_.check();
    bake(cube.child(child), children[static_cast<size_t>(child)], sink);
  }
}

void CubeBaker::descend(const Cube& cube, std::span<const uint32_t> touching, const Sink& sink) {
  if (touching.empty()) return;
  if (cube.level == grid_.region_level()) {
    touching_.clear();
    for (const uint32_t i : touching) touching_.push_back(surfaces_[i]);
    if (!bake_flat_region(cube, sink))
      bake_region(
          cube, [&](const auto& add) { add(touching_); }, sink);
    return;
  }
  std::vector<uint8_t> masks;
  masks.reserve(touching.size());
  const int64_t units = cube.edge_voxels(grid_.levels) * kUnitsPerVoxel;
  for (const uint32_t i : touching)
    masks.push_back(static_cast<uint8_t>(touched_children(surfaces_[i].position, cube, units)));
  std::vector<uint32_t> part;
  for (int child = 0; child < 8; ++child) {
    part.clear();
    for (size_t i = 0; i < touching.size(); ++i)
      if (masks[i] >> child & 1) part.push_back(touching[i]);
    descend(cube.child(child), part, sink);
  }
}

// Bakes a region whose surfaces do not fit in memory; they are read in several parts.
void CubeBaker::bake_in_parts(const Cube& region, ChunkList& bin, const Sink& sink) {
  const size_t most = std::max<size_t>(surface_bytes_ / sizeof(FixedSurface), 1);
  const MemoryCharge charge(budget_, most * sizeof(FixedSurface), "surfaces to be baked");
  touching_.clear();
  touching_.reserve(most);
  const auto add_all = [&](const auto& add) {
    const auto add_part = [&] {
      add(touching_);
      touching_.clear();
    };
    for_each_surface(store_, bin, [&](const FixedSurface& surface) {
      touching_.push_back(surface);
      if (touching_.size() == most) add_part();
    });
    add_part();
  };
  bake_region(region, add_all, sink);
  store_.clear(bin);
  touching_ = {};
}

// Bakes a region whose surfaces, touching_, all have the same flat color. Returns false without
// effect for all other regions, if attributes other than colors are wanted, and if FlatRegion
// refuses the region.
bool CubeBaker::bake_flat_region(const Cube& region, const Sink& sink) {
  if (attributes_.size() != 1 || attributes_[0].kind != Attribute::kColor) return false;
  const auto color = only_color_of(touching_, materials_, cutouts_);
  if (!color || !flat_region_.find(region, touching_)) return false;
  cancel_.check();
  append_region(encode_flat_region(grid_.color_levels - grid_.region_level(), morton_of(region),
                                   flat_region_.cells(), *color, flat_region_.weight()),
                sink.records[0]);
  if (sink.records[0].size() >= kManyRecordBytes) sink.take(sink.records);
  return true;
}

// Bakes a region, and appends its record for each attribute to sink.records. add_surfaces(add) must
// call add() with all surfaces of the region, in one part or several. If the region has too many
// cells for the memory, its eight children are baked separately.
template <class AddSurfaces>
void CubeBaker::bake_region(const Cube& region, const AddSurfaces& add_surfaces, const Sink& sink) {
  const uint32_t levels = grid_.color_levels - grid_.region_level();
  std::vector<AttributeEncoder> encoders;
  for (const auto& [kind, value_bytes] : attributes_)
    encoders.emplace_back(kind, value_bytes, levels);
  if (bake_cells(region, max_cells_, add_surfaces)) {
    collect(0, encoders);
  } else {
    const uint32_t cells_of_child = 1u << (3 * levels - 3);
    for (uint32_t child = 0; child < 8; ++child) {
      if (!bake_cells(region.child(static_cast<int>(child)), cells_of_child, add_surfaces))
        throw Error(
            ErrorCode::kOutOfMemory,
            "out of memory: the materials of a region of the color grid need more than the " +
                size_text(budget_.available()) + " that are free: expected more memory (" +
                option_text("memory") +
                "), fewer "
                "threads, or a finer color grid (" +
                option_text("color_resolution") + ")");
      collect(child * cells_of_child, encoders);
    }
  }
  const uint64_t morton = morton_of(region);
  size_t most = 0;
  for (size_t i = 0; i < attributes_.size(); ++i) {
    if (encoders[i].empty()) return;
    append_region(encoders[i].finish(morton), sink.records[i]);
    most = std::max(most, sink.records[i].size());
  }
  if (most >= kManyRecordBytes) sink.take(sink.records);
}

// Bakes the cells of a cube, for collect(). Returns false if the cube has more than `max_cells`
// cells, or if the sums of its normals and materials do not fit in memory.
template <class AddSurfaces>
bool CubeBaker::bake_cells(const Cube& cube, uint32_t max_cells, const AddSurfaces& add_surfaces) {
  bool is_complete = true;
  baker_.begin(cube, max_cells);
  add_surfaces([&](std::span<const FixedSurface> surfaces) {
    cancel_.check();
    is_complete =
        is_complete && baker_.add(surfaces, [&](uint64_t bytes) { return charge_sums(bytes); });
  });
  if (!is_complete) baker_.finish(cells_, values_);  // discards the cells
  return is_complete;
}

// Charges the memory of the sums of normals and materials, `bytes` in all. Returns false if the
// sums do not fit. Keeps an existing charge (of an earlier region) if it is large enough and
// exceeds the sums by at most kSlackBytes.
bool CubeBaker::charge_sums(uint64_t bytes) {
  constexpr uint64_t kSlackBytes = uint64_t{4} << 20;
  const uint64_t more = bytes - std::min(bytes, ColorMemory::kValueSumBytes);
  if (more <= sum_charge_.bytes() && sum_charge_.bytes() <= more + kSlackBytes) return true;
  return sum_charge_.try_resize(more);
}

// Adds the cells of the baked cube to the encoders of its region. `first_code` is the Morton code,
// within the region, of the cube's first cell.
void CubeBaker::collect(uint32_t first_code, std::span<AttributeEncoder> encoders) {
  if (encoders.size() == 1 && encoders[0].colors())
    return baker_.finish(first_code, *encoders[0].colors());
  baker_.finish(cells_, values_);
  for (AttributeEncoder& encoder : encoders) encoder.add(cells_, values_, first_code);
}

}  // namespace voxdag
