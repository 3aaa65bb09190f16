#include "query/c/voxdag.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "query/lookup/overlaps.h"
#include "voxdag/query.h"

using voxdag::query::Position;

struct voxdag_file {
  explicit voxdag_file(const char* path) : dag(path) {}
  voxdag_file(const void* data, size_t size) : dag(data, size) {}
  const voxdag::query::DagFile dag;
};

namespace {

// The message that voxdag_error() returns. The array has a fixed size, so set_error() allocates
// nothing and also works when memory has run out.
thread_local std::array<char, 1024> last_error;

void set_error(const char* text) {
  std::snprintf(last_error.data(), last_error.size(), "%s", text);
}

voxdag_status status_of(voxdag::ErrorCode code) {
  switch (code) {
    case voxdag::ErrorCode::kInvalidInput:
      return VOXDAG_INVALID_INPUT;
    case voxdag::ErrorCode::kNotFound:
      return VOXDAG_NOT_FOUND;
    case voxdag::ErrorCode::kCorrupt:
      return VOXDAG_CORRUPT;
    case voxdag::ErrorCode::kUnsupportedVersion:
      return VOXDAG_UNSUPPORTED_VERSION;
    case voxdag::ErrorCode::kIo:
      return VOXDAG_IO;
    case voxdag::ErrorCode::kOutOfMemory:
      return VOXDAG_OUT_OF_MEMORY;
    case voxdag::ErrorCode::kLimit:
      return VOXDAG_LIMIT;
    default:
      return VOXDAG_INTERNAL;  // no query throws other codes: they concern disk space and devices
  }
}

// Runs `ask`, which answers one query, and returns the status for C. Catches all exceptions,
// because C code cannot handle them.
template <class Ask>
voxdag_status answer(const Ask& ask) {
  try {
    ask();
    return VOXDAG_OK;
  } catch (const voxdag::Error& error) {
    set_error(error.what());
    return status_of(error.code());
  } catch (const std::bad_alloc&) {
    set_error(
        "out of memory: the system has too little memory for the answer, expected more free "
        "memory");
    return VOXDAG_OUT_OF_MEMORY;
  } catch (const std::exception& error) {
    set_error(error.what());
    return VOXDAG_INTERNAL;
  }
}

void refuse(const std::string& what) {
  throw voxdag::Error(voxdag::ErrorCode::kInvalidInput, what);
}

void expect_pointer(const void* pointer, const char* name) {
  if (!pointer) refuse(std::string(name) + " is a null pointer: expected a pointer to an object");
}

std::span<const Position> positions_of(const int64_t (*cells)[3], size_t count) {
  if (count) expect_pointer(cells, "the array of positions");
  return {reinterpret_cast<const Position*>(cells), count};
}

voxdag::query::Selection selection_of(uint32_t grid_levels, const voxdag_region* region) {
  expect_pointer(region, "the region");
  voxdag::query::Selection selection{grid_levels, {}};
  std::copy_n(region->low, 3, selection.region.low.begin());
  std::copy_n(region->high, 3, selection.region.high.begin());
  return selection;
}

// Maximum accepted struct_size, in bytes. No struct of a later voxdag.h will exceed it, so a larger
// number means that the caller left struct_size uninitialized.
constexpr size_t kMaxStructBytes = 4096;

// Throws Error{kInvalidInput} unless a caller's struct_size is from `first_bytes` to
// kMaxStructBytes. `name` is the name of the struct. `first_bytes` is the size of the struct in the
// oldest voxdag.h that has it.
void check_struct_size(const char* name, size_t struct_size, size_t first_bytes) {
  if (struct_size < first_bytes || struct_size > kMaxStructBytes)
    refuse(std::string(name) + " has the struct_size " + std::to_string(struct_size) +
           ": expected sizeof(" + name + ")");
}

voxdag::query::RayLimits ray_limits_of(const voxdag_ray_limits* limits) {
  if (!limits) return {};
  check_struct_size("voxdag_ray_limits", limits->struct_size,
                    offsetof(voxdag_ray_limits, stop_size) + sizeof limits->stop_size);
  const char* const bytes = reinterpret_cast<const char*>(limits);
  if (limits->struct_size > sizeof *limits &&
      std::any_of(bytes + sizeof *limits, bytes + limits->struct_size, [](char c) { return c; }))
    refuse("voxdag_ray_limits has members that libvoxdag.so " VOXDAG_VERSION
           " does not know: expected "
           "0 in their bytes");
  return {limits->max_distance, limits->stop_size};
}

std::array<double, 3> point_of(const double (&from)[3]) { return {from[0], from[1], from[2]}; }
voxdag::query::OverlapBox shape_of(const voxdag_box& box) {
  return {point_of(box.low), point_of(box.high)};
}
voxdag::query::Capsule shape_of(const voxdag_capsule& capsule) {
  return {point_of(capsule.from), point_of(capsule.to), capsule.radius};
}

template <class Shape>
voxdag_status overlaps_of(const voxdag_file* file, uint32_t grid_levels, const Shape* shapes,
                          size_t count, uint8_t* overlaps) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (count) {
      expect_pointer(shapes, "the array of shapes");
      expect_pointer(overlaps, "the array of answers");
    }
    const voxdag::query::DagView dag(file->dag.file());
    for (size_t i = 0; i < count; ++i) try {
        overlaps[i] = voxdag::query::overlaps(dag, grid_levels, shape_of(shapes[i]));
      } catch (const voxdag::Error& e) {
        throw voxdag::Error(e.code(), "shape " + std::to_string(i) + ": " + e.message());
      }
  });
}

