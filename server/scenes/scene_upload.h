// One request's part of an upload, written as it arrives. Received bytes are recorded unless their
// digest was wrong, so that the client can continue from there. An upload that received nothing
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
  // `first`: offset of this part (0 starts over). `total`: size of the complete upload, if known.
  // Throws RequestError{kConflict} if another request is writing or, with upload_offset, if the
  // part does not begin where the last one ended. Throws RequestError{kInvalid} if the total
  // differs from the first part's total.
  SceneUpload(SceneStore& store, std::string name, uint64_t first, std::optional<uint64_t> total);
  ~SceneUpload();
  SceneUpload(const SceneUpload&) = delete;

  void write(std::string_view bytes);
  uint64_t offset() const { return offset_; }

  // Ends the part; its digest must be `part_digest` ("" for any). Returns true if it was the last
  // part. The scene then has `whole_digest` ("" for any) and waits for publish(). On a mismatch,
  // discards the part or the complete scene and throws RequestError{kInvalid}.
  //
  // Calls `check` often while it reads the scene. If `check` throws, or if publish() is not called,
  // the upload has all its bytes, and an empty part finishes it later.
  bool finish(
      const std::string& part_digest, const std::string& whole_digest, bool is_last,
      const std::function<void()>& check = [] {});
  // Makes the scene complete and replaces an earlier one. Returns its SHA-256.
  std::string publish();

 private:
  void flush();
  // Syncs the written bytes and records the offset.
  void checkpoint();
  // True if the file still has the recorded bytes.
  bool has_part() const;

  SceneStore& store_;
  const std::string name_;
  const SceneStore::NameLock lock_;
  const uint64_t first_;
  std::optional<uint64_t> total_;
  std::unique_ptr<WritableFile> file_;
  std::string buffer_;
  uint64_t offset_;
  uint64_t recorded_;  // recorded offset in the store
  Sha256 digest_;      // digest of this part
  std::string sha256_;
  bool done_ = false;
};

}  // namespace voxdag::server
