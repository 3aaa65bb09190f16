#include "cli/modules/load_module.h"

// Hides these functions from the module, which has functions of the same names.
#pragma GCC visibility push(hidden)

namespace voxdag::query {

ExportReport write_vdb(const ExportJob& job) {
  return cli::module<cli::VdbModule>().write_vdb(job);
}
ExportReport write_nvdb(const ExportJob& job) {
  return cli::module<cli::VdbModule>().write_nvdb(job);
}

}  // namespace voxdag::query

#pragma GCC visibility pop
