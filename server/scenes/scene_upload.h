// Writes one request's part of an upload to the store as the bytes arrive. Records the received
// bytes at least every 64 MiB, and with the first bytes that arrive a second or more after the last
// record. If the request breaks off, all received bytes are recorded, and the client can continue
// after them. A wrong digest discards the recorded bytes of the part. If no byte of an upload was
// received, its record and its file are removed. Used by one thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/clock.h"
#include "core/format/checksum.h"
#include "server/scenes/scene_store.h"

namespace voxdag::server {

class SceneUpload {
 public:
  // `first`: offset of this part (0 starts over). `total`: size of the complete upload, if known.
  // Throws RequestError{kConflict} if another request is writing to the scene. Also throws it, with
  // the member upload_offset, if the part does not begin where the previous part ended. Throws
  // RequestError{kInvalid} if the total differs from the first part's total. `clock` returns
  // seconds and never goes back.
  SceneUpload(SceneStore& store, std::string name, uint64_t first, std::optional<uint64_t> total,
              std::function<double()> clock = wall_seconds);
  ~SceneUpload();
  SceneUpload(const SceneUpload&) = delete;

  void write(std::string_view bytes);
  uint64_t offset() const { return offset_; }

  // Ends the part. Its SHA-256 must be `part_digest` ("": not checked). Returns true if it was the
  // last part of the scene. Then the SHA-256 of the complete scene must be `whole_digest` ("": not
  // checked), and the caller must call publish(). If a digest differs, discards the part or the
  // complete scene, and throws RequestError{kInvalid}.
  //
  // Calls `check` often while it reads the scene. If `check` throws, or if the caller does not call
  // publish(), the upload keeps all its bytes, and the client can finish it later with an empty
  // part.
  bool finish(
      const std::string& part_digest, const std::string& whole_digest, bool is_last,
      const std::function<void()>& check = [] {});
  // Makes the scene complete. Replaces an earlier scene with this name. Returns the SHA-256 of the
  // new scene.
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
  const std::function<double()> clock_;
  std::optional<uint64_t> total_;
  std::unique_ptr<WritableFile> file_;
  std::string buffer_;
  uint64_t offset_;
  uint64_t recorded_;  // offset that the store has recorded
  double recorded_s_;  // time of the last record, or the start of this part
  Sha256 digest_;      // digest of this part
  std::string sha256_;
  bool done_ = false;
};

}  // namespace voxdag::server
