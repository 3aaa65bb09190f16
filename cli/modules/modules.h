// A module is a library that the program loads when a command needs it. Modules contain the code
// that uses certain other libraries. These libraries take long to load, because they have many
// relocations or dependencies. Each module consists of one of the files *_module.cc and of static
// libraries of voxdag.
//
// The program is not linked with the code in modules. The files load_*.cc define its functions
// instead. They call the functions in the module's table. Tests and the Python module are linked
// with the code.
//
// If the program and a module contain the same function, the module also uses the program's
// function (visible.map). So the two share all state, such as the list of temporary files that a
// signal removes.
#pragma once

#include "client/http/http_connection.h"
#include "core/image/readers.h"
#include "query/export/export_job.h"
#include "scene/import/import.h"

namespace voxdag::cli {

// The first member of each table.
struct ModuleHead {
  const char* version = VOXDAG_VERSION;
};

struct VdbModule {
  static constexpr const char* kName = "vdb";
  ModuleHead head;
  decltype(&query::write_vdb) write_vdb;
  decltype(&query::write_nvdb) write_nvdb;
};

struct AvifModule {
  static constexpr const char* kName = "avif";
  ModuleHead head;
  decltype(&voxdag::open_avif) open_avif;
};

struct ImportModule {
  static constexpr const char* kName = "import";
  ModuleHead head;
  decltype(&voxdag::import_scene) import_scene;
  decltype(&voxdag::is_imported_scene) is_imported_scene;
};

struct HttpModule {
  static constexpr const char* kName = "http";
  ModuleHead head;
  decltype(&client::open_http) open_http;
  decltype(&client::supports_https) supports_https;
};

extern "C" {
extern const VdbModule voxdag_vdb_module;
extern const AvifModule voxdag_avif_module;
extern const ImportModule voxdag_import_module;
extern const HttpModule voxdag_http_module;
}

}  // namespace voxdag::cli
