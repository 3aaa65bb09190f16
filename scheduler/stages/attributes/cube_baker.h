// Bakes the attributes in cubes of the color grid, one region (color_grid.h) after another. Each
// thread has its own CubeBaker.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/color/blocks/attribute_encoder.h"
#include "core/color/rule/bake_region.h"
#include "core/color/rule/flat_region.h"
#include "scene/textures/texture_set.h"
#include "scheduler/stages/attributes/color_keys.h"
#include "scheduler/triangles/surface_record.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class CubeBaker {
 public:
  // Records (region_record.h) of regions, for each attribute.
  using Records = std::vector<std::vector<std::byte>>;

  // Charges `region_bytes` (at least ColorMemory::kRegionBytes) and ColorMemory::value_bytes() to
  // `budget`. With more memory, regions are baked in fewer pieces. Surfaces in memory take another
  // `surface_bytes` at most. `cutouts` may be null. The references must outlive the baker.
  CubeBaker(const ColorGrid& grid, std::span<const StoredAttribute> attributes,
            std::span<const Material> materials, TextureReader& textures, RecordStore& store,
            uint64_t region_bytes, uint64_t surface_bytes, MemoryBudget& budget,
            const CancelToken& cancel, const Cutouts* cutouts = nullptr);

  // Receives the records collected so far, all of them complete, and empties the vectors.
  using TakeRecords = std::function<void(Records& records)>;
  // Bakes the regions of the cube that have surfaces, and appends their records in Morton order.
  // `bin` must contain all surfaces that touch the cube, and is cleared. `records` has one element
  // per attribute, in the order of the attributes. Calls take(records) whenever the records of one
  // attribute take kManyRecordBytes or more.
  void bake(const Cube& cube, ChunkList& bin, Records& records, const TakeRecords& take);

  static constexpr size_t kManyRecordBytes = 256 << 10;

 private:
  // The receiver of records.
  struct Sink {
    Records& records;
    const TakeRecords& take;
  };

  void bake(const Cube& cube, ChunkList& bin, const Sink& sink);
  void divide(const Cube& cube, ChunkList& bin, const Sink& sink);
  void descend(const Cube& cube, std::span<const uint32_t> touching, const Sink& sink);
  void bake_in_parts(const Cube& region, ChunkList& bin, const Sink& sink);
  bool bake_flat_region(const Cube& region, const Sink& sink);
  template <class AddSurfaces>
  void bake_region(const Cube& region, const AddSurfaces& add_surfaces, const Sink& sink);
  template <class AddSurfaces>
  bool bake_cells(const Cube& cube, uint32_t max_cells, const AddSurfaces& add_surfaces);
  bool charge_sums(uint64_t bytes);
  void collect(uint32_t first_code, std::span<AttributeEncoder> encoders);

  const ColorGrid grid_;
  const std::span<const StoredAttribute> attributes_;
  const std::span<const Material> materials_;
  RecordStore& store_;
  const uint64_t surface_bytes_;
  const uint32_t max_cells_;  // maximum number of cells of a region that are baked in one piece
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const Cutouts* const cutouts_;
  const MemoryCharge charge_;
  MemoryCharge sum_charge_;  // charge for sums that exceed ColorMemory::kValueSumBytes
  RegionBaker<TextureReader> baker_;
  FlatRegion flat_region_;
  std::vector<FixedSurface> surfaces_;  // surfaces of the cube
  std::vector<FixedSurface> touching_;  // surfaces of a region, or a part of them
  std::vector<ColoredCell> cells_;
  std::vector<CellValues> values_;
};

}  // namespace voxdag
