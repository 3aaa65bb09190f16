// Elements of one accessor, decoded by windows: interleaved or packed, integers normalized or not,
// sparse replacements applied. Holds nothing of the accessor's data but, if it is sparse, one index
// in a thousand to find the replacements of a range by.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/gltf/document/document.h"
#include "core/scene/gltf/geometry/buffer_reader.h"

namespace voxdag::gltf {

class AccessorReader {
 public:
  // Throws Error{kInvalidInput} if sparse indices do not increase strictly or are out of range.
  // Both references must outlive the reader.
  AccessorReader(const Document& document, BufferReader& buffers, int accessor);

  uint64_t count() const { return accessor_.count; }

  // Elements [first, first + count), components() numbers each. Normalized integers c become c/max,
  // not below -1, in doubles.
  void read(uint64_t first, size_t count, double* out);
  // The same for what holds unsigned integers.
  void read(uint64_t first, size_t count, uint32_t* out);

 private:
  template <class T>
  void read_any(uint64_t first, size_t count, T* out);
  template <class T>
  void replace_sparse(uint64_t first, size_t count, T* out);
  // Sparse indices [first, first + count), into sparse_indices_.
  void read_sparse_indices(uint64_t first, size_t count);
  void check_sparse_indices();

  const Document& document_;
  BufferReader& buffers_;
  const Accessor& accessor_;
  const int index_;
  std::vector<uint32_t> sparse_indices_;    // a window of them
  std::vector<uint32_t> sparse_directory_;  // every kSparseWindow-th
};

}  // namespace voxdag::gltf
