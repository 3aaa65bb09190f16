#include "cli/modules/modules.h"

namespace voxdag::cli {

const ImportModule voxdag_import_module = {.head = {},
                                           .import_scene = &voxdag::import_scene,
                                           .is_imported_scene = &voxdag::is_imported_scene};

}  // namespace voxdag::cli
