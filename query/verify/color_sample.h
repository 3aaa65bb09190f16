// Compares a random sample of a file's colors and other attributes with the scene from which the
// file was built. The sample consists of some regions of 64^3 color cells, which are baked again
// from the scene's triangles and images. A seed determines the sample.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/color/cutouts/cutouts.h"
#include "core/format/global/voxdag_reader.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

inline constexpr size_t kSampleRegions = 16;
// Minimum PSNR, in dB, between a region's colors in the file and the colors baked from the scene. A
// build's file has exactly the baked colors and attributes. In a file written by `extract`, the
// colors of regions that it had to encode again differ slightly.
inline constexpr double kMinSamplePsnr = 30;

struct ColorSampleReport {
  uint64_t regions = 0;  // compared regions
  uint64_t equal = 0;    // regions that are equal byte for byte
  uint64_t cells = 0;    // cells in the compared regions
};

// Compares the attributes of `file`, which must have at least one, with `scene`, which must be the
// scene of the build. `grid` is the file's grid. Makes one pass over the scene. Stores large images
// in a scratch file at `scratch_path`. `cutouts`: the invisible texels, if the build has left out
// invisible parts of the surface; otherwise null. Throws Error{kCorrupt}, whose message names the
// first wrong region, and the errors of TextureSet::prepare().
ColorSampleReport compare_sampled_colors(const voxdag_reader::File& file, const Grid& grid,
                                         FileSystem& files, TriangleSource& scene, uint64_t seed,
                                         const std::string& scratch_path, unsigned threads,
                                         MemoryBudget& budget, Progress& progress,
                                         const CancelToken& cancel,
                                         const Cutouts* cutouts = nullptr);

}  // namespace voxdag::query
