// The durable artifacts of the color stage, in one file of the work folder. An artifact has one
// attribute's values in one cube of the color grid. Its key is a digest of all its inputs
// (color_keys.h). A large artifact is stored in parts. docs/format.md, "Stored colors", documents
// the byte layout. No row of the job store refers to the file. An artifact is valid if all its
// parts are complete and have the requested key. Incomplete and damaged artifacts are baked again.
// A background thread syncs the file regularly, which limits the loss after a power cut.
//
// All functions except keep_only() may be called by several threads.
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
  // Reads the file if it exists, and warns about damaged parts. add() starts a sync of the file
  // every `sync_interval_s` seconds. If `sync_interval_s` is 0, every add() syncs the file before
  // returning. `files` must outlive the store.
  ColorStore(FileSystem& files, std::string path, double sync_interval_s, Progress& progress,
             const CancelToken& cancel);
  // Waits for a running sync.
  ~ColorStore();

  // The position of a part in the file.
  struct Place {
    uint64_t offset = 0, bytes = 0, checksum = 0;
  };

  // True if the file had an artifact with this key when it was opened.
  bool has(const Checksum128& key) const { return found_.contains({key.low, key.high}); }
  // The artifact's parts, in order.
  const std::vector<Place>& parts(const Checksum128& key) const {
    return found_.at({key.low, key.high});
  }
  // Reads a part. Throws Error{kCorrupt} if it is damaged.
  void read(const Place& place, std::vector<std::byte>& out) const;
  // Adds part `number`, counted from 0. Also throws the error of an earlier background sync.
  Place add(const Checksum128& key, uint64_t number, bool is_last, std::span<const std::byte> part);
  // Removes artifacts with other keys if they take more space than the artifacts with these keys
  // plus 64 KiB. Does not remove them if the disk has no space for a copy of the file. Call it
  // before add(). After an interruption, either the complete old file or the complete new file
  // exists.
  void keep_only(std::span<const Checksum128> keys, const CancelToken& cancel);
  const std::string& path() const { return path_; }
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
  mutable std::mutex mutex_;              // guards all members below
  std::shared_ptr<ReadableFile> reader_;  // null if there is no file
  uint64_t end_ = 0;                      // end of the last part
  std::shared_ptr<WritableFile> writer_;  // null before the first add()
  std::future<void> pending_;             // running sync
  double last_sync_s_;
  bool name_is_durable_ = false;
};

}  // namespace voxdag
