// The partition stage: copies the scene's triangles to one bin for each subvolume.
//
// Resume rule: with a durable store the partition continues at the last checkpoint.
#pragma once

#include <span>
#include <vector>

#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/ingest/ingest_stage.h"

namespace voxdag {

// Partitions the triangles into the subvolumes at `cubes`. Returns the bin of each subvolume, in
// the same order. Throws DamagedTriangles if triangles are missing.
std::vector<BinId> partition_prepared(PreparedScene& scene, std::span<const Cube> cubes,
                                      IngestCheckpoint& checkpoint, const StageContext& context);

}  // namespace voxdag
