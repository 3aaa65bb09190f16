// Color pages: the colors of 8 x 8 x 8 cells of one level, for viewers that fetch what they see
// (docs/format.md, "Color pages"). Unlike tiles they are addressed by their place: equal subtrees
// have colors of their own.
//
// Addresses may come from anyone, and colors from damaged files; the work for a page is bounded.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/format/global/voxdag_reader.h"
#include "query/dag_view.h"

namespace voxdag::query {

struct ColorPageAddress {
  uint32_t level = 0;                  // of its cells
  std::array<uint64_t, 3> position{};  // of its low corner, in pages
};

// Pages of one file. Refers to it; each thread needs its own.
class ColorPages {
 public:
  // `dag` must be that of the file.
  ColorPages(const voxdag_reader::File& file, const DagView& dag)
      : file_(&file), dag_(&dag), cursor_(file) {}

  // The words of the page: one if none of its cells is set. Throws Error{kNotFound} if the file has
  // no colors of that level or the grid no such cells, and Error{kCorrupt}.
  std::vector<uint32_t> encode(const ColorPageAddress& address);

 private:
  void add_colors(const ColorPageAddress& address, std::vector<uint32_t>& words);

  const voxdag_reader::File* file_;
  const DagView* dag_;
  voxdag_reader::ColorCursor cursor_;
};

}  // namespace voxdag::query
