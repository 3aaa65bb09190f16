#include "cli/modules/load_module.h"

// Hides these functions from the module, which has functions of the same names.
#pragma GCC visibility push(hidden)

namespace voxdag {

ImportReport import_scene(FileSystem& files, const std::string& input, const std::string& output,
                          uint64_t memory_bytes, const std::function<void(const Warning&)>& warn,
                          Progress& progress, const CancelToken& cancel) {
  return cli::module<cli::ImportModule>().import_scene(files, input, output, memory_bytes, warn,
                                                       progress, cancel);
}

bool is_imported_scene(const ReadableFile& file) {
  return cli::module<cli::ImportModule>().is_imported_scene(file);
}

}  // namespace voxdag

#pragma GCC visibility pop
