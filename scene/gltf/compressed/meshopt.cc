// The only file that calls meshoptimizer. Its decoders allocate no memory and check their input.
// Vertex streams of version 1 and the filter COLOR, which most versions of the library lack, are
// decoded by voxdag.
#include "scene/gltf/compressed/codecs.h"
#include "scene/gltf/compressed/color_filter.h"
#include "scene/gltf/compressed/vertex_stream.h"

#ifdef VOXDAG_HAS_MESHOPT
#include <meshoptimizer.h>
#endif

namespace voxdag::gltf {

#ifdef VOXDAG_HAS_MESHOPT

void decode_meshopt(const MeshoptView& view, std::span<const std::byte> compressed,
                    std::span<std::byte> out) {
  const auto* const from = reinterpret_cast<const unsigned char*>(compressed.data());
  const auto count = static_cast<size_t>(view.count);
  const auto stride = static_cast<size_t>(view.stride);
  int failure = 0;
  if (view.mode == MeshoptView::Mode::kAttributes && is_vertex_stream_1(compressed))
    failure = decode_vertex_stream_1(compressed, stride, out) ? 0 : 1;
  else if (view.mode == MeshoptView::Mode::kAttributes)
    failure = meshopt_decodeVertexBuffer(out.data(), count, stride, from, compressed.size());
  else if (view.mode == MeshoptView::Mode::kTriangles)
    failure = meshopt_decodeIndexBuffer(out.data(), count, stride, from, compressed.size());
  else
    failure = meshopt_decodeIndexSequence(out.data(), count, stride, from, compressed.size());
  if (failure != 0)
    throw BrokenData{"its compressed bytes do not hold " + std::to_string(view.count) +
                     " elements: they are damaged, cut off, or of a later version"};
  switch (view.filter) {
    case MeshoptView::Filter::kNone:
      return;
    case MeshoptView::Filter::kOctahedral:
      return meshopt_decodeFilterOct(out.data(), count, stride);
    case MeshoptView::Filter::kQuaternion:
      return meshopt_decodeFilterQuat(out.data(), count, stride);
    case MeshoptView::Filter::kExponential:
      return meshopt_decodeFilterExp(out.data(), count, stride);
    case MeshoptView::Filter::kColor:
      return decode_color_filter(out, stride);
  }
}

#else

void decode_meshopt(const MeshoptView&, std::span<const std::byte>, std::span<std::byte>) {
  throw BrokenData{"voxdag was built without libmeshoptimizer: expected a decompressed file"};
}

#endif

}  // namespace voxdag::gltf
