// One request's part of an upload, written as it arrives. What arrived is recorded unless its
// digest was wrong, so that the client can continue from there; an upload of which nothing arrived
// leaves nothing. Used by one thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/format/checksum.h"
#include "server/scenes/scene_store.h"

namespace voxdag::server {

class SceneUpload {
 public:
  // `first` is where this part begins (0 starts over), `total` the whole's size if it is known.
  // Throws RequestError: kConflict if another request is writing, or (with upload_offset) if the
  // part does not begin where the last one ended; kInvalid if the total differs from the first
  // part's.
  SceneUpload(SceneStore& store, std::string name, uint64_t first, std::optional<uint64_t> total);
  ~SceneUpload();
  SceneUpload(const SceneUpload&) = delete;

  void write(std::string_view bytes);
  uint64_t offset() const { return offset_; }

  // The part is complete; its digest must be `part_digest` ("" for any). Returns true if it was the
  // last one: then the scene has `whole_digest` ("" for any) and waits for publish(). Throws
  // RequestError{kInvalid} on a mismatch, and discards the part or the whole scene. Calls `check`
  // often while it reads the scene; what that throws leaves an upload without missing bytes, which
  // an empty part finishes later, as it does if publish() is not called.
  bool finish(
      const std::string& part_digest, const std::string& whole_digest, bool is_last,
      const std::function<void()>& check = [] {});
  // Makes the scene complete, in place of an earlier one. Returns its SHA-256.
  std::string publish();

 private:
  void flush();
  // Syncs the written bytes and records the offset.
  void checkpoint();
  // True if the file has the recorded bytes; it may have been lost.
  bool has_part() const;

  SceneStore& store_;
  const std::string name_;
  const SceneStore::NameLock lock_;
  const uint64_t first_;
  std::optional<uint64_t> total_;
  std::unique_ptr<WritableFile> file_;
  std::string buffer_;
  uint64_t offset_;
  uint64_t recorded_;  // the offset in the store
  Sha256 digest_;      // of this part
  std::string sha256_;
  bool done_ = false;
};

}  // namespace voxdag::server
