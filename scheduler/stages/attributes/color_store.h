// The artifacts of the color stage: the colors of cubes, each under a key that names all that they
// depend on, in one file of the work folder that outlives the process. A cube that has more than
// memory should hold is stored in parts. docs/format.md, "Stored colors", is the byte layout.
//
// Nothing refers to the file: an artifact counts if all its parts are there, whole, and under the
// key that is asked for. So what a stopped run wrote last may be half there, and what is damaged is
// missing; either way it is baked again. Now and then the file is synced, in the background, for
// power cuts.
//
// All but keep_only() may be called by several threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/progress.h"
#include "core/format/checksum.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class ColorStore {
 public:
  // Reads all of the file, if there is one; warns of what is damaged in it. add() syncs it after
  // `sync_interval_s`; 0: each time, before it returns. `files` must outlive the store.
  ColorStore(FileSystem& files, std::string path, double sync_interval_s, Progress& progress,
             const CancelToken& cancel);
  // Waits for the disk.
  ~ColorStore();

  // Where a part lies.
  struct Place {
    uint64_t offset = 0, bytes = 0, checksum = 0;
  };

  // Whether the file had an artifact with this key when it was opened.
  bool has(const Checksum128& key) const { return found_.contains({key.low, key.high}); }
  // Its parts, in their order.
  const std::vector<Place>& parts(const Checksum128& key) const {
    return found_.at({key.low, key.high});
  }
  // One of them, or one that was added. Throws Error{kCorrupt} if it is damaged by now.
  void read(const Place& place, std::vector<std::byte>& out) const;
  // Adds the part of this number, from 0. Throws what went wrong when an earlier one was synced,
  // too.
  Place add(const Checksum128& key, uint64_t number, bool is_last, std::span<const std::byte> part);
  // Frees the space of what has none of these keys, if it is more than what has; before any add().
  // A stop leaves the file as it was or as it is to be.
  void keep_only(std::span<const Checksum128> keys, const CancelToken& cancel);
  // Bytes of the file.
  uint64_t file_bytes() const;

 private:
  using Key = std::pair<uint64_t, uint64_t>;
  using Artifacts = std::map<Key, std::vector<Place>>;

  void find_artifacts(Progress& progress, const CancelToken& cancel);
  uint64_t copy(Artifacts& artifacts, WritableFile& file, const CancelToken& cancel) const;
  bool is_sound(const Place& place, const CancelToken& cancel) const;
  void sync_if_due();

  FileSystem& files_;
  const std::string path_;
  const double sync_interval_s_;
  Artifacts found_;
  mutable std::mutex mutex_;              // guards all below
  std::shared_ptr<ReadableFile> reader_;  // null: there is no file
  uint64_t end_ = 0;                      // of the last part
  std::shared_ptr<WritableFile> writer_;  // null before the first add()
  std::future<void> pending_;             // a sync
  double last_sync_s_;
  bool name_is_durable_ = false;
};

}  // namespace voxdag
