#include "server/disk/store.h"

#include "core/base/error.h"

namespace voxdag::server {

SqlDatabase open_store(const std::string& path, const StoreFormat& format, bool may_create) {
  SqlDatabase database(path, SqlDatabase::Mode::kReadWrite);
  const bool fresh = is_new(database);
  const int64_t version = database.integer("PRAGMA user_version");
  if (!fresh && database.integer("PRAGMA application_id") != format.application_id)
    throw Error(ErrorCode::kInvalidInput, path + " is a database of another program: expected " +
                                              format.records + " of voxdag serve");
  if (fresh && !may_create)
    throw Error(ErrorCode::kInvalidInput,
                path + " was missing or is empty: expected " + format.records +
                    " of voxdag serve, because the data folder has folders of " + format.files +
                    ". Restore it from a backup, or start once with --adopt, which creates new "
                    "records of the " +
                    format.files + " that are found");
  const bool is_old = format.upgrade && version == format.version - 1;
  if (!fresh && version != format.version && !is_old)
    throw Error(ErrorCode::kUnsupportedVersion, path + ": the version of this database is " +
                                                    std::to_string(version) + ", expected " +
                                                    std::to_string(format.version));
  database.execute("PRAGMA journal_mode = WAL");
  database.execute("PRAGMA foreign_keys = ON");
  if (fresh || is_old)
    change_schema(database, fresh ? format.schema : format.upgrade, format.application_id,
                  format.version);
  return database;
}

}  // namespace voxdag::server
