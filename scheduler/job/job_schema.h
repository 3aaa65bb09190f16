// The tables of the job store.
#pragma once

#include <cstdint>
#include <string>

#include "core/db/sqlite.h"

namespace voxdag {

inline constexpr int64_t kSchemaVersion = 4;

// Creates the tables in an empty database, in one transaction. Throws Error{kCorrupt} for a damaged
// database, Error{kInvalidInput} for one that is not a job store, Error{kUnsupportedVersion} for
// one of another version.
void prepare_schema(SqlDatabase& database, const std::string& path);
// Checks a store that is only read. Throws likewise.
void check_schema(SqlDatabase& database, const std::string& path);

}  // namespace voxdag
