#include "scene/gltf/mesh_data/instance_reader.h"

#include <algorithm>
#include <array>

namespace voxdag::gltf {
namespace {

constexpr uint64_t kWindow = 256;

template <size_t N>
std::vector<std::array<double, N>> read_or(std::optional<AccessorReader>& reader, uint64_t first,
                                           size_t count, const std::array<double, N>& absent) {
  std::vector<std::array<double, N>> values(count, absent);
  if (reader) reader->read(first, count, values[0].data());
  return values;
}

}  // namespace

InstanceReader::InstanceReader(const Document& document, BufferReader& buffers, const Node& node)
    : present_(node.instancing.present), count_(instance_count(document, node)) {
  const Instancing& instancing = node.instancing;
  if (instancing.translation >= 0) translation_.emplace(document, buffers, instancing.translation);
  if (instancing.rotation >= 0) rotation_.emplace(document, buffers, instancing.rotation);
  if (instancing.scale >= 0) scale_.emplace(document, buffers, instancing.scale);
}

Transform InstanceReader::at(uint64_t instance) {
  if (!present_) return {};
  if (instance < first_ || instance >= first_ + window_.size())
    read_window(instance - instance % kWindow);
  return window_[static_cast<size_t>(instance - first_)];
}

void InstanceReader::read_window(uint64_t first) {
  const auto count = static_cast<size_t>(std::min(kWindow, count_ - first));
  const auto translations = read_or<3>(translation_, first, count, {0, 0, 0});
  const auto rotations = read_or<4>(rotation_, first, count, {0, 0, 0, 1});
  const auto scales = read_or<3>(scale_, first, count, {1, 1, 1});
  window_.resize(count);
  for (size_t i = 0; i < count; ++i)
    window_[i] = from_trs(translations[i], rotations[i], scales[i]);
  first_ = first;
}

}  // namespace voxdag::gltf
