// The fields() functions (core/fields/field.h) of the structs that identify a subvolume and its
// artifact. The job store, the checkpoint of the merge and the records of cluster tasks use them.
#pragma once

#include "core/dag/sub_dag.h"
#include "core/format/artifact/artifact.h"
#include "core/geometry/cube.h"

namespace voxdag {

template <class Visitor>
void fields(Visitor& visit, Cube& cube) {
  visit("level", cube.level);
  visit("x", cube.position[0]);
  visit("y", cube.position[1]);
  visit("z", cube.position[2]);
}

template <class Visitor>
void fields(Visitor& visit, ArtifactRef& artifact) {
  visit("segment", artifact.segment);
  visit("offset", artifact.offset);
  visit("bytes", artifact.bytes);
  visit("index_offset", artifact.index_offset);
  visit("checksum", artifact.checksum);
}

template <class Visitor>
void fields(Visitor& visit, SubDagSummary& summary) {
  visit("voxels", summary.voxels);
  visit("svo_nodes", summary.svo_nodes);
  visit("dag_nodes", summary.dag_nodes);
  visit("root_hash", summary.root_hash);
  visit("interior", summary.interior);
  visit("disputed", summary.disputed);
}

}  // namespace voxdag
