// Saves the state of a merge in the background, and keeps the scratch files that the durable state
// names.
//
// Only one thread may call its functions. A background thread uses the checkpoint while a state is
// being saved.
#pragma once

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/base/clock.h"
#include "merge/checkpoint/merge_state.h"
#include "merge/types/checkpoint.h"

namespace voxdag {

class StateSaver {
 public:
  // If `checkpoint` is null, load() returns nothing, is_due() returns false, and save() must not be
  // called.
  StateSaver(Checkpoint* checkpoint, double interval_s)
      : checkpoint_(checkpoint), interval_s_(interval_s) {}
  // Does not remove the files that the durable state names: they outlive the merge.
  ~StateSaver();
  StateSaver(const StateSaver&) = delete;
  StateSaver& operator=(const StateSaver&) = delete;

  // Returns the durable state; nullopt if none exists. Throws Error{kCorrupt} if it is damaged.
  std::optional<MergeState> load() const;
  // Adds a file that the loaded state names to named().
  void add_named(std::shared_ptr<ScratchPath> path) { named_.push_back(std::move(path)); }
  std::span<const std::shared_ptr<ScratchPath>> named() const { return named_; }
  // Discards the durable state and its files.
  void forget();

  // True if the last save has finished, and the process has used `interval_s` seconds of CPU time
  // since that save began. Rethrows the exception of that save.
  bool is_due();
  // Saves a state in the background, with `level` as in Checkpoint::save(). `named` are the scratch
  // files that the state names. `sync` is called first and makes these files and the output
  // durable. Once the state is durable, removes the files that only the previous state names, and
  // releases the input ranges `merged`.
  void save(uint32_t level, MergeState state, std::vector<std::shared_ptr<ScratchPath>> named,
            std::function<void()> sync, std::vector<SegmentRange> merged);
  // Waits for the running save and rethrows its error.
  void wait();
  // Like wait(), at the end of the merge. The running save releases no further input ranges,
  // because the caller removes the input files soon.
  void finish();

 private:
  Checkpoint* const checkpoint_;
  const double interval_s_;
  double saved_s_ = process_cpu_seconds();
  std::vector<std::shared_ptr<ScratchPath>>
      named_;  // files of the durable state and of the running save
  std::atomic<bool> finishing_ = false;
  std::future<void> save_;
};

}  // namespace voxdag
