// Estimates the cost of a build's colors and other attributes, without its geometry.
#pragma once

#include <cstdint>

#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/plan/estimate_range.h"
#include "scheduler/state/build_scene.h"

namespace voxdag {

struct ColorEstimate {
  EstimateRange cells;           // cells of the color grid that have a color
  EstimateRange file_bytes;      // bytes of the sections in the global file
  EstimateRange artifact_bytes;  // bytes of colors in the work folder until the file is complete
  EstimateRange spill_bytes;     // bytes of surfaces and image pyramids that do not fit in memory
  EstimateRange memory_bytes;
  EstimateRange cpu_s;

  EstimateRange disk_bytes() const { return file_bytes + artifact_bytes + spill_bytes; }
};

// Estimates the cost for `options` with a color resolution. Opens the scene and reads the headers
// of its images.
ColorEstimate estimate_colors(const GeometryOptions& options, BuildScene& scene,
                              const EstimateRange& cells, uint64_t triangles,
                              const StageContext& context);

}  // namespace voxdag
