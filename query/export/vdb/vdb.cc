// Exports OpenVDB's .vdb and NanoVDB's .nvdb with these two libraries. The file has a grid of
// active voxels and, if the input has colors, a grid of the colors in linear light. The color grid
// has the name "Cd", which Houdini and Blender use. The libraries build the grids completely in
// memory, so their size is calculated first and compared with the memory budget.
//
// Half floats are converted without Imath's lookup table, because a use of the table would require
// linking Imath.
#define IMATH_HALF_NO_LOOKUP_TABLE
#include <openvdb/openvdb.h>

// Must be included before NanoVDB's conversion.
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/io/Stream.h>

#include <algorithm>
#include <bit>
#include <ostream>
#include <streambuf>
#include <vector>

#include "core/base/error.h"
#include "core/base/text.h"
#include "query/export/color/linear_colors.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

// Bytes of memory for a leaf of 8^3 voxels, for a lower node of 128^3 voxels, and for an upper node
// of 4096^3 voxels. The sizes include the pointers in the nodes.
struct VdbNodeBytes {
  uint64_t leaf, lower, upper;
};
constexpr VdbNodeBytes kOpenVdbBytes = {192, 34 << 10, 272 << 10};
constexpr VdbNodeBytes kNanoVdbBytes = {96, 34 << 10, 272 << 10};
// Sizes for a grid of colors. A color is three floats. A node stores for each child one color
// (padded) or a pointer.
constexpr VdbNodeBytes kColorBytes = {6400, 66 << 10, 522 << 10};
// Minimum size of a leaf in a .vdb file, which stores the mask twice.
constexpr uint64_t kVdbLeafBytes = 128;
// Bytes of a tile of 4096^3 voxels in the root's table.
constexpr uint64_t kRootTileBytes = 128;
constexpr const char* kGridName = "voxels";
constexpr const char* kColorGridName = "Cd";

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

// A stream buffer that writes to an ExportFile. Streams swallow exceptions, and the libraries' own
// errors do not contain the reason. So check() rethrows the first exception.
class FileBuffer : public std::streambuf {
 public:
  FileBuffer(ExportFile& file, ExportStage& stage) : file_(file), stage_(stage) {}
  void check() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 protected:
  std::streamsize xsputn(const char* bytes, std::streamsize count) override {
    // Writes in pieces, to check for cancellation and report progress: a single call may pass a
    // complete grid.
    constexpr size_t kPieceBytes = 1 << 20;
    const bool done = attempt([&] {
      std::string_view rest(bytes, static_cast<size_t>(count));
      while (!rest.empty()) {
        const std::string_view piece = rest.substr(0, kPieceBytes);
        file_.write(piece);
        stage_.advance(piece.size());
        if (piece.size() == kPieceBytes) stage_.report();
        rest.remove_prefix(piece.size());
      }
      at_ += count;
    });
    return done ? count : 0;
  }
  int_type overflow(int_type byte) override {
    const char c = traits_type::to_char_type(byte);
    return xsputn(&c, 1) == 1 ? byte : traits_type::eof();
  }
  pos_type seekoff(off_type offset, std::ios_base::seekdir from, std::ios_base::openmode) override {
    if (from == std::ios_base::cur) offset += at_;
    if (from == std::ios_base::end) offset += static_cast<off_type>(file_.size());
    if (offset == at_) return at_;
    return attempt([&] { file_.seek(static_cast<uint64_t>(at_ = offset)); }) ? pos_type(at_)
                                                                             : pos_type(-1);
  }
  pos_type seekpos(pos_type at, std::ios_base::openmode mode) override {
    return seekoff(at, std::ios_base::beg, mode);
  }

 private:
  template <class Work>
  bool attempt(const Work& work) {
    if (failure_) return false;
    try {
      work();
      return true;
    } catch (...) {
      failure_ = std::current_exception();
      return false;
    }
  }

  ExportFile& file_;
  ExportStage& stage_;
  off_type at_ = 0;
  std::exception_ptr failure_;
};

struct VdbSize {
  uint64_t voxels = 0, bytes = 0;
};
// True if full cubes are tiles of the grid of voxels. A grid of colors has no tiles, because the
// voxels of a cube have different colors.
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
// so all bricks of a node come one after the other and the node is counted once. A full cube is a
// tile of the node that contains it, or tiles of several nodes if it is larger than a node's child.
// Calls steps.advance() for each brick and each full cube.
template <class Steps>
VdbSize vdb_size(const ExportJob& job, const Selection& selection, const VdbNodeBytes& node,
                 uint64_t limit, Steps steps) {
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
        size.voxels += static_cast<uint64_t>(std::popcount(brick.mask));
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
  uint64_t voxels = 0;
  MemoryCharge charge;
};
ChargedVdb charge_vdb(const ExportJob& job, const VdbNodeBytes& node) {
  const uint64_t limit = job.budget.available();
  const VdbSize size =
      vdb_size(job, job.selection, node, limit, ExportStage(job, "count", 0, "bricks"));
  if (size.voxels == 0) refuse_empty(job);
  if (size.bytes > limit)
    refuse_size(
        job,
        "the grid would take over " + size_text(limit) + " of memory, the limit --memory" +
            (job.has_colors ? " (without colors, --gray, it takes less)" : ""),
        [&](uint32_t level) {
          return vdb_size(job, coarser(job.selection, level), node, limit, CancelCheck(job))
                     .bytes <= limit;
        },
        ErrorCode::kOutOfMemory);
  return {size.voxels, MemoryCharge(job.budget, size.bytes, "the grid")};
}

