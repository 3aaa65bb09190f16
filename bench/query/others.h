// Measures the queries of a QuerySet with other libraries.
#pragma once

#include <optional>
#include <utility>

#include "bench/query/query_set.h"

namespace voxdag::query {

// Measures a BoolGrid of the set cells. Lookups use an accessor. Rays use the volume ray
// intersector, which finds the first leaf of the tree (8x8x8 cells) that a ray hits, not the cell.
// Boxes use copyToDense() on one thread, and counts use the masks of the leaves. Returns nothing if
// OpenVDB is not installed.
std::optional<Timings> measure_openvdb(const DagFile& dag, uint32_t grid_levels,
                                       const QuerySet& queries);
// Measures an OcTree of the set cells. Lookups use search(), rays castRay(), boxes and counts the
// iterator over the leaves of a box.
std::optional<Timings> measure_octomap(const DagFile& dag, uint32_t grid_levels,
                                       const QuerySet& queries);

using MeasureOther = std::optional<Timings> (*)(const DagFile&, uint32_t, const QuerySet&);
inline constexpr std::pair<MeasureOther, const char*> kOtherLibraries[] = {
    {measure_openvdb, "OpenVDB"}, {measure_octomap, "OctoMap"}};

}  // namespace voxdag::query
