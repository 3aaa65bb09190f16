// A window over the bytes of a file that is read from front to back, with occasional jumps. Not
// thread-safe.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/io/file_system.h"

namespace voxdag {

class FileWindow {
 public:
  static constexpr size_t kBytes = size_t{256} << 10;

  // The file must outlive the window.
  FileWindow(const ReadableFile& file, MemoryBudget& budget)
      : file_(file), bytes_(budget, kBytes, "the window over " + file.path()) {}

  const ReadableFile& file() const { return file_; }

  // Returns at least `wanted` bytes starting at `offset`, or fewer (even none) at the end of the
  // file. `wanted` is at most kBytes. The result is valid until the next call.
  std::span<const std::byte> at(uint64_t offset, size_t wanted) {
    if (offset >= file_.size()) return {};
    if (offset < begin_ || offset > end_ || end_ - offset < wanted) load(offset);
    return {bytes_.data() + (offset - begin_), static_cast<size_t>(end_ - offset)};
  }

 private:
  void load(uint64_t offset) {
    begin_ = end_ = offset;
    const auto size = static_cast<size_t>(std::min<uint64_t>(kBytes, file_.size() - begin_));
    file_.read_at(begin_, {bytes_.data(), size});
    end_ = begin_ + size;
  }

  const ReadableFile& file_;
  PageBuffer<std::byte> bytes_;
  uint64_t begin_ = 0, end_ = 0;  // range of the file in bytes_
};

}  // namespace voxdag
