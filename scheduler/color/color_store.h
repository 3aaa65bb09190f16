// The artifacts of the color stage: the colors of cubes, each under a key that names all that they
// depend on, in one file of the work folder that outlives the process. docs/format.md, "Stored
// colors", is the byte layout.
//
// Nothing refers to the file: an artifact counts if it is there, whole, and under the key that is
// asked for. So what a stopped run wrote last may be half there, and what is damaged is missing;
// either way it is baked again. Now and then the file is synced, in the background, for power cuts.
//
// has() and read() may be called by several threads, and add() too.
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

#include "core/base/cancel_token.h"
#include "core/base/progress.h"
#include "core/format/checksum.h"
#include "core/io/file_system.h"

namespace voxdag {

class ColorStore {
 public:
  // Reads all of the file, if there is one; warns of what is damaged in it. add() syncs it after
  // `sync_interval_s`; 0: each time, before it returns. `files` must outlive the store.
  ColorStore(FileSystem& files, std::string path, double sync_interval_s, Progress& progress,
             const CancelToken& cancel);
  // Waits for the disk.
  ~ColorStore();

  // Whether the file had a sound artifact with this key when it was opened.
  bool has(const Checksum128& key) const { return found_.contains({key.low, key.high}); }
  // How many bytes it has, or one that was added.
  uint64_t bytes_of(const Checksum128& key) const { return place_of(key).bytes; }
  // These. Throws Error{kCorrupt} if they are damaged by now.
  void read(const Checksum128& key, std::vector<std::byte>& out) const;
  // Throws what went wrong when an earlier one was synced, too.
  void add(const Checksum128& key, std::span<const std::byte> artifact);
  // Bytes of the file.
  uint64_t file_bytes() const;

 private:
  struct Place {
    uint64_t offset = 0, bytes = 0, checksum = 0;
  };

  Place place_of(const Checksum128& key) const;
  bool is_sound(const Place& place, const CancelToken& cancel) const;
  void sync_if_due();

  FileSystem& files_;
  const std::string path_;
  const double sync_interval_s_;
  std::shared_ptr<ReadableFile> reader_;                  // null: there was no file
  std::map<std::pair<uint64_t, uint64_t>, Place> found_;  // by key
  mutable std::mutex mutex_;                              // guards all below
  std::map<std::pair<uint64_t, uint64_t>, Place> added_;  // by key
  mutable std::shared_ptr<ReadableFile> added_reader_;    // null before the first is read
  uint64_t end_ = 0;                                      // of the last artifact
  std::shared_ptr<WritableFile> writer_;                  // null before the first add()
  std::future<void> pending_;                             // a sync
  double last_sync_s_;
  bool name_is_durable_ = false;
};

}  // namespace voxdag
