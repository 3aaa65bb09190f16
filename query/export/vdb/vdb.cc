// Exports OpenVDB's .vdb and NanoVDB's .nvdb with these two libraries. A file has a grid of the
// voxels, which is a fog volume, a mask, or the level set of a solid. If the input has colors, the
// file also has a grid of the colors in linear light. The fog volume has the name "density", which
// Houdini and Blender render. The color grid has the name "Cd", which both programs use. The
// libraries build all grids in memory, so the memory is calculated first and compared with the
// memory budget.
//
// Half floats are converted without Imath's lookup table, because the table would require linking
// to Imath.
#define IMATH_HALF_NO_LOOKUP_TABLE
#include <openvdb/openvdb.h>

// Must be included before NanoVDB's conversion.
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/io/Stream.h>

#include <algorithm>
#include <bit>
#include <ostream>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "query/export/color/linear_colors.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/export/vdb/file_buffer.h"
#include "query/export/vdb/level_set.h"
#include "query/export/vdb/vdb_grid.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

constexpr VdbNodeBytes kOpenVdbMaskBytes = {192, 34 << 10, 272 << 10};
constexpr VdbNodeBytes kNanoVdbMaskBytes = {96, 34 << 10, 272 << 10};
// Sizes for a grid of floats. A leaf stores one float for each of its voxels.
constexpr VdbNodeBytes kOpenVdbFloatBytes = {2304, 34 << 10, 272 << 10};
constexpr VdbNodeBytes kNanoVdbFloatBytes = {2176, 34 << 10, 272 << 10};
// Sizes for a grid of colors of three floats each. A node above the leaves stores a padded color or
// a pointer for each child.
constexpr VdbNodeBytes kColorBytes = {6400, 66 << 10, 522 << 10};
// Minimum size of a leaf in a .vdb file, which stores the mask twice.
constexpr uint64_t kVdbLeafBytes = 128;
constexpr const char* kColorGridName = "Cd";

constexpr uint64_t kHalfBytes = 2;  // size of a half float, as .vdb files store them

using NanoGrid = nanovdb::GridHandle<nanovdb::HostBuffer>;

// A choice for the grid of the voxels (option --grid), and the functions that make this grid.
struct VoxelGrid {
  const char* name;
  VdbNodeBytes open_vdb, nano_vdb;
  uint64_t value_bytes;  // bytes per voxel in a leaf of a .vdb file, not counting the masks
  // These functions make the grid. They report their progress as a stage of `steps` units: leaves
  // for the level set, voxels for the other grids.
  openvdb::GridBase::Ptr (*make)(const ExportJob& job, uint64_t steps);
  NanoGrid (*make_nano)(const ExportJob& job, uint64_t steps);
  // True if the values are distances from the surface. The file then has no color grid.
  bool is_level_set = false;

  bool has_colors(const ExportJob& job) const { return job.has_colors && !is_level_set; }
};

VdbNodeBytes operator+(const VdbNodeBytes& a, const VdbNodeBytes& b) {
  return {a.leaf + b.leaf, a.lower + b.lower, a.upper + b.upper};
}

// Converts an exception of the libraries to an Error. Rethrows voxdag's own errors and bad_alloc.
template <class Work>
auto with_vdb_errors(const ExportJob& job, const Work& work) {
  try {
    return work();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(ErrorCode::kIo,
                job.output + ": the library OpenVDB cannot write the file: " + error.what());
  }
}

// True if full cubes are stored as tiles. With colors they are not, because the voxels of a cube
// can have different colors.
bool has_tiles(const ExportJob& job) { return !job.has_colors; }

// Calls visit_brick() for the bricks of a selection. If the job has tiles, calls visit_cube()
// instead for the full cubes. Both functions return a bool; false ends the iteration.
template <class VisitBrick, class VisitCube>
void for_each_vdb_part(const ExportJob& job, const Selection& selection,
                       const VisitBrick& visit_brick, const VisitCube& visit_cube) {
  if (has_tiles(job))
    for_each_brick_or_full_cube(job.dag, selection, visit_brick, visit_cube);
  else
    for_each_brick(job.dag, selection, visit_brick);
}

