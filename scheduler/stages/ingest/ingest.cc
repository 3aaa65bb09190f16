#include "scheduler/stages/ingest/ingest.h"

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "scheduler/stages/ingest/read_pieces.h"
#include "scheduler/triangles/chunk.h"

namespace voxdag {
namespace {

class PieceBounds {
 public:
  void read(TriangleCursor& cursor, uint64_t first, uint64_t count) {
    bounds_ = cursor.read_bounds(first, count);
  }
  const WorldBounds& bounds() const { return bounds_; }

 private:
  WorldBounds bounds_;
};

// A piece of the scene after snapping.
class SnappedPiece {
 public:
  SnappedPiece(const Grid& grid, const TopTree& top, size_t record_bytes, MemoryBudget& budget)
      : grid_(grid),
        record_bytes_(record_bytes),
        records_(budget, kPieceTriangles * record_bytes, "a piece of the scene"),
        tally_(top) {}

  void read(TriangleCursor& cursor, uint64_t first, uint64_t count) {
    counts_ = {};
    too_far_.reset();
    tally_.clear();
    cursor.read_snapped(first, count, grid_, [this](std::span<const SnappedTriangle> batch) {
      for (const SnappedTriangle& triangle : batch) add(triangle);
    });
    checksum_ = checksum128(records());
  }

  const IngestCounts& counts() const { return counts_; }
  // Number of valid triangles in this piece before the first triangle beyond the coordinate limit;
  // nullopt if there is no such triangle.
  const std::optional<uint64_t>& too_far() const { return too_far_; }
  std::span<const std::byte> records() const {
    return {records_.data(), counts_.triangles * record_bytes_};
  }
  const Checksum128& checksum() const { return checksum_; }
  TopTree::Tally& tally() { return tally_; }

 private:
  void add(const SnappedTriangle& snapped) {
    FixedTriangle triangle;
    switch (to_fixed(grid_, snapped, triangle)) {
      case SnapResult::kOutside:
        ++counts_.dropped_outside;
        return;
      case SnapResult::kTooFar:
        if (!too_far_) too_far_ = counts_.triangles + counts_.dropped_outside;
        return;
      case SnapResult::kInside:
        break;
    }
    const ExpectedWork work = expected_work(snapped);
    counts_.expected_voxels += work.voxels;
    tally_.add(triangle, work.bricks);
    encode_triangle(triangle, record_bytes_, records_.data() + counts_.triangles * record_bytes_);
    ++counts_.triangles;
  }

  const Grid grid_;
  const size_t record_bytes_;
  PageBuffer<std::byte> records_;
  IngestCounts counts_;
  std::optional<uint64_t> too_far_;
  TopTree::Tally tally_;
  Checksum128 checksum_;
};

void add(const IngestCounts& piece, IngestCounts& total) {
  total.triangles += piece.triangles;
  total.dropped_outside += piece.dropped_outside;
  total.expected_voxels += piece.expected_voxels;
}

}  // namespace

void scan(TriangleSource& scene, IngestState& state, const StageContext& context,
          const AfterPiece& after_piece) {
  Progress& progress = context.build.progress;
  progress.begin_stage("scan", state.declared_triangles, "triangles");
  progress.resume_at(state.position);
  read_pieces<PieceBounds>(
      scene, state.position, context, [](auto& piece) { piece.emplace(); },
      [&](const PieceBounds& piece, uint64_t position) {
        state.bounds.add(piece.bounds());
        state.position = position;
        after_piece();
      });
  progress.end_stage();
}

Grid choose_grid(const GeometryOptions& options, const WorldBounds& bounds) {
  const uint32_t levels = levels_of_resolution(options.resolution);
  if (options.bounds) {
    const auto& b = *options.bounds;
    return Grid::given({b[0], b[1], b[2]}, b[3], levels);
  }
  if (options.voxel_size) return Grid::with_voxel_size(bounds, *options.voxel_size, levels);
  return Grid::around(bounds, levels);
}

void ingest(TriangleSource& scene, IngestState& state, TriangleStore& store, TopTree& top,
            const StageContext& context, const AfterPiece& after_piece) {
  Progress& progress = context.build.progress;
  progress.begin_stage("ingest", state.declared_triangles, "triangles");
  progress.resume_at(state.position);
  IngestCounts& counts = state.counts;
  read_pieces<SnappedPiece>(
      scene, state.position, context,
      [&](auto& piece) { piece.emplace(state.grid, top, store.record_bytes(), context.budget); },
      [&](SnappedPiece& piece, uint64_t position) {
        if (piece.too_far())
          throw Error(
              ErrorCode::kLimit,
              "triangle " +
                  std::to_string(counts.triangles + counts.dropped_outside + *piece.too_far()) +
                  " of the scene reaches into the grid and has a vertex 2^32 or more voxels away "
                  "from the grid's low corner: expected less than 2^32 voxels on each axis "
                  "(--bounds)");
        add(piece.counts(), counts);
        top.add(piece.tally());
        add_records(store, kSceneBin, piece.records());
        state.digest.add(piece.checksum());
        state.position = position;
        after_piece();
      });
  counts.dropped_invalid = state.declared_triangles - counts.triangles - counts.dropped_outside;
  progress.end_stage();
}

}  // namespace voxdag
