// The databases in the data folder: each records the files in some of its folders.
#pragma once

#include <cstdint>
#include <string>

#include "core/db/sqlite.h"

namespace voxdag::server {

struct StoreFormat {
  const char* records;     // "a queue"
  const char* files;       // contents of the folders: "jobs"
  int64_t application_id;  // PRAGMA application_id
  int64_t version;         // PRAGMA user_version
  const char* schema;
  const char* upgrade = nullptr;  // SQL for a database of the version before; null: none exists
};

// Opens a database, creating or upgrading its tables. Throws Error: kInvalidInput if it is new but
// `may_create` is false, because the folders have files, or if it is no store of this kind;
// kUnsupportedVersion.
SqlDatabase open_store(const std::string& path, const StoreFormat& format, bool may_create);

}  // namespace voxdag::server
