#include "query/render/depth.h"

#include <bit>
#include <limits>

#include "core/base/parallel_for.h"
#include "query/ray_caster.h"
#include "query/render/surface.h"

namespace voxdag::query {

DepthMap render_depth(const DagView& dag, const Placement& placement, int width, int height,
                      unsigned threads, const CancelToken& cancel) {
  const Camera camera(placement, width, height);
  const RayCaster caster(dag);
  DepthMap map{width, height, {}};
  map.depths.resize(static_cast<size_t>(width) * static_cast<size_t>(height),
                    std::numeric_limits<float>::infinity());
  parallel_for(threads, static_cast<size_t>(height), [&](unsigned, size_t y) {
    cancel.check();
    for (int x = 0; x < width; ++x) {
      Hit hit;
      const Ray ray = camera.ray(x + 0.5, static_cast<double>(y) + 0.5);
      if (caster.cast(ray, visible_cone(camera.pixel_spread()), 0, kFarthest, hit))
        map.depths[y * static_cast<size_t>(width) + static_cast<size_t>(x)] =
            static_cast<float>(hit.t);
    }
  });
  return map;
}

std::string encode_npy(const DepthMap& map) {
  static_assert(std::endian::native == std::endian::little, "the file has little-endian numbers");
  std::string text = "{'descr': '<f4', 'fortran_order': False, 'shape': (" +
                     std::to_string(map.height) + ", " + std::to_string(map.width) + "), }";
  // The numbers begin at a multiple of 64 bytes, after ten bytes, this text and an end of line.
  text.append(63 - (10 + text.size()) % 64, ' ');
  text += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(text.size() & 255);
  bytes += static_cast<char>(text.size() >> 8);
  bytes += text;
  bytes.append(reinterpret_cast<const char*>(map.depths.data()), map.depths.size() * sizeof(float));
  return bytes;
}

}  // namespace voxdag::query