// Counts the voxels of a selection, and the bytes of memory for its trees, whose nodes have the
// sizes `node`. Stops when there are more than `limit` bytes. Bricks are visited in Morton order,
// so all bricks of a node come one after the other and the node is counted once. A full cube takes
// memory only for the nodes that contain it. If it has 4096 or more cells per edge, it consists of
// tiles in the root's table. Calls steps.advance() for each brick and each full cube.
template <class Steps>
VdbSize vdb_size(const ExportJob& job, const Selection& selection, const VdbNodeBytes& node,
                 uint64_t limit, Steps&& steps) {
  VdbSize size;
  Position leaf{-1, 0, 0}, lower{-1, 0, 0}, upper{-1, 0, 0};
  const auto count = [&](const Position& corner, int shift, Position& last, uint64_t cost) {
    const Position cube = {corner[0] >> shift, corner[1] >> shift, corner[2] >> shift};
    if (cube == last) return;
    last = cube;
    size.bytes += cost;
  };
  const auto add_nodes = [&](const Position& corner, int64_t edge) {
    if (edge < 8) count(corner, 3, leaf, node.leaf);
    if (edge < 128) count(corner, 7, lower, node.lower);
    if (edge < 4096) count(corner, 12, upper, node.upper);
  };
  for_each_vdb_part(
      job, selection,
      [&](const Brick& brick) {
        steps.advance(1);
        const auto voxels = static_cast<uint64_t>(std::popcount(brick.mask));
        size.voxels += voxels;
        size.leaf_voxels += voxels;
        add_nodes(brick.low, kBrickEdge);
        return size.bytes <= limit;
      },
      [&](const Position& low, int64_t edge) {
        steps.advance(1);
        size.voxels += cells_of_cube(edge);
        size.bytes += cells_of_cube(edge / 4096) * kRootTileBytes;
        add_nodes(low, edge);
        return size.bytes <= limit;
      });
  return size;
}

struct ChargedVdb {
  uint64_t voxels = 0, leaf_voxels = 0;
  uint64_t steps = 0;  // the total of the stage that makes the grid: voxels, or leaves
  MemoryCharge charge;
};
ChargedVdb charge_vdb(const ExportJob& job, const VoxelGrid& grid, const VdbNodeBytes& node) {
  const uint64_t limit = job.budget.available();
  const auto size_of = [&](const Selection& selection, auto&& steps) {
    return grid.is_level_set ? level_set_size(job, selection, node, limit, steps)
                             : vdb_size(job, selection, node, limit, steps);
  };
  VdbSize size = size_of(job.selection, ExportStage(job, "count", 0, "bricks"));
  if (grid.is_level_set) size.voxels = count_voxels(job, job.selection, UINT64_MAX);
  const bool has_contents = grid.is_level_set
                                ? has_band(job.dag, job.selection, job.options.band_width())
                                : size.voxels != 0;
  if (!has_contents) refuse_empty(job);
  if (size.bytes > limit)
    refuse_size(
        job,
        "the grid would take over " + size_text(limit) + " of memory, which is what " +
            option_text("memory") + " leaves for it" +
            (grid.has_colors(job) ? ". Without colors (" + option_text("gray") + ") it takes less"
                                  : "") +
            (grid.name == std::string_view("mask")
                 ? ""
                 : ". " + option_text("grid", "mask") + " takes less"),
        [&](uint32_t level) {
          return size_of(coarser(job.selection, level), CancelCheck(job)).bytes <= limit;
        },
        ErrorCode::kOutOfMemory);
  return {size.voxels, size.leaf_voxels, grid.is_level_set ? size.leaves : size.voxels,
          MemoryCharge(job.budget, size.bytes, "the grid")};
}

