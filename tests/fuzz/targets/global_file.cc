// Reads global files: opening, lookups, colors, rays, tiles and verification. global_bytes.h
// describes the inputs.
#include <algorithm>

#include "core/base/error.h"
#include "core/format/global/checked_blocks.h"
#include "core/format/global/open_global.h"
#include "core/format/global/voxdag_reader.h"
#include "query/rays/ray_caster.h"
#include "query/render/views.h"
#include "query/tiles/color_page.h"
#include "query/tiles/tile.h"
#include "tests/fuzz/support/fuzz_target.h"
#include "tests/fuzz/support/global_bytes.h"

namespace voxdag {
namespace {

constexpr uint64_t kMaxVisits = 4096;

// Visits at most kMaxVisits nodes of the octree, and reads the color and the other attributes of
// each visited cube.
struct BoundedVisitor {
  const voxdag_reader::File& file;
  uint64_t left = kMaxVisits;
  voxdag_reader::ColorCursor cursors[4] = {{file, file.colors()},
                                           {file, file.alphas()},
                                           {file, file.normals()},
                                           {file, file.materials()}};

  bool node(uint32_t level, int64_t x, int64_t y, int64_t z, uint64_t) {
    if (left == 0) return false;
    --left;
    look_at(level, x, y, z);
    return true;
  }
  void brick(int64_t x, int64_t y, int64_t z, uint64_t mask, uint64_t) {
    for (int64_t i = 0; i < 64; i += 21) {
      const int64_t vx = x + (i >> 5 & 1) * 2 + (i >> 2 & 1),
                    vy = y + (i >> 4 & 1) * 2 + (i >> 1 & 1), vz = z + (i >> 3 & 1) * 2 + (i & 1);
      if (mask >> i & 1) look_at(file.grid_levels(), vx, vy, vz);
    }
  }
  void look_at(uint32_t level, int64_t x, int64_t y, int64_t z) {
    const uint32_t up = file.grid_levels() - level;
    const voxdag_reader::ColorSection* const sections[] = {&file.colors(), &file.alphas(),
                                                           &file.normals(), &file.materials()};
    for (size_t kind = 0; kind < 4; ++kind) {
      uint64_t i;
      const auto* const region = cursors[kind].find(x >> up, y >> up, z >> up, level, i);
      fuzz::require((region != nullptr) == (sections[kind]->tier_count() > 0),
                    "what is set has an attribute if anything has");
      if (region && kind == 0) (void)region->color(i);
      if (region && kind == 2) (void)region->normal(i);
      if (region && kind > 0) (void)region->value(i);
    }
  }
};

void read_all(const voxdag_reader::File& file) {
  BoundedVisitor visitor{file};
  file.walk(visitor);
  const int64_t last = file.resolution() - 1;
  for (const int64_t at : {int64_t{0}, last / 3, last}) (void)file.voxel(at, last - at, at / 2);
}

void cast_rays(const voxdag_reader::File& file) {
  const query::DagView view(file);
  if (view.empty()) return;
  const double edge = static_cast<double>(file.resolution());
  for (const query::Vec toward :
       {query::Vec{{1, 0.3, 0.2}}, query::Vec{{0, 0, -1}}, query::Vec{{-0.5, 1, 1}}}) {
    const query::Vec direction = query::normalized(toward);
    const query::Ray ray{query::Vec{{edge / 2, edge / 2, edge / 2}} + direction * (-2 * edge),
                         direction};
    query::Hit hit;
    query::RayCaster(view).cast(ray, {edge / 512, 0}, 0, 4 * edge, hit);
  }
}

// Encodes a tile at the first node of each level above the bricks.
void encode_tiles(const voxdag_reader::File& file) {
  const query::DagView view(file);
  uint64_t offset = 0;
  for (uint32_t level = 0; !view.empty() && level < file.brick_level(); ++level) {
    query::encode_tile(view, 1 + level % 3, {level, offset});
    offset = file.node(level, offset).child(0);
  }
}

// Requests tiles and color pages with arbitrary words of the file as addresses. Even in a valid
// file, such an address often does not lead to a node, so errors about corruption are allowed.
void answer_strangers(const voxdag_reader::File& file) {
  const query::DagView view(file);
  const CheckedBlocks blocks(file);
  query::ColorPages pages(file, view, &blocks);
  const auto try_to = [](auto make) {
    try {
      make();
    } catch (const Error& error) {
      fuzz::require(error.is_corruption(), "what is not there is an error that says so");
    }
  };
  const uint32_t* const words = reinterpret_cast<const uint32_t*>(file.data());
  const uint64_t count = std::min<uint64_t>(file.checksum_table_offset() / 4, 4096);
  for (uint64_t at = count / 2; at + 4 < count; at += 97) {
    try_to([&] {
      query::encode_tile(view, 1 + words[at] % 5, {words[at] % 20, words[at + 1]}, &blocks);
    });
    try_to([&] {
      pages.encode({words[at] % 21, {words[at + 1], words[at + 2] % 64, words[at + 3] % 64}});
    });
  }
  if (!view.empty()) try_to([&] { query::occupied_box(view); });
}

}  // namespace
}  // namespace voxdag

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  const fuzz::NamelessFile bytes(fuzz::make_file(fuzz::bytes_of(data, size)));
  try {
    const voxdag_reader::File file(bytes.path());
    fuzz::require(file.first_damaged_block() == 0, "checksums that fit are found to fit");
    const bool is_sound = fuzz::is_sound(file);
    try {
      read_all(file);
      cast_rays(file);
      encode_tiles(file);
      answer_strangers(file);
    } catch (const std::exception&) {
      fuzz::require(!is_sound, "a file that verifies can be read");
      throw;
    }
  } catch (const voxdag_reader::Error&) {
  } catch (const Error&) {
  }
  return 0;
}
