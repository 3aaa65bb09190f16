// The SQLite tables of a job store.
#pragma once

#include <string>

#include "core/db/sqlite.h"

namespace voxdag {

// Throws Error{kInvalidInput} if the database is not a job store, or Error{kUnsupportedVersion} if
// the job store has another version.
void check_job_schema(SqlDatabase& database, const std::string& path);
// Creates the tables in an empty database, in one transaction. Checks the version and the integrity
// of any other database. Throws Error.
void prepare_job_schema(SqlDatabase& database, const std::string& path);

}  // namespace voxdag
