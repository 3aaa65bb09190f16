#include "server/scenes/scene_upload.h"

#include "core/base/error.h"
#include "server/base/request_error.h"

namespace voxdag::server {
namespace {

constexpr size_t kUploadBufferBytes = 256 << 10;
// Maximum bytes that a client must send again after a power cut, and maximum age of these bytes
// while further bytes arrive.
constexpr uint64_t kCheckpointBytes = uint64_t{64} << 20;
constexpr double kCheckpointS = 1;

RequestError wrong_offset(uint64_t first, uint64_t expected) {
  RequestError error(RequestError::Kind::kConflict,
                     "the part begins at byte " + std::to_string(first) + ": expected byte " +
                         std::to_string(expected) + ", where the stored bytes end");
  error.upload_offset = expected;
  return error;
}

}  // namespace

SceneUpload::SceneUpload(SceneStore& store, std::string name, uint64_t first,
                         std::optional<uint64_t> total, std::function<double()> clock)
    : store_(store),
      name_(std::move(name)),
      lock_(store, name_),
      first_(first),
      clock_(std::move(clock)),
      total_(total),
      offset_(first),
      recorded_(first),
      recorded_s_(clock_()) {
  const std::string path = store_.part_path(name_);
  if (first_ == 0) {
    store_.record(name_, {0, total_});
    file_ = store_.files_.create(path);
    store_.files_.sync_directory(parent_directory(path));
    return;
  }
  const auto known = store_.upload(name_);
  if (first_ != (known ? known->offset : 0)) throw wrong_offset(first_, known ? known->offset : 0);
  if (!has_part()) {
    store_.drop_upload(name_);
    throw wrong_offset(first_, 0);
  }
  if (known->total && total_ != known->total)
    throw RequestError(RequestError::Kind::kInvalid,
                       "Content-Range: the total of this part is " +
                           (total_ ? std::to_string(*total_) : std::string("missing")) +
                           ": expected " + std::to_string(*known->total) +
                           ", the total of the first part");
  file_ = store_.files_.open_write(path);
}

SceneUpload::~SceneUpload() {
  try {
    if (done_ || !file_) return;
    flush();
    if (offset_ > 0)
      checkpoint();
    else
      store_.drop_upload(name_);
  } catch (const std::exception&) {
    // The latest bytes are not recorded. The record has an earlier offset, from which the client
    // can also continue.
  }
}

bool SceneUpload::has_part() const {
  const std::string path = store_.part_path(name_);
  return store_.files_.exists(path) && store_.files_.open_own(path)->size() >= first_;
}

void SceneUpload::write(std::string_view bytes) {
  buffer_ += bytes;
  if (buffer_.size() >= kUploadBufferBytes) flush();
  if (offset_ - recorded_ >= kCheckpointBytes || clock_() - recorded_s_ >= kCheckpointS)
    checkpoint();
}

void SceneUpload::flush() {
  if (buffer_.empty()) return;
  const auto bytes = std::as_bytes(std::span(buffer_));
  file_->write_at(offset_, bytes);
  digest_.add(bytes);
  offset_ += buffer_.size();
  buffer_.clear();
}

void SceneUpload::checkpoint() {
  flush();
  file_->sync();
  store_.record(name_, {offset_, total_});
  recorded_ = offset_;
  recorded_s_ = clock_();
}

bool SceneUpload::finish(const std::string& part_digest, const std::string& whole_digest,
                         bool is_last, const std::function<void()>& check) {
  flush();
  const std::string part = digest_.finish();
  if (!part_digest.empty() && part_digest != part) {
    done_ = true;
    if (first_ == 0)
      store_.drop_upload(name_);
    else
      store_.record(name_, {first_, total_});
    throw RequestError(RequestError::Kind::kInvalid, "the SHA-256 of the part's bytes is " + part +
                                                         ": expected " + part_digest +
                                                         ", the Content-Digest");
  }
  checkpoint();
  done_ = true;
  if (!is_last) return false;
  sha256_ =
      first_ == 0 ? part : file_sha256(store_.files_, store_.part_path(name_), offset_, check);
  if (!whole_digest.empty() && whole_digest != sha256_) {
    store_.drop_upload(name_);
    throw RequestError(RequestError::Kind::kInvalid, "the SHA-256 of the scene's bytes is " +
                                                         sha256_ + ": expected " + whole_digest +
                                                         ", the Repr-Digest");
  }
  return true;
}

std::string SceneUpload::publish() {
  file_->close();
  try {
    store_.publish(name_, offset_, sha256_);
  } catch (const Error& error) {
    if (error.is_corruption()) store_.drop_upload(name_);
    throw;
  }
  return sha256_;
}

}  // namespace voxdag::server
