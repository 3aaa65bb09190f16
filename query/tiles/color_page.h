// Color pages: a page has the colors of 8 x 8 x 8 cells of one level, for viewers that fetch only
// visible data (docs/format.md, "Color pages"). A page is addressed by its position. It cannot be
// addressed by its node, as tiles are, because equal subtrees can have different colors.
//
// The address can come from an unknown client, and the colors can come from a damaged file. So the
// work for a page is bounded.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "query/tiles/node_checks.h"

namespace voxdag::query {

struct ColorPageAddress {
  uint32_t level = 0;                  // level of the page's cells
  std::array<uint64_t, 3> position{};  // position of the low corner, in pages
};

// Encodes pages of one file. The constructor's arguments must outlive this object. Each thread
// needs its own object.
class ColorPages {
 public:
  // `dag` and `blocks` must belong to the file. If `blocks` is not null, all data is verified by
  // its checksums before it is read.
  ColorPages(const voxdag_reader::File& file, const DagView& dag,
             const CheckedBlocks* blocks = nullptr)
      : file_(&file),
        blocks_(blocks),
        dag_(&dag),
        checked_file_{file, dag, blocks},
        cursor_(checked_file_) {}
  ColorPages(const ColorPages&) = delete;  // the cursor refers to a member of this object

  // Returns the words of the page; only one word if none of the page's cells is set. Throws
  //   Error{kNotFound}  if the file has no colors of this level, or the page is outside the grid;
  //   DamagedBlock      if a block needed for the page does not match its checksum (only if
  //                     `blocks` is not null);
  //   Error{kCorrupt}   if a node has an invalid offset, or the color section does not fit the DAG,
  //                     for example a set cell has no color.
  std::vector<uint32_t> encode(const ColorPageAddress& address);

 private:
  // The file, with checks before each read, in the form that the cursor needs.
  struct CheckedFile {
    const voxdag_reader::File& file;
    const DagView& dag;
    const CheckedBlocks* blocks;

    void expect_intact(uint32_t level, uint64_t offset) const {
      if (blocks) NodeChecks(dag, level, blocks).expect_intact(offset);
    }

    bool empty() const { return file.empty(); }
    uint32_t grid_levels() const { return file.grid_levels(); }
    uint32_t brick_level() const { return file.brick_level(); }
    const voxdag_reader::ColorSection& colors() const { return file.colors(); }
    uint64_t brick(uint64_t offset) const {
      expect_intact(brick_level(), offset);
      return file.brick(offset);
    }
    voxdag_reader::Node node(uint32_t level, uint64_t offset) const {
      expect_intact(level, offset);
      return file.node(level, offset);
    }
    static uint64_t child(const voxdag_reader::Node& node, int index) {
      return voxdag_reader::File::child(node, index);
    }
    [[noreturn]] void broken_section(const voxdag_reader::ColorSection& section,
                                     const std::string& what) const {
      file.broken_section(section, what);
    }
  };

  void set_mask(const ColorPageAddress& page, uint32_t* mask) const;
  void set_bits(uint32_t depth, uint64_t content, uint32_t below, uint32_t code,
                uint32_t* mask) const;
  DagView::Children children(uint32_t depth, uint64_t content) const;
  uint64_t content(uint32_t depth, const DagView::Children& children, int index) const;
  void check_region(const voxdag_reader::ColorTier& tier, uint32_t level,
                    const std::array<int64_t, 3>& cell) const;
  void add_colors(const ColorPageAddress& address, std::vector<uint32_t>& words);

  const voxdag_reader::File* file_;
  const CheckedBlocks* blocks_;
  const DagView* dag_;
  const CheckedFile checked_file_;
  voxdag_reader::BasicColorCursor<CheckedFile> cursor_;
};

}  // namespace voxdag::query
