// Writes and reads rows of a table. A row has a column for each member that the record's fields()
// function visits (core/fields/field.h). The members are integers, enums, double, text, bytes or
// optional integers:
//
//   template <class Row>
//   void fields(Row& row, Record& record) {
//     row.fixed("id", 1);  // a column that is 1 in every row; ignored on reading
//     row("name", record.name);
//   }
//
// put_row() and select_rows() make their SQL from this function, so no code contains the number of
// a column.
#pragma once

#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/db/sqlite.h"

namespace voxdag {

// A visitor that lists the names of the columns, separated by commas.
class ColumnNames {
 public:
  void fixed(const char* name, int64_t) { add(name); }
  template <class Value>
  void operator()(const char* name, const Value&) {
    add(name);
  }
  const std::string& text() const { return text_; }
  int count() const { return count_; }

 private:
  void add(const char* name) { text_ += (count_++ ? ", " : "") + std::string(name); }

  std::string text_;
  int count_ = 0;
};

// A visitor that binds the values of a record to the parameters of a statement, in order.
class RowWriter {
 public:
  explicit RowWriter(SqlStatement& statement) : statement_(statement) {}
  void fixed(const char*, int64_t value) { statement_.bind(next_++, value); }
  template <class Value>
  void operator()(const char*, const Value& value) {
    if constexpr (std::is_integral_v<Value> || std::is_enum_v<Value>)
      statement_.bind(next_, static_cast<int64_t>(value));
    else
      statement_.bind(next_, value);
    ++next_;
  }
  void operator()(const char*, const std::optional<int64_t>& value) {
    if (value) statement_.bind(next_, *value);  // an unbound parameter is NULL
    ++next_;
  }

 private:
  SqlStatement& statement_;
  int next_ = 0;
};

// A visitor that sets the members of a record from the columns of a statement's current row, in
// order.
class RowReader {
 public:
  explicit RowReader(const SqlStatement& row) : row_(row) {}
  void fixed(const char*, int64_t) { ++next_; }
  template <class Value>
  void operator()(const char*, Value& value) {
    value = static_cast<Value>(row_.integer(next_++));
  }
  void operator()(const char*, double& value) { value = row_.real(next_++); }
  void operator()(const char*, std::string& value) { value = row_.text(next_++); }
  void operator()(const char*, std::vector<std::byte>& value) { value = row_.bytes(next_++); }
  void operator()(const char*, std::optional<int64_t>& value) {
    value = row_.is_null(next_) ? std::nullopt : std::optional(row_.integer(next_));
    ++next_;
  }

 private:
  const SqlStatement& row_;
  int next_ = 0;
};

template <class Record>
ColumnNames column_names() {
  ColumnNames names;
  Record record;
  fields(names, record);
  return names;
}

// Runs the statement "`before` (COLUMNS) `between` (VALUES) `after`". COLUMNS are the names of the
// record's columns, and VALUES are the values of its members.
template <class Record>
void write_row(SqlDatabase& database, const std::string& before, const char* between,
               const std::string& after, Record record) {
  const ColumnNames names = column_names<Record>();
  std::string parameters = "?";
  for (int i = 1; i < names.count(); ++i) parameters += ", ?";
  SqlStatement statement = database.prepare(before + " (" + names.text() + ") " + between + " (" +
                                            parameters + ") " + after);
  RowWriter writer(statement);
  fields(writer, record);
  statement.run();
}

// Inserts the record's row into `table`. Replaces a row with the same key.
template <class Record>
void put_row(SqlDatabase& database, const std::string& table, Record record) {
  write_row(database, "INSERT OR REPLACE INTO " + table, "VALUES", "", std::move(record));
}

// Writes the record to all rows of `table` that satisfy `condition`, in place. put_row() would
// delete a row and insert a new one. Deleting a row also deletes the rows that refer to it with ON
// DELETE CASCADE.
template <class Record>
void update_row(SqlDatabase& database, const std::string& table, const std::string& condition,
                Record record) {
  write_row(database, "UPDATE " + table + " SET", "=", "WHERE " + condition, std::move(record));
}

// Returns a statement that selects the rows of `table`. `rest` is the end of the SQL statement,
// which can filter and order the rows.
template <class Record>
SqlStatement select_rows(SqlDatabase& database, const std::string& table,
                         const std::string& rest = "") {
  return database.prepare("SELECT " + column_names<Record>().text() + " FROM " + table + " " +
                          rest);
}

// Returns the current row of a statement from select_rows() as a record.
template <class Record>
Record read_row(const SqlStatement& statement) {
  Record record;
  RowReader reader(statement);
  fields(reader, record);
  return record;
}

// Returns the first row of `table`; nullopt if the table is empty.
template <class Record>
std::optional<Record> find_row(SqlDatabase& database, const std::string& table) {
  SqlStatement rows = select_rows<Record>(database, table);
  if (!rows.step()) return std::nullopt;
  return read_row<Record>(rows);
}

}  // namespace voxdag
