// A seeded sample of a file's colors, and its other attributes, against its scene: some regions of
// 64^3 color cells are baked again from the triangles and the images.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

inline constexpr size_t kSampleRegions = 16;
// A region whose colors are further from the scene's, in dB, is wrong. Those of a built file, and
// other attributes, are equal; a part that `extract` had to encode again is near.
inline constexpr double kMinSamplePsnr = 30;

struct ColorSampleReport {
  uint64_t regions = 0;  // compared
  uint64_t equal = 0;    // of them, byte for byte
  uint64_t cells = 0;    // in them
};

// The file has some attribute, and `grid` is the file's grid. Makes one pass over the scene, which
// must be the scene of the build. Large images go to a scratch file at `scratch_path`. Throws
// Error{kCorrupt} that names the first wrong region, and the errors of TextureSet::prepare().
ColorSampleReport compare_sampled_colors(const voxdag_reader::File& file, const Grid& grid,
                                         FileSystem& files, TriangleSource& scene, uint64_t seed,
                                         const std::string& scratch_path, unsigned threads,
                                         MemoryBudget& budget, Progress& progress,
                                         const CancelToken& cancel);

}  // namespace voxdag::query
