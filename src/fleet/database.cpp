#include "fleet/database.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

namespace imuscope::fleet {
namespace {

/// Longest that a reader waits for somebody who writes.
constexpr int kBusy_ms = 10000;

tl::unexpected<Error> refused(sqlite3* database, ErrorKind kind) {
  return tl::unexpected<Error>(
      Error{kind, fmt::format("the catalogue says: {}", sqlite3_errmsg(database)), {}});
}

}  // namespace

void Statement::Finalize::operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
void Database::Close::operator()(sqlite3* database) const { sqlite3_close_v2(database); }

Result<void> Statement::run(const std::vector<Cell>& values) {
  sqlite3_stmt* const statement = statement_.get();
  sqlite3_reset(statement);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const int at = static_cast<int>(i) + 1;
    std::visit(
        [&](const auto& value) {
          using Value = std::decay_t<decltype(value)>;
          if constexpr (std::is_same_v<Value, std::int64_t>) {
            sqlite3_bind_int64(statement, at, value);
          } else if constexpr (std::is_same_v<Value, double>) {
            std::isfinite(value) ? sqlite3_bind_double(statement, at, value)
                                 : sqlite3_bind_null(statement, at);
          } else if constexpr (std::is_same_v<Value, std::string>) {
            sqlite3_bind_text64(statement, at, value.data(), value.size(), SQLITE_STATIC, SQLITE_UTF8);
          } else {
            sqlite3_bind_null(statement, at);
          }
        },
        values[i]);
  }
  for (;;) {
    const auto row = next();
    if (!row) return tl::unexpected<Error>(row.error());
    if (!*row) break;
  }
  sqlite3_reset(statement);
  return {};
}

Result<bool> Statement::next() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return refused(sqlite3_db_handle(statement_.get()), ErrorKind::kWork);
}

std::vector<std::string> Statement::columns() const {
  std::vector<std::string> names;
  for (int i = 0; i < sqlite3_column_count(statement_.get()); ++i)
    names.emplace_back(sqlite3_column_name(statement_.get(), i));
  return names;
}

Cell Statement::cell(int column) const {
  switch (sqlite3_column_type(statement_.get(), column)) {
    case SQLITE_INTEGER:
      return integer(column);
    case SQLITE_FLOAT:
      return sqlite3_column_double(statement_.get(), column);
    case SQLITE_NULL:
      return std::monostate{};
    default:
      return text(column);
  }
}

double Statement::number(int column) const {
  const int type = sqlite3_column_type(statement_.get(), column);
  return type == SQLITE_INTEGER || type == SQLITE_FLOAT ? sqlite3_column_double(statement_.get(), column)
                                                        : std::numeric_limits<double>::quiet_NaN();
}

std::int64_t Statement::integer(int column) const { return sqlite3_column_int64(statement_.get(), column); }

std::string Statement::text(int column) const {
  const auto* bytes = sqlite3_column_text(statement_.get(), column);
  const int n = sqlite3_column_bytes(statement_.get(), column);
  return bytes == nullptr ? std::string()
                          : std::string(reinterpret_cast<const char*>(bytes), static_cast<std::size_t>(n));
}

Result<Database> Database::create(const std::filesystem::path& file) {
  sqlite3* raw = nullptr;
  const int code = sqlite3_open_v2(
      file.c_str(), &raw, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOFOLLOW, nullptr);
  Database database(raw);
  if (code != SQLITE_OK) return refused(raw, ErrorKind::kWork);
  if (auto set = database.execute(
          "PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA cache_size = -65536;");
      !set)
    return tl::unexpected<Error>(set.error());
  return database;
}

Result<Database> Database::open_to_read(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error))
    return usage_error(fmt::format("there is no catalogue {}", file.string()),
                       "imuscope fleet reduce makes it");
  sqlite3* raw = nullptr;
  const int code = sqlite3_open_v2(file.c_str(), &raw, SQLITE_OPEN_READONLY, nullptr);
  Database database(raw);
  if (code != SQLITE_OK) return refused(raw, ErrorKind::kWork);
  sqlite3_busy_timeout(raw, kBusy_ms);
  // Neither a file that is attached nor a setting can change anything.
  sqlite3_limit(raw, SQLITE_LIMIT_ATTACHED, 0);
  if (auto set = database.execute("PRAGMA query_only = ON;"); !set) return tl::unexpected<Error>(set.error());
  return database;
}

Result<void> Database::execute(const std::string& sql) const {
  if (sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK) return {};
  return refused(database_.get(), ErrorKind::kWork);
}

Result<Statement> Database::prepare(std::string_view sql) const {
  sqlite3_stmt* raw = nullptr;
  const char* rest = nullptr;
  const int code = sqlite3_prepare_v2(database_.get(), sql.data(), static_cast<int>(sql.size()), &raw, &rest);
  Statement statement(raw);
  if (code != SQLITE_OK) return refused(database_.get(), ErrorKind::kUsage);
  const std::string_view behind = sql.substr(static_cast<std::size_t>(rest - sql.data()));
  if (raw == nullptr || behind.find_first_not_of(" \t\r\n;") != std::string_view::npos)
    return usage_error("one statement of SQL at a time, and no empty one");
  return statement;
}

}  // namespace imuscope::fleet
