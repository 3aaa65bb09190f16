// The output of a merge pass, level by level. The final pass writes the global file. Earlier passes
// write artifacts.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/format/artifact/artifact_writer.h"
#include "core/format/global/global_writer.h"
#include "merge/output/merged_rows.h"

namespace voxdag {

// The size of a merged level, or of a part of it. Positions (merge/load/row.h) count words in the
// global file, and rows in an artifact.
struct LevelExtent {
  uint64_t nodes = 0;
  uint64_t positions = 0;

  // Adds the size of a part. Throws Error{kLimit}, which names the level, if the sum exceeds the
  // limit of the file's format: 2^40 words in a global file, 2^32 rows in an artifact.
  void add(const LevelExtent& part, uint32_t level, bool in_words) {
    nodes += part.nodes;
    positions += part.positions;
    const int bits = in_words ? 40 : 32;
    if (positions >> bits > 0 && positions != uint64_t{1} << bits)
      throw Error(ErrorCode::kLimit, "level " + std::to_string(level) +
                                         " of the merged DAG has over 2^" + std::to_string(bits) +
                                         (in_words ? " words" : " nodes") +
                                         ", the limit of a level: expected a lower resolution");
  }
};

class LevelOutput {
 public:
  virtual ~LevelOutput() = default;
  // True if positions count words; otherwise they count rows.
  virtual bool in_words() const = 0;
  // True if references to a level with this many positions must be wide (two words each).
  virtual bool is_wide(uint64_t positions) const = 0;
  virtual void begin_level(uint32_t level) = 0;
  // Receives all rows of the level in order. Calls do not overlap.
  virtual void add(const MergedRows& rows) = 0;
  // Receives the same rows again, for work that does not depend on their order. `position` is the
  // position of the first row of `rows`. Calls come in any order, and concurrently from several
  // threads.
  virtual void write(uint64_t position, const MergedRows& rows) = 0;
  virtual void end_level(const LevelExtent& level) = 0;
};

class GlobalOutput : public LevelOutput {
 public:
  explicit GlobalOutput(GlobalFileWriter& file) : file_(file) {}
  bool in_words() const override { return true; }
  bool is_wide(uint64_t positions) const override { return file_.is_wide(positions); }
  void begin_level(uint32_t level) override { file_.begin_level(level); }
  void add(const MergedRows& rows) override { file_.checksum_words(rows.words()); }
  void write(uint64_t position, const MergedRows& rows) override {
    file_.write_words(position, rows.words());
  }
  void end_level(const LevelExtent& level) override {
    file_.end_level({.nodes = level.nodes, .words = level.positions});
  }

 private:
  GlobalFileWriter& file_;
};

class ArtifactOutput : public LevelOutput {
 public:
  explicit ArtifactOutput(ArtifactWriter& artifact) : artifact_(artifact) {}
  bool in_words() const override { return false; }
  bool is_wide(uint64_t) const override { return false; }
  void begin_level(uint32_t level) override;
  void add(const MergedRows& rows) override;
  void write(uint64_t, const MergedRows&) override {}
  void end_level(const LevelExtent&) override { artifact_.end_level(); }

 private:
  void write_bricks(const MergedRows& rows);
  void write_nodes(const MergedRows& rows);

  ArtifactWriter& artifact_;
  uint32_t level_ = 0;
  // Columns with the rows of up to one frame.
  std::vector<uint64_t> brick_masks_;
  std::vector<uint8_t> masks_;
  std::vector<uint32_t> children_;
};

}  // namespace voxdag
