#include "cli/modules/load_module.h"

// Hides these functions from the module, which has functions of the same names.
#pragma GCC visibility push(hidden)

namespace voxdag {

std::unique_ptr<ImageReader> open_avif(std::unique_ptr<PeekedSource> source, MemoryBudget& budget) {
  return cli::module<cli::AvifModule>().open_avif(std::move(source), budget);
}

}  // namespace voxdag

#pragma GCC visibility pop
