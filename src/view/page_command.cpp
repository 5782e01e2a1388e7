#include "view/page_command.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/text.h"

namespace imuscope::view {

namespace {

constexpr int kDepthMax = 2;

/// A document no deeper than a command is; discarded where it is none.
nlohmann::json parse(std::string_view text) {
  bool too_deep = false;
  auto document = nlohmann::json::parse(
      text,
      [&](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
        too_deep = too_deep || depth > kDepthMax;
        return !too_deep;
      },
      false);
  return too_deep ? nlohmann::json(nlohmann::json::value_t::discarded) : document;
}

}  // namespace

Result<PageCommand> read_page_command(std::string_view text) {
  if (text.size() > kPageMessageMax) return usage_error("a message of a page is too long");
  const auto document = parse(text);
  if (!document.is_object() || document.size() != 1)
    return usage_error("a message of a page is no object with one member");
  const std::string& key = document.begin().key();
  const auto& value = document.begin().value();
  if (key == "mark" && value.is_string()) {
    std::string line = one_line(value.get_ref<const std::string&>(), kMarkTextMax);
    return Mark{line.empty() ? "mark" : std::move(line)};
  }
  if (key == "seek_s" && value.is_number()) {
    const double time_s = value.get<double>();
    if (std::isfinite(time_s)) return Seek{std::max(0.0, time_s)};
  }
  if (key == "pause" && value.is_boolean()) return Pause{};
  if (key == "play" && value.is_number()) {
    const double speed = value.get<double>();
    if (speed >= kSlowest && speed <= kFastest) return Play{speed};
  }
  return usage_error("a message of a page is none that this program knows");
}

}  // namespace imuscope::view
