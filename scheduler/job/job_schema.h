// The job store's tables, and the migrations from earlier versions.
#pragma once

#include <cstdint>
#include <string>

#include "core/db/sqlite.h"

namespace voxdag {

inline constexpr int64_t kSchemaVersion = 3;

// Creates the tables in an empty database, or migrates those of an earlier version, in one
// transaction. Throws Error{kCorrupt} for a damaged database, Error{kInvalidInput} for one that
// is not a job store, Error{kUnsupportedVersion} for one of a later version.
void prepare_schema(SqlDatabase& database, const std::string& path);
// Checks a store that is only read: it may have any version up to this one. Throws likewise.
void check_schema(SqlDatabase& database, const std::string& path);

}  // namespace voxdag
