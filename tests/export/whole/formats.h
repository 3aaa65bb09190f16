// Decoders of files in the formats of `voxdag export`. They were written from the descriptions of
// the formats, or call the formats' own libraries. They share no code with the exports.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

#include "tests/export/whole/digest.h"

namespace voxdag::test {

// The exported grid in world space.
struct Grid {
  std::array<double, 3> origin;
  double voxel;  // edge length
  int levels;    // the grid has 2^levels voxels per edge

  int64_t resolution() const { return int64_t{1} << levels; }
  // Converts the world coordinate `world` to a cell coordinate. `shift` is the position within a
  // cell that the format stores: 0 for the low corner, 0.5 for the center. Ends the program if the
  // result is not an integer.
  int64_t cell(int axis, double world, double shift) const {
    const double cell = (world - origin[static_cast<size_t>(axis)]) / voxel - shift;
    const double rounded = std::rint(cell);
    if (std::abs(cell - rounded) > 1e-3) fail("a position is not where a voxel has one");
    return static_cast<int64_t>(rounded);
  }
};

// The bytes of a file. Reads little-endian numbers at any offset.
class MappedFile {
 public:
  explicit MappedFile(const std::string& path) {
    const int fd = open(path.c_str(), O_RDONLY);
    struct stat status;
    if (fd < 0 || fstat(fd, &status) != 0) fail(path + " cannot be read");
    size_ = static_cast<uint64_t>(status.st_size);
    void* const map = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, fd, 0);
    if (map == MAP_FAILED) fail(path + " cannot be mapped");
    data_ = static_cast<const char*>(map);
    close(fd);
  }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  ~MappedFile() { munmap(const_cast<char*>(data_), size_); }

  uint64_t size() const { return size_; }
  const char* at(uint64_t offset, uint64_t bytes) const {
    if (offset > size_ || bytes > size_ - offset) fail("the file is too short");
    return data_ + offset;
  }
  template <class Number>
  Number get(uint64_t offset) const {
    Number number;
    std::memcpy(&number, at(offset, sizeof number), sizeof number);
    return number;
  }
  std::string text(uint64_t offset, uint64_t bytes) const { return {at(offset, bytes), bytes}; }
  // Returns the line at `offset` without its end, and moves the offset to the next line.
  std::string line(uint64_t& offset) const {
    const uint64_t begin = offset;
    while (get<char>(offset) != '\n') ++offset;
    return text(begin, offset++ - begin);
  }

 private:
  const char* data_ = nullptr;
  uint64_t size_ = 0;
};

void digest_bt(const std::string& path, const Grid& grid, Digest& digest);
void digest_ply(const std::string& path, const Grid& grid, Digest& digest);
void digest_npz(const std::string& path, const Grid& grid, Digest& digest);
void digest_hashdag(const std::string& path, const Grid& grid, Digest& digest);
void digest_svdag(const std::string& path, const Grid& grid, Digest& digest);
void digest_voxel(const std::string& path, const Grid& grid, Digest& digest);
void digest_vox(const std::string& path, const Grid& grid, Digest& digest);
void digest_vdb(const std::string& path, const Grid& grid, Digest& digest);
void digest_nvdb(const std::string& path, const Grid& grid, Digest& digest);
// Adds the faces between voxels and empty cells, because a glb file stores only these.
void digest_glb(const std::string& path, const Grid& grid, Digest& digest);

}  // namespace voxdag::test
