#include "scene/gltf/mesh_data/corner_reader.h"

#include <algorithm>
#include <numeric>

#include "scene/gltf/document/strip_restarts.h"

namespace voxdag::gltf {

CornerReader::CornerReader(const Document& document, BufferReader& buffers,
                           const Primitive& primitive)
    : mode_(primitive.mode), restarts_(primitive.restarts) {
  if (primitive.indices >= 0) indices_.emplace(document, buffers, primitive.indices);
}

void CornerReader::read(uint64_t first, size_t count, uint32_t* corners) {
  if (restarts_) return read_restarts(first, count, corners);
  if (mode_ == kTriangleList) return read_indices(3 * first, 3 * count, corners);
  row_.resize(count + 2);
  read_indices(first, count + 2, row_.data());
  // The first vertex of a fan is in each of its triangles, but in row_ only if `first` is 0.
  uint32_t hub = row_[0];
  if (mode_ == kTriangleFan) read_indices(0, 1, &hub);
  for (size_t i = 0; i < count; ++i) {
    *corners++ = mode_ == kTriangleFan ? hub : row_[i];
    *corners++ = row_[i + 1];
    *corners++ = row_[i + 2];
  }
}

void CornerReader::read_restarts(uint64_t first, size_t count, uint32_t* corners) {
  constexpr uint64_t kWindow = 4096;
  RestartIndex::Entry next = restarts_->entries[first / RestartIndex::kTriangles];
  uint64_t skipped = first % RestartIndex::kTriangles;
  while (count > 0) {
    row_.resize(static_cast<size_t>(std::min(kWindow, indices_->count() - next.at)));
    read_indices(next.at, row_.size(), row_.data());
    next.at += row_.size();
    for (size_t i = 0; i < row_.size() && count > 0; ++i) {
      if (!next.walk.add(row_[i], corners)) continue;
      if (skipped > 0) {
        --skipped;
        continue;
      }
      corners += 3;
      --count;
    }
  }
}

void CornerReader::read_indices(uint64_t first, size_t count, uint32_t* out) {
  if (indices_)
    indices_->read(first, count, out);
  else
    std::iota(out, out + count, static_cast<uint32_t>(first));
}

}  // namespace voxdag::gltf
