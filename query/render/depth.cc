#include "query/render/depth.h"

#include <bit>
#include <limits>

#include "core/base/parallel_for.h"
#include "core/image/npy_header.h"
#include "query/rays/ray_caster.h"
#include "query/render/surface_hit.h"

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
  std::string bytes =
      npy_header("<f4", "(" + std::to_string(map.height) + ", " + std::to_string(map.width) + ")");
  bytes.append(reinterpret_cast<const char*>(map.depths.data()), map.depths.size() * sizeof(float));
  return bytes;
}

}  // namespace voxdag::query
