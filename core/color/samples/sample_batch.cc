#include "core/color/samples/sample_batch.h"

namespace voxdag::color {

#ifndef __x86_64__
const SampleKernels* sample_kernels_avx2() { return nullptr; }
#endif

}  // namespace voxdag::color
