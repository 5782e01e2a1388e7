#pragma once

/// Reads one TOML table key by key and remembers which keys were asked for, so that a key that nobody knows
/// is refused with its place and the nearest one that would be known.

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "careful_toml.h"

namespace imusim {

/// The first thing found wrong in a file.
struct Problem {
  std::string file;
  std::string text;  ///< empty as long as all is well

  void note(const toml::source_region& where, const std::string& what);
};

class TableReader {
 public:
  /// @param table    may be null: then every key keeps its default
  /// @param name     as it stands in the file, such as "simulation.gnss"
  /// @param problem  must outlive the reader
  TableReader(const toml::table* table, std::string name, Problem& problem)
      : table_(table), name_(std::move(name)), problem_(&problem) {}

  [[nodiscard]] bool present() const { return table_ != nullptr; }
  bool has(std::string_view key);

  /// Each sets the target, in SI, where the key is present and its value times `unit` lies in [low, high];
  /// the bounds are in the file's unit.
  void number(std::string_view key, double& target, double unit, double low, double high);
  void whole(std::string_view key, std::int64_t& target, std::int64_t low, std::int64_t high);
  void vector(std::string_view key, Eigen::Vector3d& target, double unit);
  /// Three rows of three numbers.
  void matrix(std::string_view key, Eigen::Matrix3d& target, double unit);
  void text(std::string_view key, std::string& target);
  /// @return index of the word found, or `otherwise`
  std::size_t choice(std::string_view key, const std::vector<std::string_view>& words, std::size_t otherwise);
  const toml::node* node(std::string_view key);

  TableReader table(std::string_view key);
  std::vector<TableReader> tables(std::string_view key);

  /// Notes a problem with a key.
  void fail(std::string_view key, const std::string& what);
  /// Refuses the keys that nobody asked for.
  void refuse_unknown_keys();

 private:
  std::vector<double> numbers(std::string_view key, std::size_t count, const toml::node& node);

  const toml::table* table_;
  std::string name_;
  Problem* problem_;
  std::vector<std::string> known_;
};

}  // namespace imusim
