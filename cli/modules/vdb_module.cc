#include "cli/modules/modules.h"

namespace voxdag::cli {

const VdbModule voxdag_vdb_module = {
    .head = {}, .write_vdb = &query::write_vdb, .write_nvdb = &query::write_nvdb};

}  // namespace voxdag::cli
