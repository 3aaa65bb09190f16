#include "scheduler/stages/plan/pilots.h"

#include <algorithm>
#include <optional>

#include "core/base/clock.h"
#include "core/dag/sub_dag.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/plan/pilot_triangles.h"
#include "scheduler/stages/plan/solid_pilot.h"

namespace voxdag {
namespace {

// Returns the number of grid levels of the finer of the two pilots. Large builds are extrapolated
// from 13 levels (8192^3 voxels). A pilot with 13 levels takes one or two seconds. If the triangles
// do not fit in memory on this grid, they are read again for a coarser pilot. A pilot that fills
// enclosed space takes ten times as long, so it has a coarser grid.
uint32_t pilot_levels_of(uint32_t grid_levels, SolidName solid) {
  if (solid == SolidName::kEnclosed) return kEnclosedPilotLevels;
  return std::clamp<uint32_t>(grid_levels - std::min<uint32_t>(grid_levels, 2), 12, 13);
}

class CountingSink : public SubDagSink {
 public:
  void bricks(const BrickLevelView& level) override { words += 2 * level.masks.size(); }
  void nodes(const NodeLevelView& level) override {
    words += level.masks.size() + level.children.size();
  }
  uint64_t words = 0;
};

// Runs the pilots of a scene. The scene must outlive this object.
class PilotBuilder {
 public:
  PilotBuilder(const GeometryOptions& options, const PreparedScene& scene, BuildScene& source,
               const StageContext& context)
      : options_(options),
        scene_(scene),
        source_(source),
        context_(context),
        share_(MemoryPlan::pilot_bytes(context.budget.available()), &context.budget),
        triangle_share_(share_.limit() / 2, &share_),
        backend_(make_cpu_backend()) {}

  std::vector<PilotCounts> run() {
    const uint32_t grid_levels = scene_.state.grid.levels;
    const uint32_t finest = std::min(pilot_levels_of(grid_levels, options_.solid), grid_levels);
    const uint32_t coarsest = std::max<uint32_t>(kMinGridLevels, finest - std::min(finest, 4u));
    const bool keeps_equal = solid_rule_of(options_) != SolidRule::kNone;
    std::vector<PilotCounts> pilots;
    for (uint32_t levels = finest; levels >= coarsest && pilots.size() < 2; --levels) {
      if (!triangles_ || !triangles_->is_complete()) {
        triangles_.emplace(*scene_.triangles, grid_levels - levels, keeps_equal, triangle_share_,
                           context_);
        triangle_levels_ = levels;
      }
      if (!triangles_->is_complete()) continue;
      if (const auto pilot = try_build(levels)) pilots.insert(pilots.begin(), *pilot);
    }
    return pilots;
  }

 private:
  // Builds a pilot on a grid with `levels` levels. Returns nullopt if the pilot does not fit the
  // budget.
  std::optional<PilotCounts> try_build(uint32_t levels) try {
    const double start = thread_cpu_seconds();
    PilotCounts counts;
    counts.levels = levels;
    const auto stream = triangles_->open(triangle_levels_ - levels);
    const bool is_built = options_.solid == SolidName::kEnclosed ? build_enclosed(*stream, counts)
                                                                 : build(*stream, counts);
    if (!is_built) return std::nullopt;
    counts.cpu_s = thread_cpu_seconds() - start + triangles_->cpu_s();
    return counts;
  } catch (const OutOfBudget&) {
    return std::nullopt;
  }

  bool build(TriangleStream& stream, PilotCounts& counts) {
    std::optional<PilotRows> rows;
    if (const SolidRule rule = solid_rule_of(options_); rule != SolidRule::kNone) {
      rows.emplace(share_, counts.levels);
      rows->read(rule, stream, options_.bounds ? &source_ : nullptr, scene_.state.grid, context_);
      counts.rows = rows->counts();
    }
    CountingSink sink;
    SubDagSummary summary;
    const SubvolumeTask task{counts.levels, Cube{}, 64, rows ? &rows->entry() : nullptr,
                             options_.rule()};
    if (!build_task(task, stream, sink, summary)) return false;
    counts.interior = static_cast<double>(summary.interior);
    counts.disputed = static_cast<double>(summary.disputed);
    add(summary, sink, counts);
    return true;
  }

  bool build_enclosed(TriangleStream& stream, PilotCounts& counts) {
    PagePool pool;
    PooledMemory memory{share_, pool};
    ShellLevels shell(memory);
    SubDagSummary summary;
    if (!build_task({counts.levels, Cube{}, 64}, stream, shell, summary)) return false;
    if (summary.empty()) return true;
    const uint64_t shell_voxels = summary.voxels;
    CountingSink sink;
    Grid grid = scene_.state.grid;
    grid.levels = counts.levels;
    summary = fill_pilot(memory, shell.finish(), seed_of(options_, grid),
                         pilot_radius(counts.levels), counts.levels, sink);
    counts.interior = static_cast<double>(summary.voxels - shell_voxels);
    add(summary, sink, counts);
    return true;
  }

  // Converts the build's radius to voxels of a pilot with 2^levels voxels per edge, and rounds it.
  uint32_t pilot_radius(uint32_t levels) const {
    const uint64_t edge = uint64_t{1} << levels, scale = options_.resolution / edge;
    return static_cast<uint32_t>(std::min((options_.radius + scale / 2) / scale, edge - 1));
  }

  bool build_task(const SubvolumeTask& task, TriangleStream& stream, SubDagSink& sink,
                  SubDagSummary& summary) {
    return backend_->build(task, stream, share_, context_.build.cancel, sink, summary) ==
           BuildOutcome::kBuilt;
  }

  static void add(const SubDagSummary& summary, const CountingSink& sink, PilotCounts& counts) {
    counts.voxels = static_cast<double>(summary.voxels);
    counts.svo_nodes = static_cast<double>(summary.svo_nodes);
    counts.dag_nodes = static_cast<double>(summary.dag_nodes);
    counts.file_bytes = 4.0 * static_cast<double>(sink.words);
  }

  const GeometryOptions& options_;
  const PreparedScene& scene_;
  BuildScene& source_;
  const StageContext& context_;
  MemoryBudget share_, triangle_share_;
  const std::unique_ptr<Backend> backend_;
  std::optional<PilotTriangles> triangles_;
  uint32_t triangle_levels_ = 0;  // levels of the grid of triangles_
};

}  // namespace

std::vector<PilotCounts> build_pilots(const GeometryOptions& options, const PreparedScene& scene,
                                      BuildScene& source, const StageContext& context) {
  return PilotBuilder(options, scene, source, context).run();
}

}  // namespace voxdag
