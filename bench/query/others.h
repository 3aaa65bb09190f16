// Measures the queries of a QuerySet with other libraries.
#pragma once

#include <optional>
#include <utility>

#include "bench/query/query_set.h"

namespace voxdag::query {

// Measures an OpenVDB BoolGrid that contains the set cells. Returns nullopt if OpenVDB is not
// installed.
//   Lookups use an accessor.
//   Rays use the volume ray intersector, which finds the first leaf of the tree (8x8x8 cells) that
//   a ray hits, not the first cell.
//   Boxes use copyToDense() on one thread. Counts use the masks of the leaves.
std::optional<Timings> measure_openvdb(const DagFile& dag, uint32_t grid_levels,
                                       const QuerySet& queries);
// Measures an OctoMap OcTree that contains the set cells. Returns nullopt if OctoMap is not
// installed. Lookups use search(), and rays use castRay(). Boxes and counts iterate over the leaves
// in a box.
std::optional<Timings> measure_octomap(const DagFile& dag, uint32_t grid_levels,
                                       const QuerySet& queries);

using MeasureOther = std::optional<Timings> (*)(const DagFile&, uint32_t, const QuerySet&);
inline constexpr std::pair<MeasureOther, const char*> kOtherLibraries[] = {
    {measure_openvdb, "OpenVDB"}, {measure_octomap, "OctoMap"}};

}  // namespace voxdag::query
