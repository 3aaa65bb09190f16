#include "cli/modules/load_module.h"

#include <dlfcn.h>

#include <filesystem>
#include <string_view>

#include "core/base/error.h"

namespace voxdag::cli {
namespace {

namespace fs = std::filesystem;

// The folders of modules, relative to the program's folder: in a build folder, and as installed.
constexpr const char* kFolders[] = {"lib/voxdag", VOXDAG_INSTALLED_MODULES};

// Returns the path of a module. Throws Error{kIo} if there is no such file.
std::string find_module(const std::string& file) {
  const fs::path program = fs::read_symlink("/proc/self/exe").parent_path();
  for (const char* folder : kFolders)
    if (fs::path path = program / folder / file; fs::exists(path)) return path;
  throw Error(ErrorCode::kIo, "the installation of voxdag is incomplete: expected the file " +
                                  (program / kFolders[1] / file).lexically_normal().string());
}

}  // namespace

const void* load_module(const std::string& name) {
  const std::string path = find_module("voxdag-" + name + ".so");
  void* const library = dlopen(path.c_str(), RTLD_NOW);
  if (!library)
    throw Error(ErrorCode::kIo, "cannot load a part of voxdag: " + std::string(dlerror()) +
                                    "; expected all libraries that it needs");
  const void* const table = dlsym(library, ("voxdag_" + name + "_module").c_str());
  const char* const version = table ? static_cast<const ModuleHead*>(table)->version : "unknown";
  if (version != std::string_view(VOXDAG_VERSION))
    throw Error(ErrorCode::kIo, path + " has the version " + version +
                                    ": expected the program's version, " VOXDAG_VERSION);
  return table;
}

}  // namespace voxdag::cli
