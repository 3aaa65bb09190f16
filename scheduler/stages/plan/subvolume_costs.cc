#include "scheduler/stages/plan/subvolume_costs.h"

#include <algorithm>
#include <cmath>

#include "core/backend/backend.h"

namespace voxdag {
namespace {

// All constants are measured on Sponza, the dragon and a terrain of cubes at R = 4096, with
// subvolumes of the default size and with edges of 128 and 64.

// Nodes of all artifacts per node of the global DAG, for subvolumes of at least kLargeOctreeNodes
// octree nodes. This number grows with a power of the number of subvolumes if they are smaller.
constexpr double kArtifactNodesPerUnique = 1.5;
constexpr double kLargeOctreeNodes = 80000;
constexpr double kSharingExponent = 0.13;
// Nodes of an artifact that occur in other artifacts, even if the scene repeats itself.
constexpr double kRepeatedNodes = 20;
// Uncertainty of the nodes that exist only because the subvolumes are small.
constexpr EstimateRange kMoreNodes = {0.25, 1, 1.25};
// Compressed bytes of an artifact per node, and bytes of an artifact's frames and records.
constexpr double kArtifactBytesPerNode = 16;
constexpr EstimateRange kDiskPerSubvolume = {200, 450, 600};
// Bytes of lists, records and partly filled chunks of triangles.
constexpr EstimateRange kMemoryPerSubvolume = {2000, 3000, 5000};
// Occupied cubes per occupied cube of twice the edge.
constexpr double kCubesPerSplit = 4.5;

}  // namespace

double expected_subvolumes(const PreparedScene& scene, uint64_t longest_edge) {
  const uint32_t levels = scene.state.grid.levels;
  double count = 0;
  for (const SubvolumePlan& subvolume : scene.plan) {
    const double edge = static_cast<double>(subvolume.cube.edge_voxels(levels));
    const auto wanted = static_cast<double>(
        longest_edge ? std::max<uint64_t>(longest_edge, kSmallestEdge) : uint64_t{1} << levels);
    count += edge > wanted ? std::pow(kCubesPerSplit, std::log2(edge / wanted)) : 1;
  }
  return count;
}

SubvolumeCosts estimate_subvolumes(double subvolumes, double octree_nodes,
                                   const EstimateRange& dag_nodes) {
  const double octree_part = octree_nodes / std::max(subvolumes, 1.0);
  const double unique = kArtifactNodesPerUnique * dag_nodes.likely;
  const double sharing =
      std::pow(std::max(kLargeOctreeNodes / std::max(octree_part, 1.0), 1.0), kSharingExponent);
  const double nodes = std::min(std::max(unique * sharing, unique + kRepeatedNodes * subvolumes),
                                std::max(octree_nodes, unique));
  SubvolumeCosts costs;
  costs.artifact_nodes = kArtifactNodesPerUnique * dag_nodes + (nodes - unique) * kMoreNodes;
  costs.artifact_bytes =
      kArtifactBytesPerNode * costs.artifact_nodes + subvolumes * kDiskPerSubvolume;
  costs.memory_bytes = subvolumes * kMemoryPerSubvolume;
  return costs;
}

double max_bytes_around_artifacts(double subvolumes) { return kDiskPerSubvolume.high * subvolumes; }

}  // namespace voxdag
