// Writes the bands of color pages of a package (package_index.h), one band per level. The pages of
// a level are in Morton order. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/format/global/checked_blocks.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "query/package/color_block.h"
#include "query/package/pack_writer.h"
#include "query/tiles/color_page.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

class ColorBands {
 public:
  // All arguments must outlive this object. If `file` has no colors, nothing is written.
  ColorBands(const voxdag_reader::File& file, const DagView& dag, const CheckedBlocks& blocks,
             PackWriter& packs, const CancelToken& cancel)
      : file_(file), dag_(dag), blocks_(blocks), packs_(packs), cancel_(cancel) {}

  // Writes the bands of the next levels, up to the level `last`. Does not write a level twice.
  void write_levels(uint32_t last);
  uint64_t pages() const { return pages_; }

 private:
  void write_level(uint32_t level);
  void visit(uint32_t depth, uint64_t content, uint64_t code, ColorPages& encoder);
  void add_page(uint64_t code, ColorPages& encoder);
  void end_block();

  const voxdag_reader::File& file_;
  const DagView& dag_;
  const CheckedBlocks& blocks_;
  PackWriter& packs_;
  const CancelToken& cancel_;
  uint32_t next_level_ = 0;
  uint32_t level_ = 0;            // level of the current band
  std::vector<CodedPage> block_;  // pages of the current block so far
  size_t block_words_ = 0;
  uint64_t pages_ = 0;
};

}  // namespace voxdag::query