// Sets the voxels of a brick to value(cell).
template <class Accessor, class Value>
void set_brick(const Brick& brick, const Value& value, Accessor& accessor, ExportStage& stage) {
  auto* const leaf = accessor.touchLeaf(vdb_coord(brick.low));
  for_each_cell_of(brick,
                   [&](const Position& cell) { leaf->setValueOn(vdb_coord(cell), value(cell)); });
  stage.advance(static_cast<uint64_t>(std::popcount(brick.mask)));
}

// Returns a grid in which all selected voxels are active and have the value 1 or true.
template <class GridType>
typename GridType::Ptr make_voxel_grid(const ExportJob& job, uint64_t voxels, const char* name) {
  const typename GridType::ValueType on(1);
  const auto grid = empty_vdb_grid<GridType>(job, name);
  ExportStage stage(job, "build grid", voxels, "voxels");
  typename GridType::Accessor accessor = grid->getAccessor();
  for_each_vdb_part(
      job, job.selection,
      [&](const Brick& brick) {
        set_brick(
            brick, [&](const Position&) { return on; }, accessor, stage);
        return true;
      },
      [&](const Position& low, int64_t edge) {
        const int64_t last = edge - 1;
        grid->tree().sparseFill(
            {vdb_coord(low), vdb_coord({low[0] + last, low[1] + last, low[2] + last})}, on, true);
        stage.advance(cells_of_cube(edge));
        return true;
      });
  return grid;
}

openvdb::FloatGrid::Ptr make_density(const ExportJob& job, uint64_t voxels) {
  const auto grid = make_voxel_grid<openvdb::FloatGrid>(job, voxels, "density");
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  grid->setSaveFloatAsHalf(true);  // all values are 0 or 1, which half floats store exactly
  return grid;
}

template <class Grid>
NanoGrid nano_grid(const Grid& grid) {
  return nanovdb::openToNanoVDB<nanovdb::HostBuffer>(grid);
}

constexpr const char* kMaskName = "voxels";
constexpr VoxelGrid kVoxelGrids[] = {
    {"density", kOpenVdbFloatBytes, kNanoVdbFloatBytes, kHalfBytes,
     [](const ExportJob& job, uint64_t voxels) -> openvdb::GridBase::Ptr {
       return make_density(job, voxels);
     },
     [](const ExportJob& job, uint64_t voxels) { return nano_grid(*make_density(job, voxels)); }},
    {"mask", kOpenVdbMaskBytes, kNanoVdbMaskBytes, 0,
     [](const ExportJob& job, uint64_t voxels) -> openvdb::GridBase::Ptr {
       return make_voxel_grid<openvdb::BoolGrid>(job, voxels, kMaskName);
     },
     [](const ExportJob& job, uint64_t voxels) {
       return nano_grid(*make_voxel_grid<openvdb::MaskGrid>(job, voxels, kMaskName));
     }},
    {"sdf", kOpenVdbFloatBytes, kNanoVdbFloatBytes, 0,
     [](const ExportJob& job, uint64_t leaves) -> openvdb::GridBase::Ptr {
       return make_level_set(job, leaves);
     },
     [](const ExportJob& job, uint64_t leaves) { return nano_grid(*make_level_set(job, leaves)); },
     true},
};

static_assert(kMaxExportBand == kMaxBandWidth);

const VoxelGrid& voxel_grid(const ExportJob& job) {
  for (const VoxelGrid& grid : kVoxelGrids)
    if (grid.name == std::string_view(name_of(job.options.grid))) return grid;
  return kVoxelGrids[0];  // GridKind::kOfFormat
}

openvdb::Vec3SGrid::Ptr make_color_grid(const ExportJob& job, uint64_t voxels) {
  voxdag_reader::ColorCursor colors(job.file);
  const auto& linear = linear_of_srgb();
  const auto light = [&](uint8_t channel) { return static_cast<float>(linear[channel]) / 65535; };
  const auto linear_color = [&](const Position& cell) {
    const voxdag_reader::Rgb color = color_of_cell(job, colors, cell);
    return openvdb::Vec3f(light(color.r), light(color.g), light(color.b));
  };
  const auto grid = empty_vdb_grid<openvdb::Vec3SGrid>(job, kColorGridName);
  ExportStage stage(job, "build grid", voxels, "voxels");
  openvdb::Vec3SGrid::Accessor accessor = grid->getAccessor();
  for_each_brick(job.dag, job.selection,
                 [&](const Brick& brick) { set_brick(brick, linear_color, accessor, stage); });
  return grid;
}

