// Maps the first part of a file that another process still extends, with other bytes instead of the
// file's first bytes (the head), and with further bytes after the mapped part (the tail). So a
// reader that expects a complete file can read a file whose first and last bytes are not written
// yet. The mapping is read-only, and thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace voxdag {

class FramedMapping {
 public:
  // Maps the bytes [0, tail_offset) of the file. Copies `head` to the mapping's begin, and `tail`
  // to its byte `tail_offset`, which must not be less than the size of `head`. Throws Error:
  // kNotFound, kCorrupt if the file is shorter than `tail_offset`, kInvalidInput if `path` is not a
  // regular file, for example a symbolic link.
  FramedMapping(const std::string& path, std::span<const std::byte> head, uint64_t tail_offset,
                std::span<const std::byte> tail);
  ~FramedMapping();
  FramedMapping(const FramedMapping&) = delete;
  FramedMapping& operator=(const FramedMapping&) = delete;

  const std::byte* data() const { return data_; }
  uint64_t size() const { return size_; }
  // Returns the inode of the mapped file.
  uint64_t inode() const { return inode_; }

 private:
  std::byte* data_ = nullptr;
  uint64_t size_ = 0;
  uint64_t inode_ = 0;
};

}  // namespace voxdag
