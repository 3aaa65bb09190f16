// The readers of the image formats, for open_image().
#pragma once

#include <algorithm>
#include <cstring>
#include <exception>
#include <memory>

#include "core/base/page_buffer.h"
#include "core/image/image_reader.h"

namespace voxdag {

// A source of bytes whose first bytes (up to kImageHeadBytes) can be seen in advance with head().
// read() returns all bytes, including the first. read() stores an exception of the source instead
// of throwing it, because exceptions must not pass through a decoder written in C. If there is an
// exception, or if `cancel` was canceled, read() returns fewer bytes, and rethrow() then throws the
// exception or Error{kCanceled}.
class PeekedSource {
 public:
  PeekedSource(EncodedBytes& source, const CancelToken* cancel) : source_(source), cancel_(cancel) {
    head_size_ = source.read({head_, sizeof head_});
  }
  std::span<const std::byte> head() const { return {head_, head_size_}; }
  size_t read(std::byte* out, size_t size) noexcept {
    const size_t from_head = std::min(size, head_size_ - head_read_);
    std::memcpy(out, head_ + head_read_, from_head);
    head_read_ += from_head;
    if (from_head == size) return size;
    if (is_canceled()) return from_head;
    try {
      return from_head + source_.read({out + from_head, size - from_head});
    } catch (...) {
      failure_ = std::current_exception();
      return from_head;
    }
  }
  bool is_canceled() const { return cancel_ && cancel_->canceled(); }
  void check_canceled() const {
    if (cancel_) cancel_->check();
  }
  void rethrow() const {
    check_canceled();
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  EncodedBytes& source_;
  const CancelToken* const cancel_;
  std::byte head_[kImageHeadBytes];
  size_t head_size_ = 0, head_read_ = 0;
  std::exception_ptr failure_;
};

// The bytes of a complete file, for decoders that need all bytes in one buffer.
class WholeFile {
 public:
  // Reads the source to its end. Throws Error{kOutOfMemory} if the bytes do not fit in the budget,
  // and the errors of the source.
  WholeFile(PeekedSource& source, MemoryBudget& budget);
  std::span<const uint8_t> bytes() const { return {bytes_.data(), size_}; }

 private:
  PageBuffer<uint8_t> bytes_;
  size_t size_ = 0;
};

std::unique_ptr<ImageReader> open_png(std::unique_ptr<PeekedSource> source, MemoryBudget& budget,
                                      ImageUse use);
std::unique_ptr<ImageReader> open_jpeg(std::unique_ptr<PeekedSource> source, MemoryBudget& budget,
                                       ImageUse use);
std::unique_ptr<ImageReader> open_webp(std::unique_ptr<PeekedSource> source, MemoryBudget& budget);
std::unique_ptr<ImageReader> open_avif(std::unique_ptr<PeekedSource> source, MemoryBudget& budget);

}  // namespace voxdag
