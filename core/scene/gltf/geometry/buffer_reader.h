// The bytes of a scene's buffers, read by windows wherever they lie: in the scene file, in an
// external file, or as base64 characters. Not thread-safe.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/io/file_system.h"
#include "core/scene/gltf/document/document.h"
#include "core/scene/triangle_source.h"

namespace voxdag::gltf {

class BufferReader {
 public:
  static constexpr size_t kWindowBytes = size_t{256} << 10;

  // Checks that every buffer that is read has as many bytes as it claims, else
  // Error{kInvalidInput}; Error{kNotFound} for an external file that is not there.
  BufferReader(FileSystem& files, const ReadableFile& scene_file, const Document& document,
               MemoryBudget& budget);

  // Bytes [offset, offset + size) of a buffer, at most kWindowBytes of them, inside it. Valid until
  // the next call.
  std::span<const std::byte> window(int buffer, uint64_t offset, size_t size);

  // Files beside the scene file that were opened, by buffer. The identity is unknown of one that
  // had changed when it was opened again.
  const std::map<int, SourceFile>& external_files() const { return external_files_; }

 private:
  void check_length(int buffer);
  const ReadableFile& external(int buffer);
  std::span<const std::byte> decode_base64(int buffer, uint64_t offset, size_t size);

  FileSystem& files_;
  const ReadableFile& scene_file_;
  const Document& document_;
  MemoryBudget& budget_;
  PageBuffer<std::byte> window_;
  PageBuffer<std::byte> characters_;  // base64 of a window, once that is needed
  // External files that are open, by buffer; few at a time, the oldest is closed.
  struct OpenFile {
    int buffer;
    std::unique_ptr<ReadableFile> file;
  };
  std::vector<OpenFile> open_;
  std::map<int, SourceFile> external_files_;
};

}  // namespace voxdag::gltf