// Number of rays or voxels that are converted and queried together. It limits the size of the
// temporary arrays.
constexpr size_t kBatch = 4096;

template <class Work>
void for_each_batch(size_t count, const Work& work) {
  for (size_t first = 0; first < count; first += kBatch)
    work(first, std::min(count - first, kBatch));
}

// Divides rays into batches. Calls cast(first, origins, directions) for each of them, with the
// index of its first ray. The messages of cast() count the rays from this one, so they also get its
// index.
template <class Cast>
void for_each_ray_batch(const voxdag_ray* rays, size_t count, const Cast& cast) {
  std::vector<voxdag::query::Coordinates> origins(std::min(count, kBatch)), directions(origins);
  for_each_batch(count, [&](size_t first, size_t some) {
    for (size_t i = 0; i < some; ++i) {
      std::copy_n(rays[first + i].origin, 3, origins[i].begin());
      std::copy_n(rays[first + i].direction, 3, directions[i].begin());
    }
    try {
      cast(first, std::span<const voxdag::query::Coordinates>(origins).first(some),
           std::span<const voxdag::query::Coordinates>(directions).first(some));
    } catch (const voxdag::Error& error) {
      if (first == 0) throw;
      throw voxdag::Error(error.code(), error.message() + "; rays[0] in this message is ray " +
                                            std::to_string(first) + " of the call");
    }
  });
}

void copy_hit(const voxdag::query::RayHit& from, uint32_t grid_levels, voxdag_hit& to) {
  to = {HUGE_VAL, {-1, -1, -1}, {}, {}};
  if (!from.hit) return;
  to.distance = from.distance;
  for (size_t axis = 0; axis < 3; ++axis)
    to.voxel[axis] = from.cell[axis] << (grid_levels - from.grid_levels);
  if (from.axis >= 0) to.normal[from.axis] = from.sign;
}

}  // namespace

const char* voxdag_version(void) { return VOXDAG_VERSION; }

const char* voxdag_error(void) { return last_error.data(); }

voxdag_status voxdag_open(const char* path, voxdag_file** file) {
  return answer([&] {
    expect_pointer(path, "the path");
    expect_pointer(file, "the place of the file");
    *file = nullptr;
    *file = new voxdag_file(path);
  });
}

voxdag_status voxdag_open_memory(const void* data, size_t size, voxdag_file** file) {
  return answer([&] {
    expect_pointer(data, "the data");
    expect_pointer(file, "the place of the file");
    *file = nullptr;
    *file = new voxdag_file(data, size);
  });
}

void voxdag_close(voxdag_file* file) { delete file; }

