// One request's part of an upload, written as it comes. Unless it is finished or dropped, what came
// is kept, so that the client can go on from there.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/format/checksum.h"
#include "server/scenes/scene_store.h"

namespace voxdag::server {

class Upload {
 public:
  // `first` is where this part begins (0 starts over), `total` the whole's size if it is known.
  // Throws Problem: 409 if another request is writing, or with Upload-Offset if the part does not
  // begin where the last one ended; 400 if the total is another than before.
  Upload(SceneStore& store, std::string name, uint64_t first, std::optional<uint64_t> total);
  ~Upload();
  Upload(const Upload&) = delete;

  void write(std::string_view bytes);
  uint64_t offset() const { return offset_; }

  // The part is here, of this digest ("" for any). True if the scene is whole now, and of
  // `whole_digest` ("" for any): it then waits for publish(). Throws Problem (400) on a mismatch,
  // and keeps nothing of the part, or of the whole.
  bool finish(const std::string& part_digest, const std::string& whole_digest, bool is_last);
  // Puts the whole scene in its place. Returns its SHA-256.
  std::string publish();

 private:
  void flush();
  // Syncs and records what is here.
  void keep();
  std::string digest_of_whole();

  SceneStore& store_;
  const std::string name_;
  const uint64_t first_;
  std::optional<uint64_t> total_;
  std::unique_ptr<WritableFile> file_;
  std::string buffer_;
  uint64_t offset_;
  uint64_t kept_;  // of the offset
  Sha256 digest_;  // of this part
  std::string sha256_;
  bool done_ = false;
};

}  // namespace voxdag::server
