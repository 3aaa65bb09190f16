// Writes small consecutive pieces of a file in one step. Several threads may call write_at() at the
// same time. The buffered bytes are in the file after sync(), close(), release() or flush(). The
// destructor discards the bytes that are still buffered.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "core/io/forwarding_files.h"

namespace voxdag {

class BufferedWriter : public ForwardingWriter {
 public:
  explicit BufferedWriter(std::unique_ptr<WritableFile> file) : ForwardingWriter(std::move(file)) {}

  // Buffers `data` if it is small. Ranges written since the last flush() must not overlap. An error
  // can also be about bytes of earlier calls.
  void write_at(uint64_t offset, std::span<const std::byte> data) override;
  void release(uint64_t offset, uint64_t bytes) override;
  void sync() override;
  void close() override;
  // Writes the buffered bytes, so that readers of the file see them.
  void flush();

 private:
  void flush_locked();

  std::mutex mutex_;
  std::vector<std::byte> buffer_;
  uint64_t begin_ = 0;  // offset of the buffered bytes in the file
};

}  // namespace voxdag
