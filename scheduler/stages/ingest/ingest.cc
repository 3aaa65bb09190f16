#include "scheduler/stages/ingest/ingest.h"

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/page_buffer.h"
#include "core/color/patches/visible_patches.h"
#include "core/color/snap_surface.h"
#include "scene/textures/find_cutouts.h"
#include "scheduler/stages/ingest/read_pieces.h"
#include "scheduler/triangles/chunk.h"
#include "scheduler/triangles/surface_record.h"

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
  SnappedPiece(const Grid& grid, const TopTree& top, size_t record_bytes, const Cutouts* cutouts,
               MemoryBudget& budget)
      : grid_(grid),
        record_bytes_(record_bytes),
        cutouts_(cutouts),
        records_(budget, (cutouts ? 2 : 1) * kPieceTriangles * record_bytes,
                 "a piece of the scene"),
        tally_(top) {
    if (!cutouts_) return;
    charge_ = MemoryCharge(budget, kCutoutBytes, "a piece of the scene");
    divider_.emplace(grid.levels);
  }

  void read(TriangleCursor& cursor, uint64_t first, uint64_t count) {
    counts_ = {};
    too_far_.reset();
    clear();
    if (cutouts_) return read_surfaces(cursor, first, count);
    cursor.read_snapped(first, count, grid_, [this](std::span<const SnappedTriangle> batch) {
      for (const SnappedTriangle& triangle : batch) add(triangle);
    });
    checksum_ = checksum128(records());
  }

  // Adds the patches (see ingest()) of the triangles in late_, whose patches did not fit in the
  // piece. Calls flush() whenever the buffer of records() is full, and at the end.
  template <class Flush>
  void add_late(const Flush& flush) {
    for (const FixedSurface& surface : late_) {
      const VisiblePart part(surface, *cutouts_, grid_.levels);
      divider_->for_each(part, [&](const FixedTriangle& patch) {
        if (stored_ == records_.size() / record_bytes_) {
          flush();
          clear();
        }
        add_patch(patch);
        return true;
      });
    }
    if (!late_.empty()) flush();
  }

  const IngestCounts& counts() const { return counts_; }
  // Number of valid triangles in this piece before the first triangle beyond the coordinate limit;
  // nullopt if there is no such triangle.
  const std::optional<uint64_t>& too_far() const { return too_far_; }
  std::span<const std::byte> records() const { return {records_.data(), stored_ * record_bytes_}; }
  const Checksum128& checksum() const { return checksum_; }
  TopTree::Tally& tally() { return tally_; }

 private:
  // Maximum number of patches in a piece. A triangle whose patches would exceed it is added by
  // add_late().
  static constexpr size_t kMaxPatches = kPieceTriangles;
  static constexpr uint64_t kCutoutBytes =
      kPieceTriangles * (kMaxSurfaceRecordBytes + 2 * sizeof(FixedSurface)) +
      kMaxPatches * sizeof(FixedTriangle) + VisiblePatches::kBytes;

  void clear() {
    tally_.clear();
    stored_ = 0;
    counts_.expected_voxels = 0;
  }

  // Returns true if the triangle is in the grid. Otherwise counts the triangle as dropped, or sets
  // too_far_.
  bool is_inside(SnapResult result) {
    if (result == SnapResult::kOutside) ++counts_.dropped_outside;
    if (result == SnapResult::kTooFar && !too_far_)
      too_far_ = counts_.triangles + counts_.dropped_outside;
    return result == SnapResult::kInside;
  }

  void add(const SnappedTriangle& snapped) {
    FixedTriangle triangle;
    if (!is_inside(to_fixed(grid_, snapped, triangle))) return;
    ++counts_.triangles;
    store(triangle, expected_work(snapped));
  }

  void store(const FixedTriangle& triangle, const ExpectedWork& work) {
    counts_.expected_voxels += work.voxels;
    tally_.add(triangle, work.bricks);
    encode_triangle(triangle, record_bytes_, records_.data() + stored_ * record_bytes_);
    ++stored_;
  }

  // Reads `count` triangles with their materials, starting at index `first`. The checksum covers
  // the triangles (append_identity()), not their patches, so that later stages can compare it with
  // the scene.
  void read_surfaces(TriangleCursor& cursor, uint64_t first, uint64_t count) {
    late_.clear();
    identity_.clear();
    patches_in_piece_ = 0;
    cursor.read_surfaces(first, count, [this](std::span<const SurfaceTriangle> batch) {
      for (const SurfaceTriangle& triangle : batch) add(triangle);
    });
    checksum_ = checksum128(identity_);
  }

  void add(const SurfaceTriangle& world) {
    SnappedTriangle snapped = world.position;
    for (auto& vertex : snapped.v) snap_vertices(grid_, vertex);
    FixedSurface surface;
    if (!is_inside(to_fixed(grid_, snapped, surface.position))) return;
    ++counts_.triangles;
    copy_appearance(world, surface);
    append_identity(surface, cutouts_, record_bytes_, identity_);
    if (!cutouts_->may_cut(surface.material))
      return store(surface.position, expected_work(snapped));
    const VisiblePart part(surface, *cutouts_, grid_.levels);
    const VisiblePart::Sight sight = part.sight(Cube{});
    if (sight == VisiblePart::Sight::kVisible) store(surface.position, expected_work(snapped));
    if (sight == VisiblePart::Sight::kMixed) add_patches(surface, part);
  }

  void add_patches(const FixedSurface& surface, const VisiblePart& part) {
    patches_.clear();
    const bool is_complete = divider_->for_each(part, [&](const FixedTriangle& patch) {
      if (patches_in_piece_ + patches_.size() == kMaxPatches) return false;
      patches_.push_back(patch);
      return true;
    });
    if (!is_complete) return late_.push_back(surface);
    patches_in_piece_ += patches_.size();
    for (const FixedTriangle& patch : patches_) add_patch(patch);
  }

  void add_patch(const FixedTriangle& patch) {
    SnappedTriangle snapped;
    for (size_t i = 0; i < 3; ++i)
      for (size_t a = 0; a < 3; ++a) snapped.v[i][a] = static_cast<double>(patch.v[i][a]);
    store(patch, expected_work(snapped));
  }

  const Grid grid_;
  const size_t record_bytes_;
  const Cutouts* const cutouts_;
  MemoryCharge charge_;
  PageBuffer<std::byte> records_;
  size_t stored_ = 0;  // number of records
  std::optional<VisiblePatches> divider_;
  std::vector<FixedTriangle> patches_;  // patches of one triangle
  size_t patches_in_piece_ = 0;
  std::vector<FixedSurface> late_;  // triangles whose patches exceed kMaxPatches
  std::vector<std::byte> identity_;
  IngestCounts counts_;
  std::optional<uint64_t> too_far_;
  TopTree::Tally tally_;
  Checksum128 checksum_;
};

