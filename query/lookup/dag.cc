#include "query/lookup/dag.h"

#include <sys/mman.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/base/process_limits.h"
#include "core/format/global/open_global.h"
#include "query/lookup/points.h"
#include "query/rays/double_pair.h"
#include "query/rays/ray_packet.h"

namespace voxdag::query {
namespace {

// Items that one thread takes at once: a multiple of a packet of rays.
constexpr size_t kBatch = 4096;

[[noreturn]] void refuse(const char* expected) {
  throw Error(ErrorCode::kInvalidInput, std::string("query: expected ") + expected);
}
inline void require(bool right, const char* expected) {
  if (!right) refuse(expected);
}

// Calls body(first, count) for batches of `items`.
template <class Body>
void for_each_batch(unsigned threads, size_t items, const Body& body) {
  parallel_for(std::max(1u, threads), (items + kBatch - 1) / kBatch, [&](unsigned, size_t batch) {
    const size_t first = batch * kBatch;
    body(first, std::min(kBatch, items - first));
  });
}

// Rays with directions of length 1, two at a time: their divisions would take longer than their
// walk through large cells.
void make_rays(std::span<const Coordinates> origins, std::span<const Coordinates> directions,
               Ray* rays) {
  const DoublePair zero = DoublePair::of(0), one = DoublePair::of(1);
  for (size_t first = 0; first < origins.size(); first += 2) {
    const size_t second = std::min(first + 1, origins.size() - 1);
    DoublePair d[3], largest = zero, nothing = zero;
    for (size_t axis = 0; axis < 3; ++axis) {
      alignas(16) const double o[2] = {origins[first][axis], origins[second][axis]};
      alignas(16) const double two[2] = {directions[first][axis], directions[second][axis]};
      d[axis] = DoublePair::load(two);
      // Infinity and NaN are not 0 after this.
      nothing = nothing + DoublePair::load(o) * zero + d[axis] * zero;
      largest = max(largest, absolute(d[axis]));
    }
    require(equal(nothing, zero) == 3 && less(zero, largest) == 3,
            "rays of finite numbers with directions that are not 0");
    // The largest component first, so that no square overflows or vanishes.
    for (DoublePair& component : d) component = component / largest;
    const DoublePair scale = one / square_root(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (size_t axis = 0; axis < 3; ++axis) {
      alignas(16) double two[2];
      (d[axis] * scale).store(two);
      for (const auto& [ray, i] : {std::pair(first, 0), std::pair(second, 1)}) {
        rays[ray].origin[static_cast<int>(axis)] = origins[ray][axis];
        rays[ray].direction[static_cast<int>(axis)] = two[i];
      }
    }
  }
}

RayHit as_ray_hit(const Hit& hit, const Ray& ray) {
  RayHit out;
  out.hit = true;
  out.distance = hit.t;
  out.cell = {hit.cell[0], hit.cell[1], hit.cell[2]};
  out.grid_levels = hit.depth;
  out.axis = static_cast<int8_t>(hit.axis);
  if (hit.axis >= 0) out.sign = ray.direction[hit.axis] >= 0 ? int8_t{-1} : int8_t{1};
  return out;
}

// The largest square whose root, as a double, is at most `distance`. Distances of more than 2^31 do
// not occur.
uint64_t largest_square(double distance) {
  if (distance >= 0x1p31) return uint64_t{1} << 62;
  auto square = static_cast<uint64_t>(distance * distance);
  while (square > 0 && std::sqrt(static_cast<double>(square)) > distance) --square;
  while (std::sqrt(static_cast<double>(square + 1)) <= distance) ++square;
  return square;
}

}  // namespace

Dag::Dag(const std::string& path, uint64_t memory_bytes)
    : file_(open_global_file(path)), view_(*file_), budget_(memory_bytes) {}

// Of one call for large pages, of all calls for the top. Together they reach most of the nodes that
// later ones do.
constexpr size_t kManyQuestions = size_t{1} << 14;

// A few questions should not read parts of 2 MiB for each node, and neither should many about a
// file that memory cannot hold.
void Dag::expect_questions(size_t count) const {
  if (count < kManyQuestions || file_->file_bytes() > default_memory()) return;
  // What is in memory already stays in the pages that it has; not every system has others for
  // files.
  std::call_once(huge_pages_, [&] {
    madvise(const_cast<unsigned char*>(file_->data()), file_->file_bytes(), MADV_HUGEPAGE);
  });
}

// Null while few points were asked for, or where the top is damaged: then each descent finds out by
// itself what it meets.
const TopCells* Dag::top_cells(size_t points) const {
  if ((points_asked_ += points) < kManyQuestions || !TopCells::serve(view_, grid_levels()))
    return nullptr;
  std::call_once(make_top_, [&] {
    try {
      top_.emplace(view_);
    } catch (const Error&) {
    }
  });
  return top_ ? &*top_ : nullptr;
}

void Dag::lookup(std::span<const Position> points, uint32_t grid_levels, std::span<uint8_t> set,
                 unsigned threads) const {
  check_grid_levels(view_, grid_levels);
  require(points.size() == set.size(), "as many results as points");
  expect_questions(points.size());
  const TopCells* const top = top_cells(points.size());
  naming_file(file_->path(), [&] {
    for_each_batch(threads, points.size(), [&](size_t first, size_t count) {
      look_up(view_, top, grid_levels, points.subspan(first, count), set.subspan(first, count));
    });
  });
}

void Dag::colors(std::span<const Position> points, uint32_t grid_levels, std::span<Rgba> colors,
                 unsigned threads) const {
  check_grid_levels(view_, grid_levels);
  require(points.size() == colors.size(), "as many results as points");
  require(has_colors(), "a file with colors, as voxdag build --color makes it");
  with_reader_errors([&] {
    for_each_batch(threads, points.size(), [&](size_t first, size_t count) {
      voxdag_reader::ColorCursor cursor(*file_);
      for (size_t i = first; i < first + count; ++i) {
        const auto [x, y, z] = points[i];
        const auto color = cursor.color(x, y, z, grid_levels);
        colors[i] = color ? Rgba{color->r, color->g, color->b, 255} : Rgba{};
      }
    });
  });
}

void Dag::rays(std::span<const Coordinates> origins, std::span<const Coordinates> directions,
               const RayLimits& limits, std::span<RayHit> hits, unsigned threads) const {
  require(origins.size() == directions.size() && origins.size() == hits.size(),
          "as many directions and results as origins");
  require(limits.max_distance >= 0 && limits.stop_size >= 0, "limits of rays that are at least 0");
  expect_questions(origins.size());
  naming_file(file_->path(), [&] {
    for_each_batch(threads, origins.size(), [&](size_t batch, size_t count) {
      constexpr size_t kRays = RayPacket::kRays;
      RayPacket packet(view_, limits.stop_size, 0, limits.max_distance);
      Ray rays[kRays];
      Hit found[kRays];
      for (size_t first = batch; first < batch + count; first += kRays) {
        const size_t n = std::min(kRays, batch + count - first);
        make_rays(origins.subspan(first, n), directions.subspan(first, n), rays);
        const uint64_t have_hit = packet.cast({rays, n}, found);
        for (size_t i = 0; i < n; ++i)
          hits[first + i] = have_hit >> i & 1 ? as_ray_hit(found[i], rays[i]) : RayHit{};
      }
    });
  });
}

void Dag::bricks(const Selection& selection, const std::function<void(const Brick&)>& visit) const {
  naming_file(file_->path(), [&] { for_each_brick(view_, selection, visit); });
}

void Dag::box(const Selection& selection, std::span<uint8_t> cells) const {
  const Position &low = selection.region.low, &high = selection.region.high;
  check_grid_levels(view_, selection.grid_levels);
  uint64_t size = selection.region.empty() ? 0 : 1;
  for (size_t axis = 0; axis < 3; ++axis) {
    const uint64_t edge = high[axis] <= low[axis] ? 0
                                                  : static_cast<uint64_t>(high[axis]) -
                                                        static_cast<uint64_t>(low[axis]);
    require(!__builtin_mul_overflow(size, edge, &size), "a region that fits in memory");
  }
  require(cells.size() == size, "as many results as cells in the region");
  std::fill(cells.begin(), cells.end(), uint8_t{0});
  bricks(selection, [&](const Brick& brick) {
    for_each_cell_of(brick, [&](const Position& p) {
      const int64_t at =
          ((p[0] - low[0]) * (high[1] - low[1]) + p[1] - low[1]) * (high[2] - low[2]) + p[2] -
          low[2];
      cells[static_cast<size_t>(at)] = 1;
    });
  });
}

uint64_t Dag::positions(const Selection& selection, std::span<Position> positions) const {
  uint64_t count = 0;
  bricks(selection, [&](const Brick& brick) {
    if (count >= positions.size()) {
      count += static_cast<uint64_t>(std::popcount(brick.mask));
      return;
    }
    for (uint64_t left = brick.mask; left != 0; left &= left - 1, ++count)
      if (count < positions.size()) positions[count] = brick_cell(brick, std::countr_zero(left));
  });
  return count;
}

const NodeCounts& Dag::counts(uint32_t grid_levels) const {
  const std::lock_guard lock(mutex_);
  std::unique_ptr<NodeCounts>& counts = counts_[grid_levels];
  if (!counts) counts = std::make_unique<NodeCounts>(*file_, view_, grid_levels, budget_);
  return *counts;
}

uint64_t Dag::count(const Selection& selection) const {
  check_grid_levels(view_, selection.grid_levels);
  return naming_file(file_->path(),
                     [&] { return counts(selection.grid_levels).count(selection.region); });
}

void Dag::nearest(std::span<const Position> points, uint32_t grid_levels, double max_distance,
                  std::span<Nearest> cells, unsigned threads) const {
  check_grid_levels(view_, grid_levels);
  require(points.size() == cells.size(), "as many results as points");
  require(max_distance >= 0, "a distance that is at least 0");
  const uint64_t max_squared = largest_square(max_distance);
  naming_file(file_->path(), [&] {
    for_each_batch(threads, points.size(), [&](size_t first, size_t count) {
      for (size_t i = first; i < first + count; ++i) {
        for (const int64_t c : points[i])
          require(c >= -kMaxCoordinate && c <= kMaxCoordinate, "coordinates within 2^30");
        cells[i] = find_nearest(view_, grid_levels, points[i], max_squared);
      }
    });
  });
}

}  // namespace voxdag::query
