#include "query/package/color_bands.h"

#include <algorithm>

#include "core/format/global/open_global.h"
#include "core/geometry/morton.h"
#include "query/package/gzip_block.h"
#include "query/tiles/node_checks.h"

namespace voxdag::query {
namespace {

constexpr uint32_t kPageDepth = 3;         // levels from the cube of a page to its cells
constexpr size_t kColorBlockWords = 4096;  // a block ends with the page that reaches this size

std::array<uint64_t, 3> page_position(uint64_t code) {
  uint32_t x = 0, y = 0, z = 0;
  morton_decode(code, x, y, z);
  return {x, y, z};
}

}  // namespace

void ColorBands::write_levels(uint32_t last) {
  if (!file_.has_colors()) return;
  for (; next_level_ <= std::min(last, file_.color_levels()); ++next_level_)
    write_level(next_level_);
}

void ColorBands::write_level(uint32_t level) {
  level_ = level;
  packs_.begin_band(true, level);
  ColorPages encoder(file_, dag_, &blocks_);
  visit(0, dag_.root(), 0, encoder);
  if (!block_.empty()) end_block();
}

// Adds the pages that are in one cube of the octree. `depth` is the level of the cube, `content`
// its node or brick (DagView), and `code` the Morton code of its position in cubes of this level.
void ColorBands::visit(uint32_t depth, uint64_t content, uint64_t code, ColorPages& encoder) {
  if (depth + kPageDepth >= std::max(level_, kPageDepth)) return add_page(code, encoder);
  NodeChecks(dag_, depth, &blocks_).expect_intact(content);
  const DagView::Children children = dag_.children(depth, content);
  for (int i = 0; i < 8; ++i)
    if (children.has(i))
      visit(depth + 1, dag_.content(depth, children, i), 8 * code + static_cast<uint64_t>(i),
            encoder);
}

void ColorBands::add_page(uint64_t code, ColorPages& encoder) {
  block_.push_back({code, encoder.encode({level_, page_position(code)})});
  block_words_ += block_.back().words.size();
  ++pages_;
  if (block_words_ >= kColorBlockWords) end_block();
}

void ColorBands::end_block() {
  packs_.add_block(gzip_block(encode_color_block(block_)), block_.size(), block_[0].code);
  block_.clear();
  block_words_ = 0;
  cancel_.check();
}

}  // namespace voxdag::query