void add(const IngestCounts& piece, IngestCounts& total) {
  total.triangles += piece.triangles;
  total.dropped_outside += piece.dropped_outside;
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
  if (options.voxel_size)
    return Grid::with_voxel_size(bounds, *options.voxel_size, levels, max_levels_of(options));
  return Grid::around(bounds, levels);
}

ContentDigest initial_digest(const Grid& grid, const Cutouts* cutouts) {
  ContentDigest digest(grid);
  if (cutouts) digest.add(cutout_digest(*cutouts));
  return digest;
}

void ingest(TriangleSource& scene, IngestState& state, TriangleStore& store, TopTree& top,
            const StageContext& context, const AfterPiece& after_piece, const Cutouts* cutouts) {
  Progress& progress = context.build.progress;
  progress.begin_stage("ingest", state.declared_triangles, "triangles");
  progress.resume_at(state.position);
  IngestCounts& counts = state.counts;
  read_pieces<SnappedPiece>(
      scene, state.position, context,
      [&](auto& piece) {
        piece.emplace(state.grid, top, store.record_bytes(), cutouts, context.budget);
      },
      [&](SnappedPiece& piece, uint64_t position) {
        if (piece.too_far())
          throw Error(
              ErrorCode::kLimit,
              "triangle " +
                  std::to_string(counts.triangles + counts.dropped_outside + *piece.too_far()) +
                  " of the scene reaches into the grid and has a vertex 2^32 or more voxels away "
                  "from the grid's low corner: expected less than 2^32 voxels on each axis "
                  "(" +
                  option_text("bounds") + ")");
        const auto add_to_store = [&] {
          context.build.cancel.check();
          counts.expected_voxels += piece.counts().expected_voxels;
          top.add(piece.tally());
          add_records(store, kSceneBin, piece.records());
        };
        add(piece.counts(), counts);
        add_to_store();
        piece.add_late(add_to_store);
        state.digest.add(piece.checksum());
        state.position = position;
        after_piece();
      });
  counts.dropped_invalid = state.declared_triangles - counts.triangles - counts.dropped_outside;
  progress.end_stage();
}

}  // namespace voxdag
