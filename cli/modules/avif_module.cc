#include "cli/modules/modules.h"

namespace voxdag::cli {

const AvifModule voxdag_avif_module = {.head = {}, .open_avif = &voxdag::open_avif};

}  // namespace voxdag::cli
