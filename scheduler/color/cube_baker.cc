#include "scheduler/color/cube_baker.h"

#include <array>
#include <numeric>
#include <string>

#include "core/base/error.h"
#include "core/geometry/morton.h"
#include "core/geometry/octree_descent.h"
#include "scheduler/memory_plan.h"

namespace voxdag {
namespace {

// Of a surface in memory: itself, once more for its region, and its number in the lists of cubes.
constexpr uint64_t kSurfaceBytes = 2 * sizeof(FixedSurface) + 4 * sizeof(uint32_t);
// Records for a child cube that are collected before they go to the store.
constexpr size_t kPartBytes = 32 << 10;

}  // namespace

CubeBaker::CubeBaker(const ColorGrid& grid, std::span<const Material> materials,
                     TextureReader& textures, SurfaceStore& store, uint64_t surface_bytes,
                     MemoryBudget& budget, const CancelToken& cancel)
    : grid_(grid),
      store_(store),
      surface_bytes_(surface_bytes),
      budget_(budget),
      cancel_(cancel),
      charge_(budget, ColorMemory::kRegionBytes, "baking colors"),
      baker_(grid, materials, textures) {}

void CubeBaker::bake(const Cube& cube, SurfaceStore::Bin& bin,
                     std::vector<EncodedRegion>& regions) {
  if (bin.surfaces == 0) return;
  const uint64_t bytes = bin.surfaces * kSurfaceBytes;
  if (bytes > surface_bytes_) return divide(cube, bin, regions);
  const MemoryCharge charge(budget_, bytes, "surfaces to be baked");
  surfaces_.clear();
  surfaces_.reserve(bin.surfaces);
  store_.for_each(bin, [&](const FixedSurface& surface) { surfaces_.push_back(surface); });
  store_.clear(bin);
  std::vector<uint32_t> all(surfaces_.size());
  std::iota(all.begin(), all.end(), 0u);
  descend(cube, all, regions);
  surfaces_ = {};
  touching_ = {};
}

// Too many surfaces for the memory: those of the eight children are stored apart.
void CubeBaker::divide(const Cube& cube, SurfaceStore::Bin& bin,
                       std::vector<EncodedRegion>& regions) {
  if (cube.level == grid_.region_level())
    throw Error(ErrorCode::kOutOfMemory,
                "the region of 64^3 color cells at (" + std::to_string(cube.position[0]) + ", " +
                    std::to_string(cube.position[1]) + ", " + std::to_string(cube.position[2]) +
                    ") has " + std::to_string(bin.surfaces) + " triangles, which take " +
                    std::to_string(bin.surfaces * kSurfaceBytes >> 20) + " MiB of " +
                    std::to_string(surface_bytes_ >> 20) +
                    ": expected more --memory, fewer --threads or a larger --color-resolution");
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
    bake(cube.child(child), children[static_cast<size_t>(child)], regions);
  }
}

void CubeBaker::descend(const Cube& cube, std::span<const uint32_t> touching,
                        std::vector<EncodedRegion>& regions) {
  if (touching.empty()) return;
  if (cube.level == grid_.region_level()) return bake_region(cube, touching, regions);
  std::array<std::vector<uint32_t>, 8> parts;
  const int64_t units = cube.edge_voxels(grid_.levels) * kUnitsPerVoxel;
  for (const uint32_t i : touching)
    for (uint32_t mask = touched_children(surfaces_[i].position, cube, units); mask;
         mask &= mask - 1)
      parts[static_cast<size_t>(lowest_bit(mask))].push_back(i);
  for (int child = 0; child < 8; ++child)
    descend(cube.child(child), parts[static_cast<size_t>(child)], regions);
}

void CubeBaker::bake_region(const Cube& region, std::span<const uint32_t> touching,
                            std::vector<EncodedRegion>& regions) {
  cancel_.check();
  touching_.clear();
  for (const uint32_t i : touching) touching_.push_back(surfaces_[i]);
  baker_.bake(region, touching_, cells_);
  if (cells_.empty()) return;
  const uint64_t morton = morton_encode(region.position[0], region.position[1], region.position[2]);
  regions.push_back(encode_region(grid_.color_levels - grid_.region_level(), morton, cells_));
}

}  // namespace voxdag
