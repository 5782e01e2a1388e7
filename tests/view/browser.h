#pragma once

/// A real browser without a screen, told what to do through a pipe (Chrome DevTools Protocol, one JSON
/// document after another, each ended by a zero byte).

#include <sys/types.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace imuscope::test {

class Browser {
 public:
  static constexpr const char* kProgram = "/usr/bin/chromium";

  /// @param folder  for the browser's profile and log
  explicit Browser(const std::filesystem::path& folder);
  ~Browser();
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  void open(const std::string& url);
  /// What the window is as wide and high as, CSS pixels.
  void resize(int width, int height);
  /// Whether the system prefers dark colours.
  void prefer_dark(bool dark);
  /// Value of an expression of JavaScript; null where it throws, which is remembered as said.
  nlohmann::json value_of(const std::string& expression);
  /// Calls until the expression is true, or for so long.
  bool becomes_true(const std::string& expression, double patience_s);
  /// The whole page, of its present width, as PNG.
  void photograph(const std::filesystem::path& file);
  /// What the console and the browser's own log said: errors, warnings, refusals of a policy.
  [[nodiscard]] std::vector<std::string> said();
  /// Of everything that came over the network since open(), headers included.
  [[nodiscard]] double bytes_received();

 private:
  nlohmann::json call(const std::string& method, nlohmann::json parameters = nlohmann::json::object());
  void take(const nlohmann::json& event);

  pid_t process_ = -1;
  int to_ = -1;
  int from_ = -1;
  int number_ = 0;
  std::string session_;
  std::string buffer_;
  std::vector<std::string> said_;
  double bytes_ = 0.0;
};

}  // namespace imuscope::test
