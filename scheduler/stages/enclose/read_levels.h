// Reads the sub-DAG of a cube from an artifact into memory.
#pragma once

#include <optional>

#include "core/dag/space/node_levels.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/geometry/cube.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Selects the part of a cube to read. If a node's edge exceeds 2^whole_log2 voxels, only its
// children in the mask `octants` are read. All children of other nodes are read.
struct LevelClip {
  uint8_t octants = 0xff;
  int whole_log2 = 0;
};

// Reads the nodes in `cube`, which must be inside the cube of one of the artifact's roots. Returns
// nullopt if no voxel is in the cube. With a clip, nodes in the result can be without children.
// Throws OutOfBudget if the memory is too small, Error{kCorrupt} for a damaged artifact.
std::optional<NodeLevels> read_levels(const ArtifactReader& artifact, const Cube& cube,
                                      PooledMemory& memory, const CancelToken& cancel,
                                      const LevelClip& clip = {});

}  // namespace voxdag