openvdb::Coord vdb_coord(const Position& cell) {
  return openvdb::Coord(static_cast<openvdb::Int32>(cell[0]), static_cast<openvdb::Int32>(cell[1]),
                        static_cast<openvdb::Int32>(cell[2]));
}

template <class GridType>
typename GridType::Ptr empty_vdb_grid(const ExportJob& job, const char* name) {
  auto grid = GridType::create();
  grid->setName(name);
  // OpenVDB's integer index coordinates denote the centers of voxels, so index 0 is mapped to the
  // center of the first voxel.
  auto transform = openvdb::math::Transform::createLinearTransform(job.cell_edge());
  transform->postTranslate({job.world(0, 0.5), job.world(1, 0.5), job.world(2, 0.5)});
  grid->setTransform(transform);
  return grid;
}

// Sets the voxels of a brick to value(cell).
template <class Accessor, class Value>
void set_brick(const Brick& brick, const Value& value, Accessor& accessor, ExportStage& stage) {
  auto* const leaf = accessor.touchLeaf(vdb_coord(brick.low));
  for_each_cell_of(brick,
                   [&](const Position& cell) { leaf->setValueOn(vdb_coord(cell), value(cell)); });
  stage.advance(static_cast<uint64_t>(std::popcount(brick.mask)));
}

template <class GridType>
typename GridType::Ptr make_voxel_grid(const ExportJob& job, uint64_t voxels) {
  const auto grid = empty_vdb_grid<GridType>(job, kGridName);
  ExportStage stage(job, "build grid", voxels, "voxels");
  typename GridType::Accessor accessor = grid->getAccessor();
  for_each_vdb_part(
      job, job.selection,
      [&](const Brick& brick) {
        set_brick(
            brick, [](const Position&) { return true; }, accessor, stage);
        return true;
      },
      [&](const Position& low, int64_t edge) {
        const int64_t last = edge - 1;
        grid->tree().sparseFill(
            {vdb_coord(low), vdb_coord({low[0] + last, low[1] + last, low[2] + last})}, true, true);
        stage.advance(cells_of_cube(edge));
        return true;
      });
  return grid;
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
    FileBuffer buffer(file, stage);
    std::ostream stream(&buffer);
    try {
      write(stream);
    } catch (const std::exception&) {
      buffer.check();
      throw;
    }
    buffer.check();
  }
  job.cancel.check();
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  return report;
}

}  // namespace

ExportReport write_vdb(const ExportJob& job) {
  const ChargedVdb charged =
      charge_vdb(job, job.has_colors ? kOpenVdbBytes + kColorBytes : kOpenVdbBytes);
  const uint64_t voxels = charged.voxels;
  return with_vdb_errors(job, [&] {
    openvdb::initialize();
    const auto grid = make_voxel_grid<openvdb::BoolGrid>(job, voxels);
    openvdb::GridPtrVec grids = {grid};
    if (job.has_colors) {
      grids.push_back(make_color_grid(job, voxels));
      // Half floats are precise enough to distinguish the linear values of all sRGB bytes.
      grids.back()->setSaveFloatAsHalf(true);
    }
    const uint64_t min_bytes = std::max<uint64_t>(grid->tree().leafCount() * kVdbLeafBytes, 1);
    return write_grid_file(job, voxels, min_bytes, [&](std::ostream& stream) {
      // Does not compress, because some readers may lack the codec. Compression would gain little
      // for the grid of voxels, whose leaves consist of bits.
      openvdb::io::Stream out(stream);
      out.setCompression(openvdb::io::COMPRESS_ACTIVE_MASK);
      out.write(grids);
    });
  });
}

ExportReport write_nvdb(const ExportJob& job) {
  VdbNodeBytes both = kOpenVdbBytes + kNanoVdbBytes;
  if (job.has_colors) both = both + kColorBytes + kColorBytes;
  const ChargedVdb charged = charge_vdb(job, both);
  const uint64_t voxels = charged.voxels;
  return with_vdb_errors(job, [&] {
    openvdb::initialize();
    std::vector<nanovdb::GridHandle<nanovdb::HostBuffer>> grids;
    grids.push_back(nanovdb::openToNanoVDB<nanovdb::HostBuffer>(
        *make_voxel_grid<openvdb::MaskGrid>(job, voxels)));
    if (job.has_colors)
      grids.push_back(nanovdb::openToNanoVDB<nanovdb::HostBuffer>(*make_color_grid(job, voxels)));
    uint64_t bytes = 0;
    for (const auto& grid : grids) bytes += grid.size();
    return write_grid_file(job, voxels, bytes, [&](std::ostream& stream) {
      nanovdb::io::writeGrids<nanovdb::HostBuffer, std::vector>(stream, grids,
                                                                nanovdb::io::Codec::NONE);
    });
  });
}

}  // namespace voxdag::query
