#include "server/scenes/scene_upload.h"

#include <algorithm>

#include "core/base/error.h"
#include "server/request_error.h"

namespace voxdag::server {
namespace {

constexpr size_t kBufferBytes = 256 << 10;
// What a power cut may cost a client: the bytes that it sends again.
constexpr uint64_t kCheckpointBytes = uint64_t{64} << 20;

RequestError wrong_offset(uint64_t expected) {
  RequestError error(RequestError::Kind::kConflict,
                     "the part does not begin where the last one ended");
  error.upload_offset = expected;
  return error;
}

}  // namespace

Upload::Upload(SceneStore& store, std::string name, uint64_t first, std::optional<uint64_t> total)
    : store_(store),
      name_(std::move(name)),
      first_(first),
      total_(total),
      offset_(first),
      recorded_(first) {
  if (!store_.lock_name(name_))
    throw RequestError(RequestError::Kind::kConflict, "another request is uploading this scene");
  try {
    const auto known = store_.upload(name_);
    if (first_ == 0) {
      store_.record(name_, {0, total_});
      file_ = store_.files_.create(store_.part_path(name_));
    } else {
      if (first_ != (known ? known->offset : 0)) throw wrong_offset(known ? known->offset : 0);
      if (known->total && total_ != known->total)
        throw RequestError(RequestError::Kind::kInvalid,
                           "Content-Range: the total is another than that of the first part");
      file_ = store_.files_.open_write(store_.part_path(name_));
    }
  } catch (...) {
    store_.unlock_name(name_);
    throw;
  }
}

Upload::~Upload() {
  try {
    if (!done_) checkpoint();
  } catch (const Error&) {
    // The record still has an earlier offset, which is valid too.
  }
  file_.reset();
  store_.unlock_name(name_);
}

void Upload::write(std::string_view bytes) {
  buffer_ += bytes;
  if (buffer_.size() >= kBufferBytes) flush();
  if (offset_ - recorded_ >= kCheckpointBytes) checkpoint();
}

void Upload::flush() {
  if (buffer_.empty()) return;
  const auto bytes = std::as_bytes(std::span(buffer_));
  file_->write_at(offset_, bytes);
  digest_.add(bytes);
  offset_ += buffer_.size();
  buffer_.clear();
}

void Upload::checkpoint() {
  flush();
  file_->sync();
  store_.record(name_, {offset_, total_});
  recorded_ = offset_;
}

bool Upload::finish(const std::string& part_digest, const std::string& whole_digest, bool is_last) {
  flush();
  const std::string part = digest_.finish();
  if (!part_digest.empty() && part_digest != part) {
    done_ = true;
    if (first_ == 0)
      store_.drop_upload(name_);
    else
      store_.record(name_, {first_, total_});
    throw RequestError(RequestError::Kind::kInvalid,
                       "the part's bytes have another SHA-256 than Content-Digest says");
  }
  if (!is_last) {
    checkpoint();
    done_ = true;
    return false;
  }
  file_->sync();
  sha256_ = first_ == 0 ? part : digest_of_whole();
  if (!whole_digest.empty() && whole_digest != sha256_) {
    done_ = true;
    store_.drop_upload(name_);
    throw RequestError(RequestError::Kind::kInvalid,
                       "the scene's bytes have another SHA-256 than Repr-Digest says");
  }
  return true;
}

std::string Upload::publish() {
  file_->close();
  store_.publish(name_, offset_, sha256_);
  done_ = true;
  return sha256_;
}

std::string Upload::digest_of_whole() {
  const auto file = store_.files_.open_read(store_.part_path(name_));
  Sha256 digest;
  std::string piece;
  for (uint64_t at = 0; at < offset_; at += piece.size()) {
    piece.resize(std::min<uint64_t>(kBufferBytes, offset_ - at));
    file->read_at(at, std::as_writable_bytes(std::span(piece)));
    digest.add(std::as_bytes(std::span(piece)));
  }
  return digest.finish();
}

}  // namespace voxdag::server
