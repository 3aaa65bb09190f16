#include "cli/modules/load_module.h"

namespace voxdag {

std::unique_ptr<ImageReader> open_avif(std::unique_ptr<PeekedSource> source, MemoryBudget& budget) {
  static const auto& table = cli::module_table<cli::AvifModule>("avif");
  return table.open_avif(std::move(source), budget);
}

}  // namespace voxdag
