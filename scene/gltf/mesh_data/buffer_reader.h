// Reads the bytes of a scene's buffers, in windows of up to kWindowBytes: from the scene file, from
// an external file, from base64 characters, or from decoded geometry. Not thread-safe.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/io/file_system.h"
#include "scene/gltf/compressed/decoded_buffers.h"
#include "scene/gltf/document/document.h"
#include "scene/growing_charge.h"
#include "scene/triangle_source.h"

namespace voxdag::gltf {

// The external files of a document that have been opened. Thread-safe.
class ExternalFiles {
 public:
  ExternalFiles(const std::string& scene_path, MemoryBudget& budget)
      : charge_(budget, "the list of external files of " + scene_path) {}
  // Records the opened file of a buffer. Throws Error{kInvalidInput} if the buffer's file was
  // recorded before and has changed since then.
  void add(int buffer, const SourceFile& file);
  std::vector<SourceFile> all() const;

 private:
  mutable std::mutex mutex_;
  std::map<int, SourceFile> by_buffer_;
  GrowingCharge charge_;
};

class BufferReader {
 public:
  static constexpr size_t kWindowBytes = size_t{192} << 10;

  // Makes one of `readers` readers of the document. Adds the files that it opens to
  // `external_files`. All arguments passed by reference must outlive the reader.
  BufferReader(FileSystem& files, const ReadableFile& scene_file, const Document& document,
               ExternalFiles& external_files, DecodedBuffers& decoded, MemoryBudget& budget,
               unsigned readers);

  // Checks the length of every buffer that triangles use. Throws Error{kInvalidInput} if a buffer
  // has fewer bytes than declared, Error{kNotFound} if an external file does not exist.
  void check_lengths();

  // Returns bytes [offset, offset + size) of a buffer, which must contain them. `size` is at most
  // kWindowBytes. The result is valid until the next call.
  std::span<const std::byte> window(int buffer, uint64_t offset, size_t size);

  // Checks one buffer like check_lengths().
  void check_length(int buffer);

  // Returns the budget to which the readers of the scene charge their memory.
  MemoryBudget& budget() { return budget_; }

 private:
  // Fills `out`, of any size, with the buffer's bytes from `offset`.
  void read(int buffer, uint64_t offset, std::span<std::byte> out);
  const ReadableFile& external(int buffer);
  std::span<const std::byte> decode_base64(int buffer, uint64_t offset, size_t size);

  FileSystem& files_;
  const ReadableFile& scene_file_;
  const Document& document_;
  ExternalFiles& external_files_;
  DecodedBuffers& decoded_;
  MemoryBudget& budget_;
  const size_t max_open_;
  PageBuffer<std::byte> window_;
  // Base64 characters of a window; allocated when a buffer first needs them.
  PageBuffer<std::byte> characters_;
  struct OpenFile {
    int buffer;
    std::unique_ptr<ReadableFile> file;
  };
  // Up to max_open_ external files. Before another one is opened, the file that was opened first is
  // closed.
  std::vector<OpenFile> open_;
};

}  // namespace voxdag::gltf
