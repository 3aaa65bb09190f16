// Opens the databases of the data folder. Each database lists the files in some folders of the data
// folder: queue.db the jobs, scenes.db the scenes.
#pragma once

#include <cstdint>
#include <string>

#include "core/db/sqlite.h"

namespace voxdag::server {

struct StoreFormat {
  const char* records;     // name of the database for messages, such as "the queue of jobs"
  const char* files;       // name of the listed items for messages, such as "jobs"
  int64_t application_id;  // PRAGMA application_id
  int64_t version;         // PRAGMA user_version
  const char* schema;
  // SQL that upgrades a database of the previous version; null if there was no previous version.
  const char* upgrade = nullptr;
};

// Opens a database. Creates or upgrades its tables. Throws Error{kInvalidInput} for a database of
// another kind, and for a new database unless `may_create` is true. (If the folders already have
// files, a lost database may have listed them, so no new one may be created.) Throws
// Error{kUnsupportedVersion} unless the version is format.version, or the previous version and
// format.upgrade is not null.
SqlDatabase open_store(const std::string& path, const StoreFormat& format, bool may_create);

}  // namespace voxdag::server
