#pragma once

/// SQLite, as far as a catalogue needs it: statements with values, errors as values.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/result.h"

struct sqlite3;
struct sqlite3_stmt;

namespace imuscope::fleet {

/// A cell: null, a whole number, a number, text. Numbers that are not finite are null.
using Cell = std::variant<std::monostate, std::int64_t, double, std::string>;

/// A statement that is given values and run, again and again.
class Statement {
 public:
  /// Runs it with these values, one for each '?'. Rows that it returns are passed over. Errors: kWork.
  [[nodiscard]] Result<void> run(const std::vector<Cell>& values);
  /// Goes to the next row; false at the end. Errors: kWork.
  [[nodiscard]] Result<bool> next();
  [[nodiscard]] std::vector<std::string> columns() const;
  [[nodiscard]] Cell cell(int column) const;
  /// NaN where it is null or text.
  [[nodiscard]] double number(int column) const;
  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] std::string text(int column) const;

 private:
  friend class Database;
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  explicit Statement(sqlite3_stmt* statement) : statement_(statement) {}
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

/// A file of SQLite. Thread: one.
class Database {
 public:
  /// A new one in place of whatever was there. Nothing protects it from a cut of the power while it is
  /// written: whoever makes it gives it its name when it is whole.
  static Result<Database> create(const std::filesystem::path& file);
  /// One that exists, and cannot be changed through this.
  static Result<Database> open_to_read(const std::filesystem::path& file);

  /// Statements that return nothing, with semicolons between them.
  [[nodiscard]] Result<void> execute(const std::string& sql) const;
  /// One statement. Errors: kUsage, what SQLite says of it; nothing may follow it.
  [[nodiscard]] Result<Statement> prepare(std::string_view sql) const;

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };
  explicit Database(sqlite3* database) : database_(database) {}
  std::unique_ptr<sqlite3, Close> database_;
};

}  // namespace imuscope::fleet