voxdag_status voxdag_get_facts(const voxdag_file* file, voxdag_facts* facts) {
  return answer([&] {
    expect_pointer(file, "the file");
    expect_pointer(facts, "the place of the facts");
    check_struct_size("voxdag_facts", facts->struct_size,
                      offsetof(voxdag_facts, bytes) + sizeof facts->bytes);
    const voxdag::query::DagFile& dag = file->dag;
    voxdag_facts known{};
    known.struct_size = facts->struct_size;
    known.grid_levels = dag.grid_levels();
    known.color_levels = dag.color_levels();
    known.attributes = (dag.has_colors() ? VOXDAG_HAS_COLORS : 0u) |
                       (dag.has_alphas() ? VOXDAG_HAS_ALPHAS : 0u) |
                       (dag.has_normals() ? VOXDAG_HAS_NORMALS : 0u) |
                       (dag.has_materials() ? VOXDAG_HAS_MATERIALS : 0u);
    known.materials = static_cast<uint32_t>(dag.material_names().size());
    std::ranges::copy(dag.origin(), known.origin);
    known.edge = dag.edge();
    known.voxels = dag.voxels();
    known.svo_nodes = dag.svo_nodes();
    known.dag_nodes = dag.dag_nodes();
    known.bytes = dag.file_bytes();
    // If the caller's header is newer than this library, the caller's struct has members that
    // this library does not know. This call sets them to 0.
    std::memset(facts, 0, known.struct_size);
    std::memcpy(facts, &known, std::min(known.struct_size, sizeof known));
  });
}

const char* voxdag_material_name(const voxdag_file* file, uint32_t material) {
  if (!file || material >= file->dag.material_names().size()) return nullptr;
  return file->dag.material_names()[material].c_str();
}

voxdag_status voxdag_lookup(const voxdag_file* file, uint32_t grid_levels,
                            const int64_t (*cells)[3], size_t count, uint8_t* set) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (count) expect_pointer(set, "the array of answers");
    file->dag.lookup(positions_of(cells, count), grid_levels, {set, count});
  });
}

voxdag_status voxdag_colors(const voxdag_file* file, uint32_t grid_levels,
                            const int64_t (*cells)[3], size_t count, uint8_t (*rgba)[4]) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (count) expect_pointer(rgba, "the array of colors");
    file->dag.colors(positions_of(cells, count), grid_levels,
                     {reinterpret_cast<voxdag::query::Rgba*>(rgba), count});
  });
}

voxdag_status voxdag_alphas(const voxdag_file* file, uint32_t grid_levels,
                            const int64_t (*cells)[3], size_t count, uint8_t* alphas) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (count) expect_pointer(alphas, "the array of alphas");
    file->dag.alphas(positions_of(cells, count), grid_levels, {alphas, count});
  });
}

voxdag_status voxdag_normals(const voxdag_file* file, uint32_t grid_levels,
                             const int64_t (*cells)[3], size_t count, float (*normals)[3]) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (count) expect_pointer(normals, "the array of normals");
    file->dag.normals(positions_of(cells, count), grid_levels,
                      {reinterpret_cast<voxdag::query::Normal*>(normals), count});
  });
}

voxdag_status voxdag_materials(const voxdag_file* file, uint32_t grid_levels,
                               const int64_t (*cells)[3], size_t count, uint32_t* materials) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (count) expect_pointer(materials, "the array of materials");
    file->dag.materials(positions_of(cells, count), grid_levels, {materials, count});
  });
}

voxdag_status voxdag_cast_rays(const voxdag_file* file, const voxdag_ray* rays, size_t count,
                               const voxdag_ray_limits* limits, voxdag_hit* hits) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (count) expect_pointer(rays, "the array of rays");
    if (count) expect_pointer(hits, "the array of hits");
    const voxdag::query::RayLimits known = ray_limits_of(limits);
    std::vector<voxdag::query::RayHit> found(std::min(count, kBatch));
    for_each_ray_batch(rays, count, [&](size_t first, const auto& origins, const auto& directions) {
      const auto hit = std::span(found).first(origins.size());
      file->dag.rays(origins, directions, known, hit);
      for (size_t i = 0; i < hit.size(); ++i)
        copy_hit(hit[i], file->dag.grid_levels(), hits[first + i]);
    });
  });
}

