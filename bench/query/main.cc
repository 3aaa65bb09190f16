// Measures the speed of queries on one core, with the file in memory. It compares this library, a
// plain loop over the reader, and OpenVDB and OctoMap (if they are installed) on the same cells.
//
//     bench_query [--levels N] [--picture EDGE] [--rays] [--cold] [--scene SCENE] FILE.vdag...
//
// --levels: the queries use the grid of 2^N cells per edge (default: the file's grid), and rays
// stop at its cells. --picture: casts rays through the pixels of a square picture with this edge
// (default: 1024). --rays: measures only rays. --cold: measures only the page faults of a picture
// of a file that is not in memory. --scene: also casts the rays with Embree (if it is installed) at
// the triangles of this scene, from which the following files were built.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <limits>
#include <string>

#include "bench/query/cold.h"
#include "bench/query/embree.h"
#include "bench/query/others.h"
#include "bench/query/query_set.h"
#include "query/rays/ray_caster.h"

namespace voxdag::query {
namespace {

constexpr size_t kPoints = 2'000'000;
constexpr size_t kNearestPoints = 2000;
constexpr size_t kReaderBoxes = 20;
// The other libraries get grids of at most 2^11 cells per edge, because OctoMap needs about 5 GB of
// memory for Sponza on a grid of this size.
constexpr uint32_t kMaxOtherLevels = 11;

constexpr double kEndless = std::numeric_limits<double>::infinity();

// Prints a timing, and whether its `found` differs from expected->found. `expected` is an earlier
// timing of the same queries. It is null if there is none, or if the two results need not be equal.
void print(const char* who, const char* what, const Timing& timing,
           const Timing* expected = nullptr) {
  std::printf("  %-22s %-22s %10.4f M/s   found %llu%s\n", who, what, timing.per_second / 1e6,
              static_cast<unsigned long long>(timing.found),
              expected && expected->found != timing.found ? ", which differs" : "");
  std::fflush(stdout);
}

uint64_t sum(const std::vector<uint8_t>& set) {
  uint64_t found = 0;
  for (const uint8_t s : set) found += s;
  return found;
}

// True if cell `p` is set: the file has a voxel at `p` or, if the grid is coarser than the file's,
// a node or brick. The grid with half the file's resolution is not supported.
bool reader_has(const voxdag_reader::File& file, uint32_t grid_levels, const Position& p) {
  if (grid_levels == file.grid_levels()) return file.voxel(p[0], p[1], p[2]);
  uint64_t offset = 0;
  for (uint32_t l = 0; l < grid_levels; ++l) {
    const uint32_t shift = grid_levels - 1 - l;
    const int index =
        static_cast<int>((p[0] >> shift & 1) << 2 | (p[1] >> shift & 1) << 1 | (p[2] >> shift & 1));
    const voxdag_reader::Node node = file.node(l, offset);
    if (!(node.child_mask >> index & 1)) return false;
    offset = voxdag_reader::File::child(node, index);
  }
  return true;
}

// Measures all kinds of lookups of one library.
template <class LookUp>
void lookups(const char* who, const QuerySet& queries, Timings& timings, const Timings* expected,
             const LookUp& look_up) {
  timings.uniform = best_of_three(kPoints, [&] { return look_up(queries.uniform); });
  print(who, "uniform points", timings.uniform, expected ? &expected->uniform : nullptr);
  timings.set_cells = best_of_three(kPoints, [&] { return look_up(queries.set_cells); });
  print(who, "set cells", timings.set_cells, expected ? &expected->set_cells : nullptr);
}

void lookups(const DagFile& dag, uint32_t grid_levels, const QuerySet& queries, Timings& timings) {
  std::vector<uint8_t> set(kPoints);
  lookups("voxdag", queries, timings, nullptr, [&](const std::vector<Position>& points) {
    dag.lookup(points, grid_levels, set);
    return sum(set);
  });
  if (grid_levels + 2 > dag.grid_levels() && grid_levels < dag.grid_levels()) return;
  Timings reader;
  lookups("loop over the reader", queries, reader, &timings,
          [&](const std::vector<Position>& points) {
            uint64_t found = 0;
            for (const Position& p : points) found += reader_has(dag.file(), grid_levels, p);
            return found;
          });
}

// The rays of a picture, and the rays from their hits toward a light, in voxels of the file. A ray
// to the light begins two cells before the hit, so that the hit cell and its neighbors on a slope
// do not hide the light.
struct PictureRays {
  RaySet primary, shadows;
};

PictureRays picture_rays(const DagFile& dag, double cell, const QuerySet& queries) {
  const double length = std::sqrt(0.35 * 0.35 + 0.87 * 0.87 + 0.35 * 0.35);
  const Coordinates light = {0.35 / length, 0.87 / length, 0.35 / length};
  PictureRays rays{{queries.origins, queries.directions}, {}};
  for (Coordinates& origin : rays.primary.origins)
    for (double& c : origin) c *= cell;
  std::vector<RayHit> hits(rays.primary.origins.size());
  dag.rays(rays.primary.origins, rays.primary.directions, {kEndless, cell}, hits);
  for (size_t i = 0; i < hits.size(); ++i) {
    if (!hits[i].hit) continue;
    const double t = std::max(0.0, hits[i].distance - 2 * cell);
    Coordinates start = rays.primary.origins[i];
    for (size_t axis = 0; axis < 3; ++axis) start[axis] += t * rays.primary.directions[i][axis];
    rays.shadows.origins.push_back(start);
    rays.shadows.directions.push_back(light);
  }
  return rays;
}

uint64_t hits_of(const DagFile& dag, double cell, const RaySet& rays, std::vector<RayHit>& hits) {
  dag.rays(rays.origins, rays.directions, {kEndless, cell}, hits);
  uint64_t found = 0;
  for (const RayHit& hit : hits) found += hit.hit;
  return found;
}

Timing rays(const DagFile& dag, double cell, const PictureRays& picture) {
  std::vector<RayHit> hits(picture.primary.origins.size());
  const Timing primary =
      best_of_three(hits.size(), [&] { return hits_of(dag, cell, picture.primary, hits); });
  print("voxdag", "primary rays", primary);
  const DagView view(dag.file());
  const RayCaster caster(view);
  const auto one_by_one = [&](const RaySet& rays) {
    return best_of_three(rays.origins.size(), [&] {
      uint64_t found = 0;
      for (size_t i = 0; i < rays.origins.size(); ++i) {
        const auto& [o, d] = std::pair(rays.origins[i], rays.directions[i]);
        const Ray ray{{{o[0], o[1], o[2]}}, {{d[0], d[1], d[2]}}};
        found += caster.occluded(ray, {cell, 0}, 0, kEndless);
      }
      return found;
    });
  };
  print("one ray per call", "primary rays", one_by_one(picture.primary), &primary);
  if (picture.shadows.origins.empty()) return primary;
  std::vector<uint8_t> occluded(picture.shadows.origins.size());
  const Timing shadows = best_of_three(occluded.size(), [&] {
    dag.occluded(picture.shadows.origins, picture.shadows.directions, {kEndless, cell}, occluded);
    return sum(occluded);
  });
  print("voxdag", "shadow rays, any hit", shadows);
  hits.resize(occluded.size());
  const Timing first =
      best_of_three(hits.size(), [&] { return hits_of(dag, cell, picture.shadows, hits); });
  print("voxdag", "shadow rays, first hit", first, &shadows);
  print("one ray per call", "shadow rays, any hit", one_by_one(picture.shadows), &shadows);
  return primary;
}

// Embree has the triangles in memory, and voxdag the voxels.
void embree_rays(const DagFile& dag, const std::string& scene, const PictureRays& picture) {
  const std::optional<EmbreeTimings> timings =
      measure_embree(dag, scene, picture.primary, picture.shadows);
  if (!timings) {
    std::printf("  %-22s not installed\n", "Embree");
    return;
  }
  std::printf("  %-22s %llu triangles, %.1f MiB; the file with the voxels %.1f MiB\n", "Embree",
              static_cast<unsigned long long>(timings->triangles),
              static_cast<double>(timings->bytes) / 0x1p20,
              static_cast<double>(dag.file_bytes()) / 0x1p20);
  std::printf("  %-22s %-22s %10.3f s of CPU time\n", "Embree", "building the tree",
              timings->build_seconds);
  print("Embree, one per call", "primary rays", timings->primary);
  print("Embree, 8 per call", "primary rays", timings->primary_of_8);
  if (picture.shadows.origins.empty()) return;
  print("Embree, one per call", "shadow rays, any hit", timings->shadow);
  print("Embree, 8 per call", "shadow rays, any hit", timings->shadow_of_8);
}

// Reads the cells of a few boxes one by one.
void reader_boxes(const DagFile& dag, uint32_t grid_levels, const QuerySet& queries) {
  const int64_t edge = int64_t{1} << grid_levels;
  std::vector<uint8_t> cells(kBoxEdge * kBoxEdge * kBoxEdge);
  print("loop over the reader", "boxes of 64^3, a few", best_of_three(kReaderBoxes, [&] {
          uint64_t found = 0;
          for (size_t i = 0; i < kReaderBoxes; ++i) {
            const Region box = box_around(queries, i);
            size_t at = 0;
            for (int64_t x = box.low[0]; x < box.high[0]; ++x)
              for (int64_t y = box.low[1]; y < box.high[1]; ++y)
                for (int64_t z = box.low[2]; z < box.high[2]; ++z, ++at) {
                  const bool inside = std::min({x, y, z}) >= 0 && std::max({x, y, z}) < edge;
                  cells[at] = inside && reader_has(dag.file(), grid_levels, {x, y, z});
                }
            found += sum(cells);
          }
          return found;
        }));
}

void regions(const DagFile& dag, uint32_t grid_levels, const QuerySet& queries, Timings& timings) {
  std::vector<uint8_t> cells(kBoxEdge * kBoxEdge * kBoxEdge);
  timings.boxes = measure_boxes(cells, [&](size_t i) {
    dag.box({grid_levels, box_around(queries, i)}, cells);
  });
  print("voxdag", "boxes of 64^3", timings.boxes);
  if (grid_levels + 2 <= dag.grid_levels() || grid_levels == dag.grid_levels())
    reader_boxes(dag, grid_levels, queries);
  timings.counts = best_of_three(kBoxes, [&] {
    uint64_t found = 0;
    for (size_t i = 0; i < kBoxes; ++i) found += dag.count({grid_levels, box_around(queries, i)});
    return found;
  });
  print("voxdag", "counts of 64^3", timings.counts, &timings.boxes);
  std::vector<Nearest> nearest(kNearestPoints);
  print("voxdag", "nearest, uniform", best_of_three(kNearestPoints, [&] {
          dag.nearest(std::span(queries.uniform).first(kNearestPoints), grid_levels,
                      std::numeric_limits<double>::infinity(), nearest);
          uint64_t found = 0;
          for (const Nearest& n : nearest) found += n.found;
          return found;
        }));
}

struct Settings {
  uint32_t grid_levels = 20;
  int picture = 1024;
  bool only_rays = false;
  bool only_cold = false;
  std::string scene;  // empty: no Embree
};

void measure(const std::string& path, const Settings& settings) {
  if (settings.only_cold) return measure_cold(path);
  const DagFile dag(path);
  const uint32_t levels = std::min(settings.grid_levels, dag.grid_levels());
  std::printf("%s, grid of 2^%u\n", path.c_str(), levels);
  const QuerySet queries =
      make_queries(dag, levels, settings.only_rays ? 0 : kPoints, settings.picture);
  Timings own;
  if (!settings.only_rays) lookups(dag, levels, queries, own);
  const double cell = static_cast<double>(int64_t{1} << (dag.grid_levels() - levels));
  const PictureRays picture = picture_rays(dag, cell, queries);
  own.rays = rays(dag, cell, picture);
  if (!settings.scene.empty()) embree_rays(dag, settings.scene, picture);
  if (settings.only_rays) return;
  regions(dag, levels, queries, own);
  for (const auto& [measure_other, who] : kOtherLibraries) {
    if (levels > kMaxOtherLevels) {
      std::printf("  %-22s its memory would not hold this grid\n", who);
      continue;
    }
    const std::optional<Timings> timings = measure_other(dag, levels, queries);
    if (!timings) {
      std::printf("  %-22s not installed\n", who);
      continue;
    }
    print(who, "uniform points", timings->uniform, &own.uniform);
    print(who, "set cells", timings->set_cells, &own.set_cells);
    print(who, "primary rays", timings->rays);
    print(who, "boxes of 64^3", timings->boxes, &own.boxes);
    print(who, "counts of 64^3", timings->counts, &own.counts);
  }
}

int run(int argc, char** argv) {
  Settings settings;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--levels") == 0 && i + 1 < argc)
      settings.grid_levels = static_cast<uint32_t>(std::atoi(argv[++i]));
    else if (std::strcmp(argv[i], "--picture") == 0 && i + 1 < argc)
      settings.picture = std::max(8, std::atoi(argv[++i]) / 8 * 8);
    else if (std::strcmp(argv[i], "--rays") == 0)
      settings.only_rays = true;
    else if (std::strcmp(argv[i], "--cold") == 0)
      settings.only_cold = true;
    else if (std::strcmp(argv[i], "--scene") == 0 && i + 1 < argc)
      settings.scene = argv[++i];
    else
      measure(argv[i], settings);
  }
  return 0;
}

}  // namespace
}  // namespace voxdag::query

int main(int argc, char** argv) {
  try {
    return voxdag::query::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_query: %s\n", error.what());
    return 1;
  }
}