// Writes the output with write(stream), and publishes it. `min_bytes` is a lower bound on the
// file's size, for the check of free disk space and for the progress.
template <class Write>
ExportReport write_grid_file(const ExportJob& job, uint64_t voxels, uint64_t min_bytes,
                             const Write& write) {
  require_space(job, min_bytes);
  ExportReport report;
  report.voxels = voxels;
  ExportFile file(job.files, job.output);
  {
    ExportStage stage(job, "export", min_bytes, "bytes");
    FileBuffer buffer(file, stage, min_bytes);
    std::ostream stream(&buffer);
    try {
      write(stream);
    } catch (const std::exception&) {
      buffer.check();
      throw;
    }
    buffer.check();
    buffer.finish();
  }
  job.cancel.check();
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  return report;
}

}  // namespace

ExportReport write_vdb(const ExportJob& job) {
  const VoxelGrid& kind = voxel_grid(job);
  const ChargedVdb charged =
      charge_vdb(job, kind, kind.has_colors(job) ? kind.open_vdb + kColorBytes : kind.open_vdb);
  const uint64_t voxels = charged.voxels;
  return with_vdb_errors(job, [&] {
    openvdb::initialize();
    const openvdb::GridBase::Ptr grid = kind.make(job, charged.steps);
    const uint64_t leaf_bytes = grid->constBaseTree().leafCount() * kVdbLeafBytes;
    uint64_t min_bytes = leaf_bytes + charged.leaf_voxels * kind.value_bytes;
    openvdb::GridPtrVec grids = {grid};
    if (kind.has_colors(job)) {
      // The colors are first because vdb_render sorts the names of the grids, but not the grids:
      // with the density first, it would take the colors for the density.
      grids.insert(grids.begin(), make_color_grid(job, voxels));
      // Half floats are precise enough to distinguish the linear values of all sRGB bytes.
      grids.front()->setSaveFloatAsHalf(true);
      min_bytes += leaf_bytes + voxels * 3 * kHalfBytes;
    }
    return write_grid_file(job, voxels, std::max<uint64_t>(min_bytes, 1),
                           [&](std::ostream& stream) {
                             // Uses no compression codec, because some readers have none.
                             // COMPRESS_ACTIVE_MASK only leaves out inactive values.
                             openvdb::io::Stream out(stream);
                             out.setCompression(openvdb::io::COMPRESS_ACTIVE_MASK);
                             out.write(grids);
                           });
  });
}

ExportReport write_nvdb(const ExportJob& job) {
  const VoxelGrid& kind = voxel_grid(job);
  VdbNodeBytes both = kind.open_vdb + kind.nano_vdb;
  if (kind.has_colors(job)) both = both + kColorBytes + kColorBytes;
  const ChargedVdb charged = charge_vdb(job, kind, both);
  const uint64_t voxels = charged.voxels;
  return with_vdb_errors(job, [&] {
    openvdb::initialize();
    std::vector<NanoGrid> grids;
    grids.push_back(kind.make_nano(job, charged.steps));
    if (kind.has_colors(job)) grids.push_back(nano_grid(*make_color_grid(job, voxels)));
    uint64_t bytes = 0;
    for (const auto& grid : grids) bytes += grid.size();
    return write_grid_file(job, voxels, bytes, [&](std::ostream& stream) {
      nanovdb::io::writeGrids<nanovdb::HostBuffer, std::vector>(stream, grids,
                                                                nanovdb::io::Codec::NONE);
    });
  });
}

}  // namespace voxdag::query