voxdag_status voxdag_occluded(const voxdag_file* file, const voxdag_ray* rays, size_t count,
                              const voxdag_ray_limits* limits, uint8_t* occluded) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (count) expect_pointer(rays, "the array of rays");
    if (count) expect_pointer(occluded, "the array of answers");
    const voxdag::query::RayLimits known = ray_limits_of(limits);
    for_each_ray_batch(rays, count, [&](size_t first, const auto& origins, const auto& directions) {
      file->dag.occluded(origins, directions, known, {occluded + first, origins.size()});
    });
  });
}

voxdag_status voxdag_count(const voxdag_file* file, uint32_t grid_levels,
                           const voxdag_region* region, uint64_t* count) {
  return answer([&] {
    expect_pointer(file, "the file");
    expect_pointer(count, "the place of the count");
    *count = file->dag.count(selection_of(grid_levels, region));
  });
}

voxdag_status voxdag_dense(const voxdag_file* file, uint32_t grid_levels,
                           const voxdag_region* region, uint8_t* cells) {
  return answer([&] {
    expect_pointer(file, "the file");
    const voxdag::query::Selection selection = selection_of(grid_levels, region);
    unsigned __int128 size = selection.region.empty() ? 0 : 1;
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto length = static_cast<__int128>(region->high[axis]) - region->low[axis];
      size *= length > 0 ? static_cast<unsigned __int128>(length) : 0;
      if (size > PTRDIFF_MAX) refuse("the region has over 2^63 cells: expected fewer");
    }
    if (size > 0) expect_pointer(cells, "the array of cells");
    file->dag.box(selection, {cells, static_cast<size_t>(size)});
  });
}

voxdag_status voxdag_list(const voxdag_file* file, uint32_t grid_levels,
                          const voxdag_region* region, size_t capacity, int64_t (*cells)[3]) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (capacity) expect_pointer(cells, "the array of cells");
    const uint64_t count = file->dag.positions(selection_of(grid_levels, region),
                                               {reinterpret_cast<Position*>(cells), capacity});
    if (count > capacity)
      refuse("the region has " + std::to_string(count) +
             " set cells: expected an array of at least this length, "
             "not of " +
             std::to_string(capacity));
  });
}

voxdag_status voxdag_bricks(const voxdag_file* file, uint32_t grid_levels,
                            const voxdag_region* region, size_t capacity, voxdag_brick* bricks,
                            size_t* count) {
  return answer([&] {
    expect_pointer(file, "the file");
    expect_pointer(count, "the place of the count");
    if (capacity) expect_pointer(bricks, "the array of bricks");
    size_t found = 0;
    file->dag.bricks(selection_of(grid_levels, region), [&](const voxdag::query::Brick& brick) {
      if (found < capacity)
        bricks[found] = {{brick.low[0], brick.low[1], brick.low[2]}, brick.mask};
      ++found;
    });
    *count = found;
  });
}

voxdag_status voxdag_overlap_boxes(const voxdag_file* file, uint32_t grid_levels,
                                   const voxdag_box* boxes, size_t count, uint8_t* overlaps) {
  return overlaps_of(file, grid_levels, boxes, count, overlaps);
}

voxdag_status voxdag_overlap_capsules(const voxdag_file* file, uint32_t grid_levels,
                                      const voxdag_capsule* capsules, size_t count,
                                      uint8_t* overlaps) {
  return overlaps_of(file, grid_levels, capsules, count, overlaps);
}

voxdag_status voxdag_nearest(const voxdag_file* file, const int64_t (*voxels)[3], size_t count,
                             double max_distance, int64_t (*nearest)[3], double* distances) {
  return answer([&] {
    expect_pointer(file, "the file");
    if (count) expect_pointer(nearest, "the array of answers");
    const std::span<const Position> from = positions_of(voxels, count);
    std::vector<voxdag::query::Nearest> found(std::min(count, kBatch));
    for_each_batch(count, [&](size_t first, size_t some) {
      file->dag.nearest(from.subspan(first, some), file->dag.grid_levels(), max_distance,
                        std::span(found).first(some));
      for (size_t i = 0; i < some; ++i) {
        const Position cell = found[i].found ? found[i].cell : Position{-1, -1, -1};
        std::copy_n(cell.begin(), 3, nearest[first + i]);
        if (distances)
          distances[first + i] =
              found[i].found ? std::sqrt(static_cast<double>(found[i].squared_distance)) : HUGE_VAL;
      }
    });
  });
}
