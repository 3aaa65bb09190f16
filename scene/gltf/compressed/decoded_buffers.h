// The decoded contents of a document's compressed buffers. The first reader that needs a buffer
// decodes it into a temporary file without a name; all readers then read ranges of this file. While
// a reader decodes, it holds one Draco primitive or one buffer view in memory. Thread-safe.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <span>
#include <string>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/gltf/document/document.h"
#include "scene/growing_charge.h"

namespace voxdag::gltf {

class DecodedBuffers {
 public:
  // Reads bytes [offset, offset + out.size()) of one of the buffers stored in the file.
  using ReadFile = std::function<void(int buffer, uint64_t offset, std::span<std::byte> out)>;

  // `scratch_path`: the temporary file, in an existing folder; "": a file in a new folder in
  // temporary_parent(). `files`, `document` and `budget` must outlive this object.
  DecodedBuffers(FileSystem& files, std::string scratch_path, const Document& document,
                 MemoryBudget& budget);

  // Reads bytes [offset, offset + out.size()) of the decoded contents of buffer `buffer`, which
  // must contain them. Throws Error{kInvalidInput} if the compressed data are damaged,
  // {kOutOfMemory} if decoding does not fit the budget, and {kNoSpace} if the decoded bytes do
  // not fit the disk.
  void read(int buffer, uint64_t offset, std::span<std::byte> out, const ReadFile& read_file);

 private:
  struct Decoded {
    std::mutex mutex;
    std::atomic<bool> is_there = false;
    uint64_t begin = 0;  // offset in the temporary file
  };

  void decode(const BufferSource& buffer, uint64_t begin, const ReadFile& read_file);
  void decode_within_budget(const BufferSource& buffer, uint64_t begin, const ReadFile& read_file);
  uint64_t reserve(uint64_t bytes);
  void open_scratch();

  FileSystem& files_;
  const std::string scratch_path_;
  const Document& document_;
  MemoryBudget& budget_;
  GrowingCharge charge_;
  size_t first_ = 0;  // the document's first buffer that is not stored in the file
  std::deque<Decoded> decoded_;

  // Held shared by all threads that decode. Held exclusively by a thread that decodes a buffer
  // again, because the buffer did not fit in memory while others decoded.
  std::shared_mutex decoding_;
  std::mutex mutex_;  // held while a member below changes
  std::unique_ptr<WritableFile> writer_;
  std::unique_ptr<ReadableFile> reader_;
  uint64_t end_ = 0;
};

}  // namespace voxdag::gltf
