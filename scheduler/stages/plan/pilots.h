// Pilots: builds of the complete scene on coarser grids, each as one subvolume. Their output is
// counted and discarded.
#pragma once

#include <cstdint>
#include <vector>

#include "scheduler/solid/solid_rows.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/ingest/ingest_stage.h"
#include "scheduler/state/build_scene.h"

namespace voxdag {

struct PilotCounts {
  uint32_t levels = 0;  // levels of the pilot's grid
  double voxels = 0;
  double svo_nodes = 0;
  double dag_nodes = 0;
  double file_bytes = 0;  // size of the pilot's global file, which is not written
  double cpu_s = 0;
  // Only for solids: interior voxels (set voxels that no triangle touches), disputed voxels among
  // them (SubDagSummary in core/dag/sub_dag.h), and the counts of sample rows.
  double interior = 0;
  double disputed = 0;
  RowCounts rows;
};

// Runs pilots at the two finest resolutions at which the triangles and the tables fit the budget.
// Returns the coarser pilot first. Returns one pilot or none if they fit at fewer than two of the
// tried resolutions. The pilots run on this thread.
std::vector<PilotCounts> build_pilots(const GeometryOptions& options, const PreparedScene& scene,
                                      BuildScene& source, const StageContext& context);

}  // namespace voxdag
