#include "cli/modules/load_module.h"

#include <dlfcn.h>

#include <string_view>

#include "core/base/error.h"

namespace voxdag::cli {
namespace {

// Folders of the modules, relative to the program's folder: in a build folder and as installed.
// dlopen() replaces "$ORIGIN" by the program's folder. A RUNPATH would need no such names, but the
// program would start later, because it would look for every library in these folders first.
constexpr const char* kFolders[] = {"lib/voxdag", VOXDAG_INSTALLED_MODULES};

}  // namespace

const void* load_module(const std::string& name) {
  const std::string file = "voxdag-" + name + ".so";
  void* library = nullptr;
  std::string problem;
  for (const char* folder : kFolders) {
    library = dlopen((std::string("$ORIGIN/") + folder + "/" + file).c_str(), RTLD_NOW);
    if (library) break;
    problem = dlerror();
  }
  if (!library)
    throw Error(ErrorCode::kIo,
                "cannot load a part of voxdag: " + problem + ", expected " + file +
                    " from the same installation as the program, and the libraries that it uses");
  const void* const table = dlsym(library, ("voxdag_" + name + "_module").c_str());
  const auto* const head = static_cast<const ModuleHead*>(table);
  if (!head || head->version != std::string_view(VOXDAG_VERSION))
    throw Error(ErrorCode::kIo, file + " belongs to " +
                                    (head ? std::string("voxdag ") + head->version
                                          : std::string("another program")) +
                                    ", expected the file of voxdag " VOXDAG_VERSION);
  // The messages of the module then have the same words as the messages of this program.
  head->set_audience(audience());
  return table;
}

}  // namespace voxdag::cli
