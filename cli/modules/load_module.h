// Loads modules (modules.h) and checks them. Thread-safe.
#pragma once

#include <string>

#include "cli/modules/modules.h"

namespace voxdag::cli {

// Loads the library "voxdag-<name>.so" from the folder of modules. Returns the address of its table
// "voxdag_<name>_module", which begins with a ModuleHead. The library remains loaded. Throws
// Error{kIo} if the library cannot be loaded, or if it has another version. The user's input is not
// the cause of these errors.
const void* load_module(const std::string& name);

// Returns a module's table. Loads the module at the first call.
template <class Table>
const Table& module() {
  static const auto& table = *static_cast<const Table*>(load_module(Table::kName));
  return table;
}

}  // namespace voxdag::cli
