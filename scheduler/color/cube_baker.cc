#include "scheduler/color/cube_baker.h"

#include <algorithm>
#include <array>
#include <numeric>

#include "core/base/error.h"
#include "core/color/blocks/value_region.h"
#include "core/color/color_of.h"
#include "core/geometry/morton.h"
#include "core/geometry/octree_descent.h"
#include "scheduler/color/region_record.h"
#include "scheduler/memory_plan.h"

namespace voxdag {
namespace {

// Of a surface in memory: itself, once more for its region, and its number in the lists of cubes.
constexpr uint64_t kSurfaceBytes = 2 * sizeof(FixedSurface) + 4 * sizeof(uint32_t);
// Records for a child cube that are collected before they go to the store.
constexpr size_t kPartBytes = 32 << 10;

AttributeSet set_of(std::span<const StoredAttribute> attributes) {
  AttributeSet set;
  for (const StoredAttribute& attribute : attributes) set.add(attribute.kind);
  return set;
}

}  // namespace

CubeBaker::CubeBaker(const ColorGrid& grid, std::span<const StoredAttribute> attributes,
                     std::span<const Material> materials, TextureReader& textures,
                     SurfaceStore& store, uint64_t surface_bytes, MemoryBudget& budget,
                     const CancelToken& cancel)
    : grid_(grid),
      attributes_(attributes),
      store_(store),
      surface_bytes_(surface_bytes),
      budget_(budget),
      cancel_(cancel),
      charge_(budget, ColorMemory::region_bytes(set_of(attributes)), "baking colors"),
      records_charge_(budget, 0, "colors of a cube"),
      baker_(grid, materials, textures, set_of(attributes)) {}

void CubeBaker::bake(const Cube& cube, SurfaceStore::Bin& bin, Records& records) {
  if (bin.surfaces == 0) return;
  const uint64_t bytes = bin.surfaces * kSurfaceBytes;
  if (bytes > surface_bytes_) return divide(cube, bin, records);
  const MemoryCharge charge(budget_, bytes, "surfaces to be baked");
  surfaces_.clear();
  surfaces_.reserve(bin.surfaces);
  store_.for_each(bin, [&](const FixedSurface& surface) { surfaces_.push_back(surface); });
  store_.clear(bin);
  std::vector<uint32_t> all(surfaces_.size());
  std::iota(all.begin(), all.end(), 0u);
  descend(cube, all, records);
  surfaces_ = {};
  touching_ = {};
}

// Too many surfaces for the memory: those of the eight children are stored apart.
void CubeBaker::divide(const Cube& cube, SurfaceStore::Bin& bin, Records& records) {
  if (cube.level == grid_.region_level()) return bake_in_parts(cube, bin, records);
  std::array<SurfaceStore::Bin, 8> children;
  SurfaceWriter writer(store_, children, kPartBytes * children.size());
  std::vector<std::byte> record;
  const int64_t units = cube.edge_voxels(grid_.levels) * kUnitsPerVoxel;
  store_.for_each(bin, [&](const FixedSurface& surface) {
    record.clear();
    // Whether it has an image does not matter for what was stored without coordinates.
    append_surface(surface, true, record);
    for (uint32_t mask = touched_children(surface.position, cube, units); mask; mask &= mask - 1)
      writer.append(static_cast<size_t>(lowest_bit(mask)), record);
  });
  store_.clear(bin);
  writer.flush();
  for (int child = 0; child < 8; ++child) {
    cancel_.check();
    bake(cube.child(child), children[static_cast<size_t>(child)], records);
  }
}

void CubeBaker::descend(const Cube& cube, std::span<const uint32_t> touching, Records& records) {
  if (touching.empty()) return;
  if (cube.level == grid_.region_level()) return bake_region(cube, touching, records);
  std::array<std::vector<uint32_t>, 8> parts;
  const int64_t units = cube.edge_voxels(grid_.levels) * kUnitsPerVoxel;
  for (const uint32_t i : touching)
    for (uint32_t mask = touched_children(surfaces_[i].position, cube, units); mask;
         mask &= mask - 1)
      parts[static_cast<size_t>(lowest_bit(mask))].push_back(i);
  for (int child = 0; child < 8; ++child)
    descend(cube.child(child), parts[static_cast<size_t>(child)], records);
}

void CubeBaker::bake_region(const Cube& region, std::span<const uint32_t> touching,
                            Records& records) {
  cancel_.check();
  touching_.clear();
  for (const uint32_t i : touching) touching_.push_back(surfaces_[i]);
  baker_.begin(region);
  baker_.add(touching_);
  append(region, records);
}

// A region is not divided: its sums take what they take, and the surfaces come one part after the
// other.
void CubeBaker::bake_in_parts(const Cube& region, SurfaceStore::Bin& bin, Records& records) {
  const size_t most = std::max<size_t>(surface_bytes_ / sizeof(FixedSurface), 1);
  const MemoryCharge charge(budget_, most * sizeof(FixedSurface), "surfaces to be baked");
  touching_.clear();
  touching_.reserve(most);
  baker_.begin(region);
  const auto add_part = [&] {
    cancel_.check();
    baker_.add(touching_);
    touching_.clear();
  };
  store_.for_each(bin, [&](const FixedSurface& surface) {
    touching_.push_back(surface);
    if (touching_.size() == most) add_part();
  });
  add_part();
  store_.clear(bin);
  append(region, records);
  touching_ = {};
}

void CubeBaker::append(const Cube& region, Records& records) {
  // Before finish(), which frees the sums.
  const uint64_t sums = baker_.attribute_bytes();
  const MemoryCharge charge(budget_, sums - std::min<uint64_t>(sums, ColorMemory::kValueBytes),
                            "normals and materials of a region");
  baker_.finish(cells_, values_);
  if (cells_.empty()) return;
  const uint64_t morton = morton_encode(region.position[0], region.position[1], region.position[2]);
  for (size_t i = 0; i < attributes_.size(); ++i) {
    const EncodedRegion encoded = encode(attributes_[i], morton);
    // Twice the bytes are there while the vector grows.
    uint64_t bytes = encoded.blocks.size();
    for (const auto& of_attribute : records) bytes += of_attribute.size();
    if (3 * bytes > records_charge_.bytes() && !records_charge_.try_resize(3 * bytes))
      throw Error(ErrorCode::kOutOfMemory,
                  "not enough memory for the colors of one cube: expected "
                  "more memory, fewer threads, or a coarser color grid");
    append_region(encoded, records[i]);
  }
}

EncodedRegion CubeBaker::encode(const StoredAttribute& attribute, uint64_t morton) {
  const uint32_t levels = grid_.color_levels - grid_.region_level();
  if (attribute.kind == Attribute::kColor) return encode_region(levels, morton, cells_);
  valued_.clear();
  for (size_t i = 0; i < cells_.size(); ++i) {
    const uint32_t value = attribute.kind == Attribute::kAlpha
                               ? alpha_of(cells_[i].sum)
                               : value_of(values_[i], attribute.kind);
    valued_.push_back({cells_[i].code, value});
  }
  return encode_values(attribute.kind, attribute.value_bytes, levels, morton, valued_);
}

}  // namespace voxdag
