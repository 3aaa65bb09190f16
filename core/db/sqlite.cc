#include "core/db/sqlite.h"

#include <sqlite3.h>
#include <sys/stat.h>
#include <sys/statvfs.h>

#include <cerrno>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/io/file_system.h"

namespace voxdag {
namespace {

// True if the file system of the file at `path` cannot create more files.
bool has_no_inodes(const std::string& path) {
  struct statvfs s {};
  return statvfs(parent_directory(path).c_str(), &s) == 0 && s.f_files > 0 && s.f_favail == 0;
}

// Throws Error{kInvalidInput} if anything other than a regular file exists at `path`, such as a
// symbolic link or a pipe, because voxdag did not create it. The other files of a database, such as
// its log, need no check, because SQLite does not follow links to them.
void refuse_foreign(const std::string& path) {
  struct stat found {};
  if (lstat(path.c_str(), &found) == 0 && !S_ISREG(found.st_mode))
    throw Error(ErrorCode::kInvalidInput,
                path + " is not a regular file: expected a database that voxdag wrote");
}

// Returns the path of a database's file; "in memory" if it has no file.
std::string file_name(sqlite3* database) {
  const char* const name = sqlite3_db_filename(database, "main");
  return name && *name ? name : "in memory";
}

[[noreturn]] void fail(sqlite3* database, int result, std::string path = "") {
  ErrorCode code = ErrorCode::kIo;
  std::string message = database ? sqlite3_errmsg(database) : sqlite3_errstr(result);
  if (const char* name = database ? sqlite3_db_filename(database, "main") : nullptr; name && *name)
    path = name;
  switch (result & 0xff) {
    case SQLITE_FULL:
      code = ErrorCode::kNoSpace;
      break;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
    case SQLITE_CONSTRAINT:
    case SQLITE_MISMATCH:
      code = ErrorCode::kCorrupt;
      break;
    case SQLITE_NOMEM:
      code = ErrorCode::kOutOfMemory;
      break;
    default:
      break;
  }
  const bool has_reason = (result & 0xff) == SQLITE_IOERR || (result & 0xff) == SQLITE_CANTOPEN;
  const int reason = database && has_reason ? sqlite3_system_errno(database) : 0;
  if (reason != 0) {
    if (code_of_errno(reason) == ErrorCode::kNoSpace) code = ErrorCode::kNoSpace;
    message += ": " + errno_text(reason);
  } else if (database && sqlite3_extended_errcode(database) == SQLITE_IOERR_SHMSIZE) {
    // SQLite could not enlarge the file with the index of its log (-shm). It does not keep the
    // errno value, so the message assumes that the limit of file sizes was exceeded.
    code = ErrorCode::kNoSpace;
    message += ": " + errno_text(EFBIG);
  }
  // If SQLite cannot create a file because no inodes are left, it tries to open the file without
  // creating it. It then reports only that the file does not exist.
  if ((result & 0xff) == SQLITE_CANTOPEN && has_no_inodes(path)) {
    code = ErrorCode::kNoSpace;
    message += ": the file system has no inodes left";
  }
  throw Error(code, "database " + path + ": SQLite reports: " + message);
}

}  // namespace

void SqlStatement::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

SqlStatement::SqlStatement(sqlite3* database, std::string_view sql) : database_(database) {
  sqlite3_stmt* statement = nullptr;
  const int result =
      sqlite3_prepare_v2(database, sql.data(), static_cast<int>(sql.size()), &statement, nullptr);
  if (result != SQLITE_OK) fail(database, result);
  statement_.reset(statement);
}

SqlStatement& SqlStatement::bind(int parameter, int64_t value) {
  const int result = sqlite3_bind_int64(statement_.get(), parameter + 1, value);
  if (result != SQLITE_OK) fail(database_, result);
  return *this;
}

SqlStatement& SqlStatement::bind(int parameter, double value) {
  const int result = sqlite3_bind_double(statement_.get(), parameter + 1, value);
  if (result != SQLITE_OK) fail(database_, result);
  return *this;
}

SqlStatement& SqlStatement::bind(int parameter, std::string_view text) {
  const int result = sqlite3_bind_text(statement_.get(), parameter + 1, text.data(),
                                       static_cast<int>(text.size()), SQLITE_TRANSIENT);
  if (result != SQLITE_OK) fail(database_, result);
  return *this;
}

SqlStatement& SqlStatement::bind(int parameter, std::span<const std::byte> bytes) {
  // SQLite would store a null pointer as NULL. So an empty span, whose data() may be null, is bound
  // as an empty blob.
  const void* data = bytes.empty() ? static_cast<const void*>("") : bytes.data();
  const int result =
      sqlite3_bind_blob64(statement_.get(), parameter + 1, data, bytes.size(), SQLITE_STATIC);
  if (result != SQLITE_OK) fail(database_, result);
  return *this;
}

bool SqlStatement::step() {
  const int result = sqlite3_step(statement_.get());
  if (result == SQLITE_ROW) return true;
  if (result != SQLITE_DONE) fail(database_, result);
  return false;
}

void SqlStatement::run() {
  step();
  reset();
}

void SqlStatement::reset() { sqlite3_reset(statement_.get()); }

bool SqlStatement::is_null(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}

int64_t SqlStatement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

double SqlStatement::real(int column) const {
  return sqlite3_column_double(statement_.get(), column);
}

std::string SqlStatement::text(int column) const {
  const auto* bytes = sqlite3_column_text(statement_.get(), column);
  const int size = sqlite3_column_bytes(statement_.get(), column);
  return bytes ? std::string(reinterpret_cast<const char*>(bytes), static_cast<size_t>(size)) : "";
}

std::vector<std::byte> SqlStatement::bytes(int column) const {
  const auto* bytes = static_cast<const std::byte*>(sqlite3_column_blob(statement_.get(), column));
  const int size = sqlite3_column_bytes(statement_.get(), column);
  return bytes ? std::vector<std::byte>(bytes, bytes + size) : std::vector<std::byte>();
}

void SqlDatabase::Close::operator()(sqlite3* database) const { sqlite3_close_v2(database); }

SqlDatabase::SqlDatabase(const std::string& path, Mode mode, int busy_ms) {
  refuse_foreign(path);
  sqlite3* database = nullptr;
  const int flags =
      mode == Mode::kReadOnly ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  const int result = sqlite3_open_v2(path.c_str(), &database, flags, nullptr);
  handle_.reset(database);
  if (result != SQLITE_OK) fail(database, result, path);
  sqlite3_busy_timeout(database, busy_ms);
}

SqlDatabase SqlDatabase::in_memory(const std::string& path) {
  SqlDatabase database;
  sqlite3* handle = nullptr;
  const int result = sqlite3_open(":memory:", &handle);
  database.handle_.reset(handle);
  if (result != SQLITE_OK) fail(handle, result, path + " (in memory)");
  return database;
}

void SqlDatabase::copy_to(SqlDatabase& target) {
  sqlite3* const to = target.handle_.get();
  sqlite3_backup* const copy = sqlite3_backup_init(to, "main", handle_.get(), "main");
  if (!copy) fail(to, sqlite3_errcode(to));
  sqlite3_backup_step(copy, -1);
  // Also returns the error of the step, if any.
  const int result = sqlite3_backup_finish(copy);
  if (result != SQLITE_OK) fail(to, result);
}

void SqlDatabase::execute(const std::string& sql) {
  const int result = sqlite3_exec(handle_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (result != SQLITE_OK) fail(handle_.get(), result);
}

int64_t SqlDatabase::integer(const std::string& sql) {
  SqlStatement statement = prepare(sql);
  if (!statement.step())
    throw Error(ErrorCode::kCorrupt, "database " + file_name(handle_.get()) +
                                         ": a query returned no row, expected one: " + sql);
  return statement.integer(0);
}

SqlTransaction::SqlTransaction(SqlDatabase& database, Durable durable) : database_(database) {
  // In WAL mode, FULL syncs the log at each commit, and NORMAL does not. A commit with FULL also
  // syncs the changes of all earlier commits with NORMAL.
  database_.execute(durable == Durable::kNow ? "PRAGMA synchronous = FULL"
                                             : "PRAGMA synchronous = NORMAL");
  database_.execute("BEGIN IMMEDIATE");
}

SqlTransaction::~SqlTransaction() {
  if (!open_) return;
  try {
    database_.execute("ROLLBACK");
  } catch (const Error&) {
    // The connection is closed, or the transaction is already rolled back. Nothing was committed in
    // either case.
  }
}

void SqlTransaction::commit() {
  database_.execute("COMMIT");
  open_ = false;
}

bool is_new(SqlDatabase& database) {
  return database.integer("PRAGMA application_id") == 0 &&
         database.integer("PRAGMA user_version") == 0 &&
         database.integer("SELECT count(*) FROM sqlite_master") == 0;
}

void change_schema(SqlDatabase& database, const std::string& sql, int64_t application_id,
                   int64_t version) {
  SqlTransaction transaction(database);
  database.execute(sql);
  database.execute("PRAGMA application_id = " + std::to_string(application_id));
  database.execute("PRAGMA user_version = " + std::to_string(version));
  transaction.commit();
}

}  // namespace voxdag
