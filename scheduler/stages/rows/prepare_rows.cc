#include "scheduler/stages/rows/prepare_rows.h"

#include <optional>
#include <vector>

#include "scheduler/stages/rows/rows_stage.h"

namespace voxdag {

void prepare_rows(BuildJob& job, std::span<const StoredSubvolume> planned,
                  std::span<const BinId> bins, const TriangleStore& triangles) {
  if (!job.rows || job.rows->is_ready()) return;
  if (planned.size() != job.store->leaves().size()) job.has_rows();  // throws Error{kCorrupt}
  std::vector<PlannedCube> cubes;
  for (size_t i = 0; i < planned.size(); ++i) cubes.push_back({planned[i].cube, bins[i]});
  std::optional<OutsideRows> outside;
  if (job.spec.geometry.bounds) {
    outside.emplace(job.report.grid.levels, job.budget);
    outside->read(job.scene.open(), job.report.grid, job.stage());
    job.scene.close();
  }
  compute_rows(*job.rows, cubes, triangles, outside ? &*outside : nullptr, job.work.row_sums_path(),
               job.stage());
  job.clock.finish("rows");
}

}  // namespace voxdag
