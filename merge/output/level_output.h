// Where the merged rows of a level go: the global file in the last round, an artifact before.
#pragma once

#include <cstdint>
#include <vector>

#include "core/format/artifact/artifact.h"
#include "core/format/global/global_writer.h"
#include "merge/sort/record.h"

namespace voxdag {

// Positions of a level end below this: they are kept in 32 bits.
inline constexpr uint64_t kPositionLimit = uint64_t{1} << 32;

class LevelOutput {
 public:
  virtual ~LevelOutput() = default;
  // Positions count words, otherwise rows.
  virtual bool in_words() const = 0;
  virtual void begin_level(uint32_t level) = 0;
  // Unique rows come in order, one batch at a time.
  virtual void add(const RecordBatch& batch) = 0;
  // What need not be done in turn: every batch that was added comes once more, the first of its
  // rows at `position`, in any order, also from several threads at once.
  virtual void write(uint64_t position, const RecordBatch& batch) = 0;
  virtual void end_level(uint64_t nodes, uint64_t positions) = 0;
};

class GlobalOutput : public LevelOutput {
 public:
  explicit GlobalOutput(GlobalFileWriter& file) : file_(file) {}
  bool in_words() const override { return true; }
  void begin_level(uint32_t level) override { file_.begin_level(level); }
  void add(const RecordBatch& batch) override { file_.checksum_words(batch.words()); }
  void write(uint64_t position, const RecordBatch& batch) override {
    file_.write_words(position, batch.words());
  }
  void end_level(uint64_t nodes, uint64_t positions) override { file_.end_level(nodes, positions); }

 private:
  GlobalFileWriter& file_;
};

class ArtifactOutput : public LevelOutput {
 public:
  explicit ArtifactOutput(ArtifactWriter& artifact) : artifact_(artifact) {}
  bool in_words() const override { return false; }
  void begin_level(uint32_t level) override;
  void add(const RecordBatch& batch) override;
  void write(uint64_t, const RecordBatch&) override {}
  void end_level(uint64_t nodes, uint64_t positions) override;

 private:
  void write_bricks(const RecordBatch& batch);
  void write_nodes(const RecordBatch& batch);

  ArtifactWriter& artifact_;
  uint32_t level_ = 0;
  // Columns of up to a frame of rows.
  std::vector<uint64_t> brick_masks_;
  std::vector<uint8_t> masks_;
  std::vector<uint32_t> children_;
};

}  // namespace voxdag
