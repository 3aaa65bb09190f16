// Computes the colors of a triangle in a batch of cells of which it covers columns, in code for
// processors with AVX2. The results equal those of CoveredSurface and SurfaceLook
// (core/color/rule/), which compute one cell at a time and accept all triangles.
//
// A batch passes through two functions, so that the texels' memory is prefetched between them:
//
//     find_texels()   means of columns -> texture coordinates -> positions of four texels
//     blend()         texels -> color, times weight
//
// Kernels are compiled for AVX2. So they call no inline functions of shared headers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/color/samples/tiled_level.h"
#include "core/color/surface.h"

namespace voxdag::color {

// The parameters of a triangle. All of its points have alpha 255, except where blend() reports
// that alpha is not full.
struct SampledSurface {
  // Element 0 is for the barycentric coordinate of vertex 1, and element 1 for vertex 2. The sum of
  // its edge function over n columns is edge[0] x + edge[1] y + edge[2] n, where x and y are the
  // sums of the columns' coordinates (SampleBatch). All products and sums are integers below 2^53,
  // so that doubles are exact.
  double edges[2][3];
  double scale;            // barycentric coordinate per unit of the edge function
  uint32_t column_weight;  // weight per column
  int64_t texture[2];      // texture coordinates of vertex 0
  int32_t change[2][2];    // [axis][i]: change from vertex 0 to vertex i + 1, below 2^30
  Wrap wrap[2];
  TiledLevel level;
  bool has_tint;     // if false, the tint changes no texel
  uint32_t tint[4];  // factors of the channels; kFullIntensity stands for 1
};

struct SampleBatch {
  static constexpr size_t kMaxCells = 32;
  // Covered columns of each cell: their number, the sums of their coordinates P and Q
  // (cell_triangle.h), relative to columns that SampledSurface::edges define, and 1 / count.
  alignas(64) int32_t count[kMaxCells], x[kMaxCells], y[kMaxCells];
  double share[kMaxCells];
  // Results of find_texels(). The texels of a cell have the positions rows[i] + columns[j] in
  // TiledLevel::texels. The fractions are the weights of the second column and the second row, in
  // units of 1/256.
  uint64_t rows[2][kMaxCells], columns[2][kMaxCells], fractions[2][kMaxCells];
  // Result of blend(): the color times the weight, in the format of a CellWeight of kind `opaque`.
  uint32_t weighted[kMaxCells][4];
};

struct SampleKernels {
  // `cells` is the number of cells of the batch. All cells up to the next multiple of four must be
  // initialized.
  void (*find_texels)(const SampledSurface& surface, SampleBatch& batch, size_t cells);
  // Returns the cells for which the mean alpha of the four texels is not full, as a bit mask.
  uint32_t (*blend)(const SampledSurface& surface, SampleBatch& batch, size_t cells);
};

// Returns the AVX2 version; null if this version was not built or if this machine cannot run it.
const SampleKernels* sample_kernels_avx2();

}  // namespace voxdag::color
