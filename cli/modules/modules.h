// A module is a library that the program loads when a command needs it. Modules contain the code
// for libraries that take long to load, because they have many relocations or dependencies. Each
// module consists of one of the files *_module.cc and of static libraries of voxdag. It defines one
// symbol: the table of its functions.
//
// The program links none of these static libraries. The files load_*.cc define their functions
// instead, and call the functions of the tables. Tests and the Python module link the libraries.
#pragma once

#include "core/base/options/option_text.h"
#include "core/image/readers.h"
#include "query/export/export_job.h"
#include "scene/import/import.h"

namespace voxdag::cli {

// The first member of each table.
struct ModuleHead {
  const char* version = VOXDAG_VERSION;
  // A module has its own copy of the static libraries, and therefore its own audience.
  void (*set_audience)(const Audience&) = &voxdag::set_audience;
};

struct VdbModule {
  ModuleHead head;
  decltype(&query::write_vdb) write_vdb;
  decltype(&query::write_nvdb) write_nvdb;
};

struct AvifModule {
  ModuleHead head;
  decltype(&voxdag::open_avif) open_avif;
};

struct ImportModule {
  ModuleHead head;
  decltype(&voxdag::import_scene) import_scene;
  decltype(&voxdag::is_imported_scene) is_imported_scene;
};

extern "C" {
extern const VdbModule voxdag_vdb_module;
extern const AvifModule voxdag_avif_module;
extern const ImportModule voxdag_import_module;
}

}  // namespace voxdag::cli
