// Damages a file.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>

namespace voxdag {

// Flips the bits of `bits` in the byte at offset `at`. A second call restores the file.
inline void flip_bits(const std::string& path, uint64_t at, int bits) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(static_cast<std::streamoff>(at));
  const char byte = static_cast<char>(file.get() ^ bits);
  file.seekp(static_cast<std::streamoff>(at));
  file.put(byte);
}

}  // namespace voxdag
