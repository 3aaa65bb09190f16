#include "bench/query/cold.h"

#include <sys/mman.h>
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <limits>
#include <utility>

#include "bench/page_cache.h"
#include "core/format/global/open_global.h"
#include "query/rays/ray_caster.h"
#include "query/render/camera.h"
#include "query/render/views.h"

namespace voxdag::query {
namespace {

constexpr int kWidth = 1280, kHeight = 720;

uint64_t hits_of(const DagView& dag, const Camera& camera) {
  const RayCaster caster(dag);
  const Cone pixel{0, camera.pixel_spread()};
  uint64_t hits = 0;
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      Hit hit;
      hits += caster.cast(camera.ray(x + 0.5, y + 0.5), pixel, 0,
                          std::numeric_limits<double>::infinity(), hit);
    }
  return hits;
}

int64_t major_faults() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_majflt;
}

}  // namespace

void measure_cold(const std::string& path) {
  const auto file = open_global_file(path);
  const DagView dag(*file);
  const Camera camera(named_view("auto", dag, double{kWidth} / kHeight, {}), kWidth, kHeight);
  std::printf("%s, a cold picture of %d x %d\n", path.c_str(), kWidth, kHeight);
  for (const auto& [advice, name] :
       {std::pair{MADV_RANDOM, "single pages"}, std::pair{MADV_NORMAL, "with read-ahead"}}) {
    file->release_pages();
    drop_from_page_cache(path);
    madvise(const_cast<unsigned char*>(file->data()), file->file_bytes(), advice);
    const int64_t faults = major_faults();
    const auto start = std::chrono::steady_clock::now();
    const uint64_t hits = hits_of(dag, camera);
    std::printf("  %-22s %10lld major faults   %.2f s   found %llu\n", name,
                static_cast<long long>(major_faults() - faults),
                std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
                static_cast<unsigned long long>(hits));
    std::fflush(stdout);
  }
}

}  // namespace voxdag::query
