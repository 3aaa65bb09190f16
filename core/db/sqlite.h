// An interface to SQLite: a connection that closes itself, statements with bound parameters, and
// errors as voxdag::Error. table_rows.h reads and writes complete rows. Not thread-safe: a
// connection and its statements must not be used concurrently. Only sqlite.cc includes sqlite3.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

struct sqlite3;
struct sqlite3_stmt;

namespace voxdag {

// One prepared statement. Parameters and columns are numbered from 0.
class SqlStatement {
 public:
  SqlStatement(sqlite3* database, std::string_view sql);
  SqlStatement(SqlStatement&&) = default;

  SqlStatement& bind(int parameter, int64_t value);
  SqlStatement& bind(int parameter, double value);
  // Copies the text.
  SqlStatement& bind(int parameter, std::string_view text);
  // Does not copy the bytes. They must remain valid until the statement has run.
  SqlStatement& bind(int parameter, std::span<const std::byte> bytes);
  // Stores a 64-bit word as the signed integer with the same bits.
  SqlStatement& bind_word(int parameter, uint64_t word) {
    return bind(parameter, static_cast<int64_t>(word));
  }

  // Advances to the next row. Returns false if there are no more rows.
  bool step();
  // Runs a statement that returns no rows. Afterwards the statement can be bound again.
  void run();
  void reset();

  bool is_null(int column) const;
  int64_t integer(int column) const;
  uint64_t word(int column) const { return static_cast<uint64_t>(integer(column)); }
  double real(int column) const;
  std::string text(int column) const;
  std::vector<std::byte> bytes(int column) const;

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  sqlite3* database_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

class SqlDatabase {
 public:
  enum class Mode { kReadWrite, kReadOnly };
  // Opens a database; kReadWrite creates it if it does not exist. A statement waits up to `busy_ms`
  // milliseconds if another process has locked the database. Throws Error{kInvalidInput} if `path`
  // is a symbolic link or anything else that is not a regular file.
  SqlDatabase(const std::string& path, Mode mode, int busy_ms = 5000);
  // Opens a new, empty database in memory. `path` is the file to which it will be copied; errors
  // name it.
  static SqlDatabase in_memory(const std::string& path);

  // Replaces the contents of `target` by a copy of this database, in one transaction.
  void copy_to(SqlDatabase& target);
  void execute(const std::string& sql);
  SqlStatement prepare(std::string_view sql) { return SqlStatement(handle_.get(), sql); }
  // Returns the first column of the first row of a query. Throws Error{kCorrupt} if the query has
  // no row.
  int64_t integer(const std::string& sql);

 private:
  SqlDatabase() = default;

  struct Close {
    void operator()(sqlite3* database) const;
  };
  std::unique_ptr<sqlite3, Close> handle_;
};

// True if a database has no tables, no application id and no schema version.
bool is_new(SqlDatabase& database);

// A commit with kNow survives a power cut. A commit with kLater can be lost in a power cut until
// the next commit with kNow.
enum class Durable { kNow, kLater };

// A write transaction. The destructor rolls it back unless commit() was called.
class SqlTransaction {
 public:
  explicit SqlTransaction(SqlDatabase& database, Durable durable = Durable::kNow);
  ~SqlTransaction();
  void commit();

 private:
  SqlDatabase& database_;
  bool open_ = true;
};

// Runs `sql`, which creates or changes tables. Also stores the kind of the database (PRAGMA
// application_id) and the version of its schema (PRAGMA user_version). All changes are one
// transaction.
void change_schema(SqlDatabase& database, const std::string& sql, int64_t application_id,
                   int64_t version);

}  // namespace voxdag
