#include "drivers/dbc/database.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>

#include "base/nearest_word.h"

namespace imuscope::dbc {
namespace {

/// Multiplexed multiplexers: more levels than any file has.
constexpr int kSwitchLevelsMax = 8;

bool is_present(const Message& message, const Signal& signal, std::span<const std::uint8_t> data) noexcept {
  const Signal* at = &signal;
  for (int level = 0; at->switched_by; ++level) {
    if (level == kSwitchLevelsMax) return false;
    const Signal& by = message.signals[*at->switched_by];
    const auto raw = raw_of(by.layout, data);
    if (!raw) return false;
    if (std::none_of(at->present_for.begin(), at->present_for.end(),
                     [&](const RawRange& range) { return *raw >= range.low && *raw <= range.high; })) {
      return false;
    }
    at = &by;
  }
  return true;
}

}  // namespace

const Signal* Message::find(std::string_view signal) const {
  const auto found =
      std::find_if(signals.begin(), signals.end(), [&](const Signal& s) { return s.name == signal; });
  return found == signals.end() ? nullptr : &*found;
}

std::optional<std::uint64_t> raw_in_frame(const Message& message, std::size_t signal,
                                          std::span<const std::uint8_t> data) noexcept {
  const Signal& wanted = message.signals[signal];
  if (!is_present(message, wanted, data)) return std::nullopt;
  return raw_of(wanted.layout, data);
}

std::string_view name_of(const Signal& signal, std::uint64_t raw) noexcept {
  const std::int64_t number = signal.layout.coding == Coding::kSigned ? signed_of(signal.layout, raw)
                                                                      : static_cast<std::int64_t>(raw);
  for (const NamedValue& value : signal.names) {
    if (value.number == number) return value.name;
  }
  return {};
}

const Message* Database::find(std::uint32_t id, bool is_extended) const noexcept {
  for (const Message& message : messages) {
    if (message.id == id && message.is_extended == is_extended) return &message;
  }
  return nullptr;
}

Result<SignalChoice> Database::choose(std::string_view name) const {
  const auto dot = name.find('.');
  const std::string_view wanted_message = dot == std::string_view::npos ? "" : name.substr(0, dot);
  const std::string_view wanted_signal = dot == std::string_view::npos ? name : name.substr(dot + 1);
  std::vector<SignalChoice> found;
  std::vector<std::string> full_names;
  std::vector<std::string> of_that_message;
  for (std::size_t m = 0; m < messages.size(); ++m) {
    const Message& message = messages[m];
    for (std::size_t s = 0; s < message.signals.size(); ++s) {
      const std::string& signal = message.signals[s].name;
      full_names.push_back(message.name + "." + signal);
      if (message.name == wanted_message) of_that_message.push_back(full_names.back());
      const bool here = wanted_message.empty() || message.name == wanted_message;
      if (here && signal == wanted_signal) found.push_back({m, s});
    }
  }
  if (found.size() == 1) return found.front();
  if (found.size() > 1) {
    std::vector<std::string> owners;
    for (const SignalChoice& choice : found)
      owners.push_back(fmt::format("{}.{}", messages[choice.message].name, wanted_signal));
    return usage_error(fmt::format("{}: {} messages have a signal '{}'", file, found.size(), wanted_signal),
                       fmt::format("write one of {}", fmt::join(owners, ", ")));
  }
  std::string near = nearest_word(name, of_that_message.empty() ? full_names : of_that_message);
  if (near.empty() && !of_that_message.empty()) {
    return usage_error(fmt::format("{}: no signal '{}'", file, name),
                       fmt::format("that message has {}", fmt::join(of_that_message, ", ")));
  }
  if (near.empty()) {
    // The signal alone may be the nearer one.
    std::vector<std::string> signals;
    for (const Message& message : messages)
      for (const Signal& signal : message.signals) signals.push_back(signal.name);
    const std::string near_signal = nearest_word(wanted_signal, signals);
    for (const std::string& full : full_names) {
      if (!near_signal.empty() && full.ends_with("." + near_signal)) {
        near = full;
        break;
      }
    }
  }
  return usage_error(
      fmt::format("{}: no signal '{}'", file, name),
      near.empty() ? "write MESSAGE.SIGNAL as in that file" : fmt::format("did you mean '{}'?", near));
}

}  // namespace imuscope::dbc
