// Makes durable what was merged, now and then, and sees to it that the files which that names stay.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "core/base/clock.h"
#include "merge/merge_state.h"

namespace voxdag {

class MergeJournal {
 public:
  MergeJournal(Checkpoint* checkpoint, double interval_s)
      : checkpoint_(checkpoint), interval_s_(interval_s) {}
  ~MergeJournal() {
    for (const auto& path : named_) path->keep();
  }
  MergeJournal(const MergeJournal&) = delete;
  MergeJournal& operator=(const MergeJournal&) = delete;

  // Throws Error{kCorrupt} for one that is damaged.
  std::optional<MergeState> load() {
    if (!checkpoint_) return std::nullopt;
    const auto bytes = checkpoint_->load();
    if (!bytes) return std::nullopt;
    return decode_state(*bytes);
  }
  // The state that was loaded names this file.
  void add_named(std::shared_ptr<ScratchPath> path) { named_.push_back(std::move(path)); }
  std::span<const std::shared_ptr<ScratchPath>> named() const { return named_; }
  void forget() {
    if (checkpoint_) checkpoint_->forget();
    named_.clear();
  }

  // Enough was done since the last state.
  bool due() const { return checkpoint_ && process_cpu_seconds() - saved_s_ >= interval_s_; }
  // `named`: the files of the scratch folder that the state names, all synced. Those that only the
  // state before named are removed.
  void save(uint32_t level, MergeState state, std::vector<std::shared_ptr<ScratchPath>> named) {
    // Should save() fail, nobody knows which of the two states is the durable one: both are kept.
    const size_t before = named_.size();
    named_.insert(named_.end(), named.begin(), named.end());
    checkpoint_->save(level, encode_state(std::move(state)));
    named_.erase(named_.begin(), named_.begin() + static_cast<std::ptrdiff_t>(before));
    saved_s_ = process_cpu_seconds();
  }
  void release(uint32_t segment, uint64_t offset, uint64_t bytes) {
    checkpoint_->release(segment, offset, bytes);
  }

 private:
  Checkpoint* const checkpoint_;
  const double interval_s_;
  double saved_s_ = process_cpu_seconds();
  std::vector<std::shared_ptr<ScratchPath>> named_;
};

}  // namespace voxdag
