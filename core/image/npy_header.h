// The header of numpy's .npy files, version 1.0 (numpy.lib.format). Stateless; thread-safe.
#pragma once

#include <string>

namespace voxdag {

// Returns the header of an array in C order. The header has at most 64 KiB and is padded so that
// the numbers of the array begin at a multiple of 64 bytes. Examples: `type` is "<f4"
// (little-endian floats of 4 bytes), `shape` is "(7, 3)".
inline std::string npy_header(const std::string& type, const std::string& shape) {
  std::string text = "{'descr': '" + type + "', 'fortran_order': False, 'shape': " + shape + ", }";
  // The header has ten bytes before this text, and an end of line after it.
  text.append(63 - (10 + text.size()) % 64, ' ');
  text += '\n';
  std::string header("\x93NUMPY\x01\x00", 8);
  header += static_cast<char>(text.size() & 255);
  header += static_cast<char>(text.size() >> 8);
  return header + text;
}

}  // namespace voxdag
