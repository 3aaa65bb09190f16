#include "scene/ply/vertex_reader.h"

#include <algorithm>

#include "scene/ply/rows/numbers.h"

namespace voxdag::ply {
namespace {

// Reads one property of `count` rows of `row_bytes` bytes each. The property of row i begins at
// bytes + i * row_bytes and is written to out[i * stride].
template <class T, bool kBigEndian>
void decode_property(const std::byte* bytes, size_t row_bytes, size_t count, size_t stride,
                     double* out) {
  for (size_t i = 0; i < count; ++i)
    out[stride * i] = static_cast<double>(load_number<T>(bytes + i * row_bytes, kBigEndian));
}

}  // namespace

VertexReader::VertexReader(const PlyFile& ply, std::span<const size_t> properties,
                           MemoryBudget& budget)
    : ply_(ply), properties_(properties.begin(), properties.end()), offsets_(properties.size()) {
  const Element& element = ply.vertex_element();
  const bool has_list = std::ranges::any_of(element.properties, &Property::is_list);
  if (ply.format() == Format::kAscii || has_list) {
    rows_ = open_rows(ply.file(), ply.format(), element, {.numbers = properties_}, budget);
    return;
  }
  for (size_t i = 0; i < element.properties.size(); ++i) {
    for (size_t p = 0; p < properties_.size(); ++p)
      if (properties_[p] == i) offsets_[p] = row_bytes_;
    row_bytes_ += bytes_of(element.properties[i].type);
  }
  window_.emplace(ply.file(), budget);
}

void VertexReader::read(uint64_t first, size_t count, double* out) {
  if (rows_)
    read_rows(first, count, out);
  else
    read_fixed(first, count, out);
}

void VertexReader::read_fixed(uint64_t first, size_t count, double* out) {
  const size_t stride = properties_.size();
  const size_t at_once = FileWindow::kBytes / row_bytes_;
  const bool is_big_endian = ply_.format() == Format::kBigEndian;
  while (count > 0) {
    const size_t n = std::min(count, at_once);
    const auto bytes = window_->at(ply_.vertices_begin() + first * row_bytes_, n * row_bytes_);
    for (size_t p = 0; p < stride; ++p) {
      const std::byte* const begin = bytes.data() + offsets_[p];
      with_type(ply_.vertex_element().properties[properties_[p]].type, [&]<class T>(T) {
        if (is_big_endian)
          decode_property<T, true>(begin, row_bytes_, n, stride, out + p);
        else
          decode_property<T, false>(begin, row_bytes_, n, stride, out + p);
      });
    }
    first += n;
    count -= n;
    out += stride * n;
  }
}

void VertexReader::read_rows(uint64_t first, size_t count, double* out) {
  uint64_t vertex = first / PlyFile::kBlockRows * PlyFile::kBlockRows;
  uint64_t offset = ply_.vertex_blocks()[static_cast<size_t>(vertex / PlyFile::kBlockRows)];
  for (; vertex < first + count; ++vertex) {
    offset = rows_->read(vertex, offset);
    if (vertex >= first) out = std::ranges::copy(rows_->numbers(), out).out;
  }
}

}  // namespace voxdag::ply
