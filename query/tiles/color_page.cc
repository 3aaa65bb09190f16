#include "query/tiles/color_page.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>

#include "core/base/error.h"
#include "core/format/color/color_layout.h"
#include "core/format/global/open_global.h"

namespace voxdag::query {
namespace {

// Number of levels from a page's root to its cells. A page of level 0, 1 or 2 has fewer: its root
// is the DAG's root.
constexpr uint32_t kPageLevels = 3;
constexpr size_t kMaskWords = 16, kHeadWords = 1 + kMaskWords;
constexpr uint64_t kBlockCells = 32;
constexpr size_t kBlockWords = 4;
constexpr uint32_t kSkipShift = 16, kSingleColors = 1u << 24;

void check_address(const voxdag_reader::File& file, const ColorPageAddress& page) {
  if (!file.has_colors())
    throw Error(ErrorCode::kNotFound, "the file has no colors: expected a file built with colors");
  const uint32_t levels = file.color_levels();
  if (page.level > levels)
    throw Error(ErrorCode::kNotFound, "level " + std::to_string(page.level) +
                                          " has no colors: expected a level from 0 to " +
                                          std::to_string(levels));
  const uint64_t edge = uint64_t{1} << (page.level - std::min(page.level, kPageLevels));
  const auto& [x, y, z] = page.position;
  if (x >= edge || y >= edge || z >= edge)
    throw Error(ErrorCode::kNotFound, "color page " + std::to_string(x) + "." + std::to_string(y) +
                                          "." + std::to_string(z) + " of level " +
                                          std::to_string(page.level) +
                                          " is outside the grid: expected each number to be 0 to " +
                                          std::to_string(edge - 1));
}

// Returns the position of a cell of the page from its Morton code within the page.
std::array<int64_t, 3> cell_of(const ColorPageAddress& page, uint32_t code) {
  std::array<int64_t, 3> cell;
  for (uint32_t axis = 0; axis < 3; ++axis) {
    uint32_t within = 0;
    for (uint32_t bit = 0; bit < kPageLevels; ++bit)
      within |= (code >> (3 * bit + 2 - axis) & 1) << bit;
    cell[axis] = static_cast<int64_t>(page.position[axis] << kPageLevels | within);
  }
  return cell;
}

uint32_t first_bit(const uint32_t* mask) {
  uint32_t word = 0;
  while (mask[word] == 0) ++word;
  return 32 * word + static_cast<uint32_t>(std::countr_zero(mask[word]));
}

}  // namespace

// Returns the children of a node or brick. Verifies a node, because this call reads it. A brick is
// already verified: content() has read its mask, which is its content (dag_view.h).
DagView::Children ColorPages::children(uint32_t depth, uint64_t content) const {
  if (depth < file_->brick_level()) checked_file_.expect_intact(depth, content);
  return dag_->children(depth, content);
}

uint64_t ColorPages::content(uint32_t depth, const DagView::Children& children, int index) const {
  if (depth + 1 == file_->brick_level())
    checked_file_.expect_intact(depth + 1, dag_->offset(children, index));
  return dag_->content(depth, children, index);
}

// Sets the bits of the page's set cells in a cell at `depth`, which is `below` levels above the
// page's cells. The bits of `mask` are in the Morton order of the page's cells. `code` is the
// Morton code of the cell at `depth` within the page.
void ColorPages::set_bits(uint32_t depth, uint64_t content, uint32_t below, uint32_t code,
                          uint32_t* mask) const {
  if (below == 0) {
    mask[code / 32] |= 1u << code % 32;
    return;
  }
  const DagView::Children c = children(depth, content);
  for (int i = 0; i < 8; ++i)
    if (c.has(i))
      set_bits(depth + 1, this->content(depth, c, i), below - 1,
               8 * code + static_cast<uint32_t>(i), mask);
}

void ColorPages::set_mask(const ColorPageAddress& page, uint32_t* mask) const {
  const uint32_t below = std::min(page.level, kPageLevels), root = page.level - below;
  if (file_->brick_level() == 0) checked_file_.expect_intact(0, 0);
  uint64_t content = dag_->root();
  for (uint32_t depth = 0; depth < root; ++depth) {
    int child = 0;
    for (const uint64_t c : page.position)
      child = 2 * child + static_cast<int>(c >> (root - depth - 1) & 1);
    const DagView::Children c = children(depth, content);
    if (!c.has(child)) return;
    content = this->content(depth, c, child);
  }
  set_bits(root, content, below, 0, mask);
}

// Verifies the checksums of all data that cursor_ will read to find the color of `cell`: the
// directory entries that a binary search reads, and all bytes of the region that contains the cell.
void ColorPages::check_region(const voxdag_reader::ColorTier& tier, uint32_t level,
                              const std::array<int64_t, 3>& cell) const {
  if (!blocks_) return;
  const uint64_t morton =
      voxdag_reader::morton_code(cell[0], cell[1], cell[2]) >> 3 * (level - tier.region_level);
  uint64_t low = 0;
  for (uint64_t high = tier.region_count; low < high;) {
    const uint64_t middle = low + (high - low) / 2;
    const unsigned char* const entry = tier.directory + color_layout::kRegionEntryBytes * middle;
    blocks_->expect_intact(entry, color_layout::kRegionEntryBytes);
    uint64_t there;
    std::memcpy(&there, entry, sizeof there);
    if (there < morton)
      low = middle + 1;
    else
      high = middle;
  }
  voxdag_reader::ColorRegion region;
  if (low < tier.region_count) {
    blocks_->expect_intact(tier.directory + color_layout::kRegionEntryBytes * low,
                           color_layout::kRegionEntryBytes);
    if (voxdag_reader::ColorSection::region(tier, low, region))
      blocks_->expect_intact(region.blocks, color_layout::kUnitBytes * region.units());
  }
}

std::vector<uint32_t> ColorPages::encode(const ColorPageAddress& address) {
  check_address(*file_, address);
  std::vector<uint32_t> words(kHeadWords);
  set_mask(address, words.data() + 1);
  for (size_t i = 0; i < kMaskWords; ++i)
    words[0] += static_cast<uint32_t>(std::popcount(words[1 + i]));
  if (words[0] == 0) return {0};
  with_reader_errors([&] { add_colors(address, words); });
  return words;
}

// Returns the name of a cell for messages.
static std::string cell_text(uint32_t level, const std::array<int64_t, 3>& cell) {
  return "cell " + std::to_string(cell[0]) + " " + std::to_string(cell[1]) + " " +
         std::to_string(cell[2]) + " of level " + std::to_string(level);
}

// Appends the colors of the page's cells. If the page is in one region, its colors are consecutive
// there, and their encoded blocks are copied. A page that is larger than a region gets one word per
// color.
void ColorPages::add_colors(const ColorPageAddress& address, std::vector<uint32_t>& words) {
  const uint32_t level = address.level;
  const uint64_t count = words[0];
  const voxdag_reader::ColorTier& tier = file_->colors().tier_of(level);
  if (level - std::min(level, kPageLevels) >= tier.region_level) {
    const std::array<int64_t, 3> first = cell_of(address, first_bit(words.data() + 1));
    uint64_t index = 0;
    check_region(tier, level, first);
    const auto* const region = cursor_.find(first[0], first[1], first[2], level, index);
    if (!region || count > region->cells - index)
      file_->broken_section(
          file_->colors(),
          cell_text(level, first) +
              ": its region has fewer colors than cells, expected one for each cell");
    const uint64_t skip = index % kBlockCells,
                   blocks = (skip + count + kBlockCells - 1) / kBlockCells;
    words[0] |= static_cast<uint32_t>(skip) << kSkipShift;
    words.resize(kHeadWords + blocks * kBlockWords);
    std::memcpy(words.data() + kHeadWords, region->blocks + index / kBlockCells * 16, blocks * 16);
    return;
  }
  words[0] |= kSingleColors;
  for (uint32_t code = 0; code < 32 * kMaskWords; ++code) {
    if (!(words[1 + code / 32] >> code % 32 & 1)) continue;
    const std::array<int64_t, 3> cell = cell_of(address, code);
    check_region(tier, level, cell);
    const auto rgb = cursor_.color(cell[0], cell[1], cell[2], level);
    if (!rgb)
      file_->broken_section(file_->colors(),
                            cell_text(level, cell) + " has no color, expected one for each cell");
    words.push_back(rgb->r | uint32_t{rgb->g} << 8 | uint32_t{rgb->b} << 16);
  }
}

}  // namespace voxdag::query
