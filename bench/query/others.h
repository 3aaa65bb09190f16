// The same queries with other libraries. A library that is not installed is reported as missing.
#pragma once

#include <optional>
#include <utility>

#include "bench/query/query_set.h"

namespace voxdag::query {

// A BoolGrid of the set cells; lookups by an accessor, rays by the volume ray intersector, which
// finds the leaf of the tree (8x8x8 cells) that a ray hits first, not the cell; boxes by
// copyToDense() on one thread, counts by the masks of the leaves. Nothing if it is not installed.
std::optional<Timings> measure_openvdb(const DagFile& dag, uint32_t grid_levels,
                                       const QuerySet& queries);
// An OcTree of the set cells; lookups by search(), rays by castRay(), boxes and counts by the
// iterator over the leaves of a box.
std::optional<Timings> measure_octomap(const DagFile& dag, uint32_t grid_levels,
                                       const QuerySet& queries);

using MeasureOther = std::optional<Timings> (*)(const DagFile&, uint32_t, const QuerySet&);
inline constexpr std::pair<MeasureOther, const char*> kOtherLibraries[] = {
    {measure_openvdb, "OpenVDB"}, {measure_octomap, "OctoMap"}};

}  // namespace voxdag::query
