// Opens the databases of the data folder. Each database lists the files in some folders of the data
// folder: queue.db lists the jobs, and scenes.db lists the scenes.
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

// Opens a database. Creates its tables if it is new, and upgrades the tables of the previous
// version if format.upgrade is not null. Throws Error{kUnsupportedVersion} for other versions, and
// Error{kInvalidInput} if the database belongs to another program, or is new and `may_create` is
// false. Unless the operator gave --adopt, callers set `may_create` to false if the data folder has
// files that this database should list: then an earlier database, which listed these files, was
// probably lost.
SqlDatabase open_store(const std::string& path, const StoreFormat& format, bool may_create);

}  // namespace voxdag::server
