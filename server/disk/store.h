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
  // SQL that upgrades a database of the previous version; null if there was no previous version.
  const char* upgrade = nullptr;
};

// Opens a database, creating or upgrading its tables. Throws Error: kInvalidInput if it is not a
// store of this kind, or if it is new and `may_create` is false because the folders have files;
// kUnsupportedVersion.
SqlDatabase open_store(const std::string& path, const StoreFormat& format, bool may_create);

}  // namespace voxdag::server
