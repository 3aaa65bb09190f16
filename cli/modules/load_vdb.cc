#include "cli/modules/load_module.h"

// Hides these functions from the module, which has functions of the same names.
#pragma GCC visibility push(hidden)

namespace voxdag::query {
namespace {

const cli::VdbModule& module() {
  static const auto& table = cli::module_table<cli::VdbModule>("vdb");
  return table;
}

}  // namespace

ExportReport write_vdb(const ExportJob& job) { return module().write_vdb(job); }
ExportReport write_nvdb(const ExportJob& job) { return module().write_nvdb(job); }

}  // namespace voxdag::query

#pragma GCC visibility pop
