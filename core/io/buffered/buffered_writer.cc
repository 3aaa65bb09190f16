#include "core/io/buffered/buffered_writer.h"

namespace voxdag {
namespace {

constexpr size_t kBufferBytes = size_t{128} << 10;
constexpr size_t kMaxPieceBytes = size_t{64} << 10;  // larger pieces are not buffered

}  // namespace

void BufferedWriter::write_at(uint64_t offset, std::span<const std::byte> data) {
  if (data.empty()) return;
  if (data.size() > kMaxPieceBytes) return ForwardingWriter::write_at(offset, data);
  const std::lock_guard lock(mutex_);
  if (offset != begin_ + buffer_.size() || buffer_.size() + data.size() > kBufferBytes) {
    flush_locked();
    begin_ = offset;
    buffer_.reserve(kBufferBytes);
  }
  buffer_.insert(buffer_.end(), data.begin(), data.end());
}

void BufferedWriter::release(uint64_t offset, uint64_t bytes) {
  flush();
  ForwardingWriter::release(offset, bytes);
}

void BufferedWriter::sync() {
  flush();
  ForwardingWriter::sync();
}

void BufferedWriter::close() {
  flush();
  ForwardingWriter::close();
}

void BufferedWriter::flush() {
  const std::lock_guard lock(mutex_);
  flush_locked();
}

void BufferedWriter::flush_locked() {
  if (buffer_.empty()) return;
  ForwardingWriter::write_at(begin_, buffer_);
  buffer_.clear();
}

}  // namespace voxdag
