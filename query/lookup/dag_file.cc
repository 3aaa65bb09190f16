#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <mutex>
#include <optional>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/parallel_for.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/format/global/open_global.h"
#include "query/dag/dag_view.h"
#include "query/dag/selection.h"
#include "query/lookup/bricks.h"
#include "query/lookup/nearest.h"
#include "query/lookup/node_counts.h"
#include "query/lookup/points.h"
#include "query/lookup/top_cells.h"
#include "query/rays/double_pair.h"
#include "query/rays/ray_packet.h"
#include "query/tiles/tile.h"
#include "voxdag/query.h"

namespace voxdag::query {
namespace {

// Number of points or rays that a thread processes as one batch. It is a multiple of the number of
// rays in a RayPacket, so only the last packet of a call can be incomplete.
constexpr size_t kBatch = 4096;

[[noreturn]] void refuse(const std::string& what) {
  throw Error(ErrorCode::kInvalidInput, "query: " + what);
}
// Throws unless the array `name` has `expected` entries, one for each of the `items`.
void require_length(const char* name, size_t length, size_t expected, const char* items) {
  if (length != expected)
    refuse("the array of " + std::string(name) + " has " + std::to_string(length) +
           " entries: expected " + std::to_string(expected) + ", the number of " + items);
}
void require_not_negative(const char* name, double value) {
  if (!(value >= 0))
    refuse(std::string(name) + " is " + number_text(value) + ": expected a number of at least 0");
}
std::string point_text(const Coordinates& point) {
  return number_text(point[0]) + " " + number_text(point[1]) + " " + number_text(point[2]);
}
bool is_ray(const Coordinates& origin, const Coordinates& direction) {
  const auto is_finite = [](double number) { return std::isfinite(number); };
  return std::ranges::all_of(origin, is_finite) && std::ranges::all_of(direction, is_finite) &&
         std::ranges::any_of(direction, [](double number) { return number != 0; });
}

// Divides the numbers 0 to items - 1 into batches, and calls body(first, count) for each batch on
// one of `threads` threads.
template <class Body>
void for_each_batch(unsigned threads, size_t items, const Body& body) {
  parallel_for(std::max(1u, threads), (items + kBatch - 1) / kBatch, [&](unsigned, size_t batch) {
    const size_t first = batch * kBatch;
    body(first, std::min(kBatch, items - first));
  });
}

// Fills `rays`, with directions scaled to length 1. Throws Error{kInvalidInput} for numbers that
// are not finite and for directions of 0. `number` is the index of the first of these rays in the
// caller's array, for the message. Processes two rays per operation, because otherwise the
// divisions would take longer than the walk of the rays through large cells.
void make_rays(std::span<const Coordinates> origins, std::span<const Coordinates> directions,
               size_t number, Ray* rays) {
  const DoublePair zero = DoublePair::of(0), one = DoublePair::of(1);
  for (size_t first = 0; first < origins.size(); first += 2) {
    const size_t second = std::min(first + 1, origins.size() - 1);
    DoublePair d[3], largest = zero, nothing = zero;
    for (size_t axis = 0; axis < 3; ++axis) {
      alignas(16) const double o[2] = {origins[first][axis], origins[second][axis]};
      alignas(16) const double two[2] = {directions[first][axis], directions[second][axis]};
      d[axis] = DoublePair::load(two);
      // `nothing` remains 0 only for finite numbers: infinity times 0 and NaN times 0 are NaN.
      nothing = nothing + DoublePair::load(o) * zero + d[axis] * zero;
      largest = max(largest, absolute(d[axis]));
    }
    if (!(equal(nothing, zero) == 3 && less(zero, largest) == 3)) {
      const size_t bad = is_ray(origins[first], directions[first]) ? second : first;
      refuse("rays[" + std::to_string(number + bad) + "] has the origin " +
             point_text(origins[bad]) + " and the direction " + point_text(directions[bad]) +
             ": expected finite numbers and a direction other than 0 0 0");
    }
    // Divides by the largest component first, so that no square of a component overflows or becomes
    // 0.
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

// Throws Error{kInvalidInput} unless the arrays of a ray query have equal lengths and the limits
// are valid.
void check_rays(size_t origins, size_t directions, const RayLimits& limits, size_t results) {
  require_length("directions", directions, origins, "origins");
  require_length("results", results, origins, "origins");
  require_not_negative("max_distance", limits.max_distance);
  require_not_negative("stop_size", limits.stop_size);
}

// Divides the rays into packets. Calls cast(first, rays, packet) for each of them, on one of
// `threads` threads, with the index of its first ray.
template <class Cast>
void for_each_packet(const DagView& dag, std::span<const Coordinates> origins,
                     std::span<const Coordinates> directions, const RayLimits& limits,
                     unsigned threads, const Cast& cast) {
  for_each_batch(threads, origins.size(), [&](size_t batch, size_t count) {
    constexpr size_t kRays = RayPacket::kRays;
    RayPacket packet(dag, limits.stop_size, 0, limits.max_distance);
    Ray rays[kRays];
    for (size_t first = batch; first < batch + count; first += kRays) {
      const size_t n = std::min(kRays, batch + count - first);
      make_rays(origins.subspan(first, n), directions.subspan(first, n), first, rays);
      cast(first, std::span<const Ray>(rays, n), packet);
    }
  });
}

// Returns the largest integer whose square root, as a double, is at most `distance`. For a distance
// of 2^31 or more, returns 2^62: coordinates are at most kMaxCoordinate, so no squared distance is
// larger.
uint64_t largest_square(double distance) {
  if (distance >= 0x1p31) return uint64_t{1} << 62;
  auto square = static_cast<uint64_t>(distance * distance);
  while (square > 0 && std::sqrt(static_cast<double>(square)) > distance) --square;
  while (std::sqrt(static_cast<double>(square + 1)) <= distance) ++square;
  return square;
}

}  // namespace

// The file, and tables that make queries faster but are worth their cost only for many queries.
struct DagFile::State {
  State(const std::string& path, uint64_t memory_bytes)
      : file(open_global_file(path)), view(*file), budget(memory_bytes) {}
  State(const void* data, uint64_t size, uint64_t memory_bytes)
      : is_mapped(false), file(open_memory(data, size)), view(*file), budget(memory_bytes) {}

  static std::unique_ptr<const voxdag_reader::File> open_memory(const void* data, uint64_t size) {
    return with_reader_errors(
        [&] { return std::make_unique<const voxdag_reader::File>(data, size); });
  }
  void prepare_for_queries(size_t count);
  const TopCells* top_cells(size_t points);
  const NodeCounts& counts(uint32_t grid_levels);

  const bool is_mapped = true;
  const std::unique_ptr<const voxdag_reader::File> file;
  const DagView view;
  MemoryBudget budget;
  std::once_flag huge_pages, make_top;
  std::atomic<uint64_t> points_looked_up = 0;
  std::optional<TopCells> top;  // made after many lookups
  std::mutex mutex;
  std::array<std::unique_ptr<NodeCounts>, 21> counts_of;  // by grid levels; guarded by mutex
};

// A call with at least this number of queries requests huge pages. The table of the top cells is
// created after this number of lookups in total: so many lookups have read most of the nodes that
// the table and later lookups need.
constexpr size_t kManyQueries = size_t{1} << 14;

// Requests huge pages for the mapped file, because they make many queries faster. Does nothing in
// two cases in which huge pages would be slow: for a few queries, because each node would require a
// read of 2 MiB, and for a file that is larger than half of the machine's memory.
void DagFile::State::prepare_for_queries(size_t count) {
  if (!is_mapped || count < kManyQueries || file->file_bytes() > default_memory()) return;
  // The system can ignore this request: pages already in memory keep their size, and not every
  // system supports huge pages for files.
  std::call_once(huge_pages, [&] {
    madvise(const_cast<unsigned char*>(file->data()), file->file_bytes(), MADV_HUGEPAGE);
  });
}

// Returns the table of the top cells. `points` is the number of lookups that will use the table.
// Returns null, so that the descents begin at the root, in three cases: before there were
// kManyQueries lookups, if the DAG has too few levels for the table, and if the levels above the
// table are damaged. In the last case, each descent reports the damage that it finds.
const TopCells* DagFile::State::top_cells(size_t points) {
  if ((points_looked_up += points) < kManyQueries || !TopCells::serve(view, view.grid_levels()))
    return nullptr;
  std::call_once(make_top, [&] {
    try {
      top.emplace(view);
    } catch (const Error&) {
    }
  });
  return top ? &*top : nullptr;
}

const NodeCounts& DagFile::State::counts(uint32_t grid_levels) {
  const std::lock_guard lock(mutex);
  std::unique_ptr<NodeCounts>& counts = counts_of[grid_levels];
  if (!counts) counts = std::make_unique<NodeCounts>(*file, view, grid_levels, budget);
  return *counts;
}

DagFile::DagFile(const std::string& path, uint64_t memory_bytes)
    : state_(std::make_unique<State>(path, memory_bytes)) {}
DagFile::DagFile(const void* data, uint64_t size, uint64_t memory_bytes)
    : state_(std::make_unique<State>(data, size, memory_bytes)) {}
DagFile::~DagFile() = default;
DagFile::DagFile(DagFile&&) noexcept = default;
DagFile& DagFile::operator=(DagFile&&) noexcept = default;

const voxdag_reader::File& DagFile::file() const { return *state_->file; }
uint32_t DagFile::grid_levels() const { return file().grid_levels(); }
Coordinates DagFile::origin() const { return std::to_array(file().origin()); }
double DagFile::edge() const { return file().edge(); }
uint64_t DagFile::voxels() const { return file().voxels(); }
uint64_t DagFile::svo_nodes() const { return file().svo_nodes(); }
uint64_t DagFile::dag_nodes() const { return file().dag_nodes(); }
uint64_t DagFile::file_bytes() const { return file().file_bytes(); }

void DagFile::lookup(std::span<const Position> points, uint32_t grid_levels, std::span<uint8_t> set,
                     unsigned threads) const {
  check_grid_levels(state_->view, grid_levels);
  require_length("results", set.size(), points.size(), "points");
  state_->prepare_for_queries(points.size());
  const TopCells* const top = state_->top_cells(points.size());
  naming_file(file().path(), [&] {
    for_each_batch(threads, points.size(), [&](size_t first, size_t count) {
      look_up(state_->view, top, grid_levels, points.subspan(first, count),
              set.subspan(first, count));
    });
  });
}

uint32_t DagFile::color_levels() const {
  for (const Attribute attribute : attributes_of(file()).list())
    return section_of(file(), attribute).color_levels();
  return 0;
}
bool DagFile::has_colors() const { return file().colors().tier_count() > 0; }
bool DagFile::has_alphas() const { return file().alphas().tier_count() > 0; }
bool DagFile::has_normals() const { return file().normals().tier_count() > 0; }
bool DagFile::has_materials() const { return file().materials().tier_count() > 0; }
const std::vector<std::string>& DagFile::material_names() const {
  return file().materials().names();
}

namespace {

// A file, and the section of the file that stores an attribute. `values` names the values of the
// attribute, and `option` and `value` are the option of builds that computes it, for the error
// message if this file does not have the attribute.
struct AttributeSource {
  const voxdag_reader::File& file;
  const voxdag_reader::ColorSection& section;
  const char *values, *option, *value;
};

// Sets values[i] to the attribute of the cell points[i], or to `none` if the cell is not set.
// value_of(region, number) must return the attribute of the cell with this number in a region of
// the section.
template <class Value, class ValueOf>
void read_attribute(const AttributeSource& source, std::span<const Position> points,
                    uint32_t grid_levels, Value none, std::span<Value> values, unsigned threads,
                    const ValueOf& value_of) {
  require_length("results", values.size(), points.size(), "points");
  if (source.section.tier_count() == 0)
    refuse(source.file.path() + " does not have this attribute: expected a file with " +
           source.values + ", as " + command_text("build", source.option, source.value) +
           " makes it");
  with_reader_errors([&] {
    for_each_batch(threads, points.size(), [&](size_t first, size_t count) {
      voxdag_reader::ColorCursor cursor(source.file, source.section);
      for (size_t i = first; i < first + count; ++i) {
        const auto [x, y, z] = points[i];
        uint64_t number = 0;
        const auto* const region = cursor.find(x, y, z, grid_levels, number);
        values[i] = region ? value_of(*region, number) : none;
      }
    });
  });
}

}  // namespace

void DagFile::colors(std::span<const Position> points, uint32_t grid_levels, std::span<Rgba> colors,
                     unsigned threads) const {
  check_grid_levels(state_->view, grid_levels);
  read_attribute({file(), file().colors(), "colors", "color", ""}, points, grid_levels, Rgba{},
                 colors, threads, [](const voxdag_reader::ColorRegion& region, uint64_t number) {
                   const voxdag_reader::Rgb color = region.color(number);
                   return Rgba{color.r, color.g, color.b, 255};
                 });
}

void DagFile::alphas(std::span<const Position> points, uint32_t grid_levels,
                     std::span<uint8_t> alphas, unsigned threads) const {
  check_grid_levels(state_->view, grid_levels);
  read_attribute({file(), file().alphas(), "alpha", "attributes", "alpha"}, points, grid_levels,
                 uint8_t{0}, alphas, threads,
                 [](const voxdag_reader::ColorRegion& region, uint64_t number) {
                   return static_cast<uint8_t>(region.value(number));
                 });
}

void DagFile::normals(std::span<const Position> points, uint32_t grid_levels,
                      std::span<Normal> normals, unsigned threads) const {
  check_grid_levels(state_->view, grid_levels);
  read_attribute({file(), file().normals(), "normals", "attributes", "normal"}, points, grid_levels,
                 Normal{}, normals, threads,
                 [](const voxdag_reader::ColorRegion& region, uint64_t number) {
                   const voxdag_reader::Normal normal = region.normal(number);
                   return Normal{normal.x, normal.y, normal.z};
                 });
}

void DagFile::materials(std::span<const Position> points, uint32_t grid_levels,
                        std::span<uint32_t> materials, unsigned threads) const {
  check_grid_levels(state_->view, grid_levels);
  read_attribute({file(), file().materials(), "materials", "attributes", "material"}, points,
                 grid_levels, kNoMaterial, materials, threads,
                 [](const voxdag_reader::ColorRegion& region, uint64_t number) {
                   return region.value(number);
                 });
}

void DagFile::rays(std::span<const Coordinates> origins, std::span<const Coordinates> directions,
                   const RayLimits& limits, std::span<RayHit> hits, unsigned threads) const {
  check_rays(origins.size(), directions.size(), limits, hits.size());
  state_->prepare_for_queries(origins.size());
  const auto record = [&](size_t first, std::span<const Ray> rays, RayPacket& packet) {
    Hit found[RayPacket::kRays];
    const uint64_t have_hit = packet.cast(rays, found);
    for (size_t i = 0; i < rays.size(); ++i)
      hits[first + i] = have_hit >> i & 1 ? as_ray_hit(found[i], rays[i]) : RayHit{};
  };
  naming_file(file().path(),
              [&] { for_each_packet(state_->view, origins, directions, limits, threads, record); });
}

void DagFile::occluded(std::span<const Coordinates> origins,
                       std::span<const Coordinates> directions, const RayLimits& limits,
                       std::span<uint8_t> occluded, unsigned threads) const {
  check_rays(origins.size(), directions.size(), limits, occluded.size());
  state_->prepare_for_queries(origins.size());
  const auto record = [&](size_t first, std::span<const Ray> rays, RayPacket& packet) {
    const uint64_t have_hit = packet.occluded(rays);
    for (size_t i = 0; i < rays.size(); ++i) occluded[first + i] = have_hit >> i & 1;
  };
  naming_file(file().path(),
              [&] { for_each_packet(state_->view, origins, directions, limits, threads, record); });
}

void DagFile::bricks(const Selection& selection,
                     const std::function<void(const Brick&)>& visit) const {
  naming_file(file().path(), [&] { for_each_brick(state_->view, selection, visit); });
}

void DagFile::box(const Selection& selection, std::span<uint8_t> cells) const {
  const Position &low = selection.region.low, &high = selection.region.high;
  check_grid_levels(state_->view, selection.grid_levels);
  uint64_t size = selection.region.empty() ? 0 : 1;
  for (size_t axis = 0; axis < 3; ++axis) {
    const uint64_t edge = high[axis] <= low[axis] ? 0
                                                  : static_cast<uint64_t>(high[axis]) -
                                                        static_cast<uint64_t>(low[axis]);
    if (__builtin_mul_overflow(size, edge, &size))
      refuse("the region has 2^64 or more cells: expected fewer");
  }
  require_length("results", cells.size(), size, "cells in the region");
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

uint64_t DagFile::positions(const Selection& selection, std::span<Position> positions) const {
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

uint64_t DagFile::count(const Selection& selection) const {
  check_grid_levels(state_->view, selection.grid_levels);
  return naming_file(file().path(),
                     [&] { return state_->counts(selection.grid_levels).count(selection.region); });
}

void DagFile::nearest(std::span<const Position> points, uint32_t grid_levels, double max_distance,
                      std::span<Nearest> cells, unsigned threads) const {
  check_grid_levels(state_->view, grid_levels);
  require_length("results", cells.size(), points.size(), "points");
  require_not_negative("max_distance", max_distance);
  const uint64_t max_squared = largest_square(max_distance);
  naming_file(file().path(), [&] {
    for_each_batch(threads, points.size(), [&](size_t first, size_t count) {
      for (size_t i = first; i < first + count; ++i) {
        for (const int64_t c : points[i])
          if (c < -kMaxCoordinate || c > kMaxCoordinate)
            refuse("points[" + std::to_string(i) + "] has the coordinate " + std::to_string(c) +
                   ": expected -2^30 to 2^30");
        cells[i] = find_nearest(state_->view, grid_levels, points[i], max_squared);
      }
    });
  });
}

Position DagFile::world_to_cell(const Coordinates& world, uint32_t grid_levels) const {
  Position cell;
  for (size_t axis = 0; axis < 3; ++axis)
    cell[axis] = query::world_to_cell(file(), grid_levels, axis, world[axis]);
  return cell;
}

Region DagFile::world_to_region(const Coordinates& low, const Coordinates& high,
                                uint32_t grid_levels) const {
  return query::world_to_region(file(), grid_levels,
                                {low[0], low[1], low[2], high[0], high[1], high[2]});
}

std::vector<uint32_t> DagFile::tile(uint32_t tile_levels, uint32_t level, uint64_t offset) const {
  return naming_file(file().path(), [&] {
    return encode_tile(state_->view, tile_levels, {level, offset});
  });
}

}  // namespace voxdag::query
