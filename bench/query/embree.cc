#include "bench/query/embree.h"

#ifdef VOXDAG_BENCH_EMBREE

#include <embree3/rtcore.h>

#include <atomic>
#include <limits>
#include <memory>
#include <stdexcept>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/formats/formats.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {
namespace {

constexpr unsigned kWide = 8;  // rays per packet
const float kInfinity = std::numeric_limits<float>::infinity();

std::atomic<int64_t> embree_bytes;

bool count_bytes(void*, ssize_t bytes, bool) {
  embree_bytes += bytes;
  return true;
}

struct Release {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using Device = std::unique_ptr<RTCDeviceTy, Release>;
using Scene = std::unique_ptr<RTCSceneTy, Release>;

// Reads the triangles of a scene file, with coordinates in voxels of `dag`: nine floats for each.
std::vector<float> read_triangles(const DagFile& dag, const std::string& path) {
  MemoryBudget budget(UINT64_MAX);
  const CancelToken cancel;
  const auto scene = open_scene(system_files(), {path}, {}, budget, cancel);
  const Coordinates origin = dag.origin();
  const double voxels_per_unit = static_cast<double>(dag.resolution()) / dag.edge();
  std::vector<float> vertices;
  scene->open(1)->read(0, scene->declared_triangles(), [&](std::span<const RealTriangle> some) {
    for (const RealTriangle& triangle : some)
      for (const double(&vertex)[3] : triangle.v)
        for (size_t axis = 0; axis < 3; ++axis)
          vertices.push_back(static_cast<float>((vertex[axis] - origin[axis]) * voxels_per_unit));
  });
  return vertices;
}

Scene build_scene(RTCDevice device, const std::vector<float>& vertices) {
  Scene scene(rtcNewScene(device));
  rtcSetSceneBuildQuality(scene.get(), RTC_BUILD_QUALITY_MEDIUM);  // the default
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* const points = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              3 * sizeof(float), vertices.size() / 3));
  auto* const corners = static_cast<uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(uint32_t), vertices.size() / 9));
  if (!points || !corners) throw std::runtime_error("Embree: the triangles do not fit in memory");
  std::copy(vertices.begin(), vertices.end(), points);
  for (size_t i = 0; i < vertices.size() / 3; ++i) corners[i] = static_cast<uint32_t>(i);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene.get());
  return scene;
}

RTCRay ray_of(const RaySet& rays, size_t i) {
  RTCRay ray{};
  const auto& [o, d] = std::pair(rays.origins[i], rays.directions[i]);
  ray.org_x = static_cast<float>(o[0]);
  ray.org_y = static_cast<float>(o[1]);
  ray.org_z = static_cast<float>(o[2]);
  ray.dir_x = static_cast<float>(d[0]);
  ray.dir_y = static_cast<float>(d[1]);
  ray.dir_z = static_cast<float>(d[2]);
  ray.tfar = kInfinity;
  ray.mask = UINT32_MAX;
  return ray;
}

void set_ray(RTCRay8& to, unsigned lane, const RTCRay& ray) {
  to.org_x[lane] = ray.org_x;
  to.org_y[lane] = ray.org_y;
  to.org_z[lane] = ray.org_z;
  to.tnear[lane] = ray.tnear;
  to.dir_x[lane] = ray.dir_x;
  to.dir_y[lane] = ray.dir_y;
  to.dir_z[lane] = ray.dir_z;
  to.time[lane] = 0;
  to.tfar[lane] = ray.tfar;
  to.mask[lane] = ray.mask;
  to.id[lane] = to.flags[lane] = 0;
}

Timing cast_singly(RTCScene scene, const RaySet& rays, RTCIntersectContextFlags flags, bool any) {
  return best_of_three(rays.origins.size(), [&] {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = flags;
    uint64_t found = 0;
    for (size_t i = 0; i < rays.origins.size(); ++i) {
      RTCRayHit hit{};
      hit.ray = ray_of(rays, i);
      hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      if (any) {
        rtcOccluded1(scene, &context, &hit.ray);
        found += hit.ray.tfar < 0;
      } else {
        rtcIntersect1(scene, &context, &hit);
        found += hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
      }
    }
    return found;
  });
}

// Does not cast the rays that remain after the last complete packet, at most kWide - 1.
Timing cast_packets(RTCScene scene, const RaySet& rays, RTCIntersectContextFlags flags, bool any) {
  alignas(32) static const int valid[kWide] = {-1, -1, -1, -1, -1, -1, -1, -1};
  return best_of_three(rays.origins.size(), [&] {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = flags;
    uint64_t found = 0;
    for (size_t first = 0; first + kWide <= rays.origins.size(); first += kWide) {
      RTCRayHit8 hit;
      for (unsigned lane = 0; lane < kWide; ++lane) {
        set_ray(hit.ray, lane, ray_of(rays, first + lane));
        hit.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
        hit.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
      }
      if (any)
        rtcOccluded8(valid, scene, &context, &hit.ray);
      else
        rtcIntersect8(valid, scene, &context, &hit);
      for (unsigned lane = 0; lane < kWide; ++lane)
        found += any ? hit.ray.tfar[lane] < 0 : hit.hit.geomID[lane] != RTC_INVALID_GEOMETRY_ID;
    }
    return found;
  });
}

}  // namespace

std::optional<EmbreeTimings> measure_embree(const DagFile& dag, const std::string& path,
                                            const RaySet& primary, const RaySet& shadows) {
  const std::vector<float> vertices = read_triangles(dag, path);
  // One thread, so that the CPU time of this thread is the CPU time of the build.
  const Device device(rtcNewDevice("threads=1,set_affinity=0"));
  if (!device) throw std::runtime_error("Embree: no device");
  embree_bytes = 0;
  rtcSetDeviceMemoryMonitorFunction(device.get(), count_bytes, nullptr);
  EmbreeTimings timings;
  const double start = process_seconds();
  const Scene scene = build_scene(device.get(), vertices);
  timings.build_seconds = process_seconds() - start;
  if (rtcGetDeviceError(device.get()) != RTC_ERROR_NONE)
    throw std::runtime_error("Embree: the tree of " + path + " was not built");
  timings.triangles = vertices.size() / 9;
  timings.bytes = static_cast<uint64_t>(embree_bytes.load());
  const auto coherent = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  timings.primary = cast_singly(scene.get(), primary, coherent, false);
  timings.primary_of_8 = cast_packets(scene.get(), primary, coherent, false);
  timings.shadow = cast_singly(scene.get(), shadows, coherent, true);
  timings.shadow_of_8 = cast_packets(scene.get(), shadows, coherent, true);
  return timings;
}

}  // namespace voxdag::query

#else

namespace voxdag::query {

std::optional<EmbreeTimings> measure_embree(const DagFile&, const std::string&, const RaySet&,
                                            const RaySet&) {
  return {};
}

}  // namespace voxdag::query

#endif
