// Decodes ranges of the elements of one accessor. The elements can be interleaved or packed,
// normalized integers or not, and have sparse replacements. Every 1024th index of a sparse accessor
// is kept in memory, to find the replacements of a range. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "scene/gltf/document/document.h"
#include "scene/gltf/mesh_data/buffer_reader.h"

namespace voxdag::gltf {

class AccessorReader {
 public:
  // Throws Error{kInvalidInput} if sparse indices are out of range or do not increase strictly.
  // Throws Error{kOutOfMemory} if the table for finding sparse indices does not fit the budget of
  // `buffers`. `document` and `buffers` must outlive the reader.
  AccessorReader(const Document& document, BufferReader& buffers, int accessor);

  uint64_t count() const { return accessor_.count; }

  // Reads elements [first, first + count), with one number per component. A normalized integer c
  // becomes max(c / the maximum of its type, -1). T is double, or uint32_t for an accessor of
  // unsigned integers.
  template <class T>
  void read(uint64_t first, size_t count, T* out);

 private:
  template <class T>
  void replace_sparse(uint64_t first, size_t count, T* out);
  // Reads sparse indices [first, first + count) into sparse_indices_.
  void read_sparse_indices(uint64_t first, size_t count);
  void check_sparse_indices();

  const Document& document_;
  BufferReader& buffers_;
  const Accessor& accessor_;
  const int index_;
  std::vector<uint32_t> sparse_indices_;    // one window of the sparse indices
  std::vector<uint32_t> sparse_directory_;  // every kSparseWindow-th sparse index
  MemoryCharge directory_charge_;
};

}  // namespace voxdag::gltf
