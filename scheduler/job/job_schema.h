// The job store's tables, and how a store of an earlier version becomes one of this.
#pragma once

#include <cstdint>
#include <string>

#include "core/db/sqlite.h"

namespace voxdag {

inline constexpr int64_t kSchemaVersion = 3;

// Makes the tables of an empty database, or brings those of an earlier version up to date: all of
// it or nothing. Throws Error{kCorrupt} for a damaged database, Error{kInvalidInput} for one that
// is not ours, Error{kUnsupportedVersion} for one of a later version.
void prepare_schema(SqlDatabase& database, const std::string& path);
// For those who only read: any version that there was will do.
void check_schema(SqlDatabase& database, const std::string& path);

}  // namespace voxdag
