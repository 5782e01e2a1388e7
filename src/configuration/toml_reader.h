#pragma once

/// Reads a TOML table key by key and remembers what was asked for, so that anything left over is refused with
/// the nearest key that exists. The first problem wins and carries file and line.

#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "careful_toml.h"

namespace imuscope {

/// A key that was asked for, whether or not the document has it: what may stand there.
struct AskedKey {
  std::string name;    ///< with its tables, such as "device.noise.gyro_bias_sd_degps"
  std::string values;  ///< "true or false", "0.1 to 2000", "\"a\", \"b\"" ...
  std::string preset;  ///< what holds without the key, as TOML writes it; empty: nothing in particular
  bool required = false;
};

/// What is told of one document: its first problem and, on demand, every key that was asked for.
struct TomlProblem {
  std::string file;
  std::optional<Error> error;
  std::vector<AskedKey>* asked = nullptr;

  void report(const toml::source_region& where, const std::string& what, const std::string& remedy = {});
};

class TomlReader {
 public:
  /// @param name  the table's name in messages, such as "device.noise"
  TomlReader(const toml::table* table, std::string name, TomlProblem& problem);

  [[nodiscard]] bool present() const { return table_ != nullptr; }
  [[nodiscard]] bool has(std::string_view key) const;

  void text(std::string_view key, std::string& value);
  void boolean(std::string_view key, bool& value);
  /// A number in [low, high], multiplied by `unit` into `value`.
  void number(std::string_view key, double& value, double unit, double low, double high);
  void number(std::string_view key, std::optional<double>& value, double unit, double low, double high);
  void integer(std::string_view key, int& value, int low, int high);
  void vector(std::string_view key, std::array<double, 3>& value, double unit);
  void texts(std::string_view key, std::array<std::string, 3>& value);
  /// A list of any length.
  void texts(std::string_view key, std::vector<std::string>& value);
  void numbers(std::string_view key, std::vector<double>& value);
  /// Every key of the table with its text.
  void every_text(std::map<std::string, std::string>& values);
  /// One of the given words; the index of the word found, or `fallback` when the key is absent.
  std::size_t choice(std::string_view key, const std::vector<std::string_view>& words, std::size_t fallback);
  [[nodiscard]] TomlReader table(std::string_view key);
  [[nodiscard]] const toml::array* array(std::string_view key);
  /// @param values, preset  as in AskedKey
  [[nodiscard]] const toml::node* node(std::string_view key, const std::string& values,
                                       const std::string& preset = {});

  /// Reports that `key` is missing, with what it is for.
  void require(std::string_view key, const std::string& purpose);
  /// Reports a problem at `key` (or at the table when the key is absent).
  void fail(std::string_view key, const std::string& what, const std::string& remedy = {});
  /// A problem has been reported, here or elsewhere in the document.
  [[nodiscard]] bool failed() const { return problem_->error.has_value(); }
  /// Refuses keys that were never asked for. Call last.
  void finish();
  /// Marks a key as known without reading it.
  void ignore(std::string_view key) { known_.emplace_back(key); }

 private:
  [[nodiscard]] const toml::node* find(std::string_view key);
  void read_text(std::string_view key, std::string& value);
  const std::string& checked_text(std::string_view key, const std::string& text);
  bool read_number(std::string_view key, double& value, double unit, double low, double high);
  [[nodiscard]] std::string full_name(std::string_view key) const;
  [[nodiscard]] toml::source_region where(std::string_view key) const;

  const toml::table* table_;
  std::string name_;
  TomlProblem* problem_;
  std::vector<std::string> known_;
};

}  // namespace imuscope
