#include "scene/ply/vertex_reader.h"

#include <algorithm>

#include "scene/messages.h"
#include "scene/ply/numbers.h"

namespace voxdag::ply {
namespace {

// Reads one property of `count` rows of `row_bytes` bytes each. The property of row i begins at
// bytes + i * row_bytes and is written to out[i * stride].
template <class T, bool kBigEndian>
void decode_property(const std::byte* bytes, size_t row_bytes, size_t count, size_t stride,
                     double* out) {
  for (size_t i = 0; i < count; ++i)
    out[stride * i] = static_cast<double>(load<T>(bytes + i * row_bytes, kBigEndian));
}

}  // namespace

VertexReader::VertexReader(const PlyFile& ply, std::span<const size_t> properties,
                           MemoryBudget& budget)
    : ply_(ply), properties_(properties.begin(), properties.end()), offsets_(properties.size()) {
  const auto& all = ply.vertex_element().properties;
  for (size_t i = 0; i < all.size(); ++i) {
    for (size_t p = 0; p < properties_.size(); ++p)
      if (properties_[p] == i) offsets_[p] = row_bytes_;
    row_bytes_ += bytes_of(all[i].type);
  }
  if (ply.format() == Format::kAscii)
    text_.emplace(ply.file(), budget);
  else
    window_.emplace(ply.file(), budget);
}

void VertexReader::read(uint64_t first, size_t count, double* out) {
  if (text_)
    read_text(first, count, out);
  else
    read_binary(first, count, out);
}

void VertexReader::read_binary(uint64_t first, size_t count, double* out) {
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

void VertexReader::read_text(uint64_t first, size_t count, double* out) {
  uint64_t vertex = first / PlyFile::kBlockRows * PlyFile::kBlockRows;
  text_->begin_row(ply_.vertex_blocks()[static_cast<size_t>(vertex / PlyFile::kBlockRows)]);
  std::vector<double> skipped(properties_.size());
  for (; vertex < first + count; ++vertex) {
    read_line(vertex, vertex < first ? skipped.data() : out);
    if (vertex >= first) out += properties_.size();
  }
}

void VertexReader::read_line(uint64_t vertex, double* out) {
  text_->begin_row(text_->offset());
  const auto& properties = ply_.vertex_element().properties;
  for (size_t i = 0; i < properties.size(); ++i) {
    const std::string_view word = text_->word();
    for (size_t p = 0; p < properties_.size(); ++p) {
      if (properties_[p] != i) continue;
      const auto value = parse_number(word, properties[i].type);
      if (!value)
        refuse(ply_.file().path(), "vertex " + std::to_string(vertex) + " has " + printable(word) +
                                       ", expected a number");
      out[p] = *value;
    }
  }
  text_->end_row();
}

}  // namespace voxdag::ply
