#include "scene/gltf/mesh_data/corner_reader.h"

#include <numeric>

namespace voxdag::gltf {

CornerReader::CornerReader(const Document& document, BufferReader& buffers,
                           const Primitive& primitive)
    : mode_(primitive.mode) {
  if (primitive.indices >= 0) indices_.emplace(document, buffers, primitive.indices);
}

void CornerReader::read(uint64_t first, size_t count, uint32_t* corners) {
  if (mode_ == kTriangleList) return read_indices(3 * first, 3 * count, corners);
  row_.resize(count + 2);
  read_indices(first, count + 2, row_.data());
  // Every triangle of a fan shares the first vertex.
  uint32_t hub = row_[0];
  if (mode_ == kTriangleFan) read_indices(0, 1, &hub);
  for (size_t i = 0; i < count; ++i) {
    *corners++ = mode_ == kTriangleFan ? hub : row_[i];
    *corners++ = row_[i + 1];
    *corners++ = row_[i + 2];
  }
}

void CornerReader::read_indices(uint64_t first, size_t count, uint32_t* out) {
  if (indices_)
    indices_->read(first, count, out);
  else
    std::iota(out, out + count, static_cast<uint32_t>(first));
}

}  // namespace voxdag::gltf
