#include "firmware_sim/devices/greis_receiver.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "firmware_sim/devices/gnss_talker.h"

namespace imusim {
namespace {

constexpr double kReceiverAnswerDelay_s = 0.005;
constexpr std::array<std::string_view, 8> kKnown = {"RT", "RD", "ST", "PG", "VG", "SG", "DP", "ET"};

/// Reply and error messages have no checksum.
Bytes text_reply(std::string_view id, std::string_view text) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  Bytes bytes;
  put_text(bytes, id);
  for (const unsigned shift : {8U, 4U, 0U})
    bytes.push_back(static_cast<std::uint8_t>(kDigits[(text.size() >> shift) & 0xFU]));
  put_text(bytes, text);
  put_text(bytes, "\r\n");
  return bytes;
}

}  // namespace

GreisReceiver::GreisReceiver(const Options& options, Solver solver)
    : options_(options),
      solver_(std::move(solver)),
      grid_(first_epoch_s(options.utc_begin, options.rate_hz), 1.0 / options.rate_hz),
      enabled_(kKnown.begin(), kKnown.end()) {}

void GreisReceiver::skip_to(double t_s) { next_index_ = std::max(next_index_, grid_.first_from(t_s)); }

void GreisReceiver::power_cycle(double t_s, double off_s) {
  skip_to(t_s + off_s + kWarmStart_s);
  heard_.clear();
  replies_.clear();
  enabled_.assign(kKnown.begin(), kKnown.end());
  epochs_per_output_ = 1;
}

bool GreisReceiver::leave_out(const std::vector<std::string>& blocks) {
  const bool known = std::all_of(blocks.begin(), blocks.end(), [](const std::string& name) {
    return std::find(kKnown.begin(), kKnown.end(), name) != kKnown.end();
  });
  if (known) left_out_ = blocks;
  return known;
}

void GreisReceiver::receive(std::span<const std::uint8_t> bytes, double t_s) {
  constexpr std::size_t kLongestLine = 256;
  for (const std::uint8_t byte : bytes) {
    if (byte != '\r' && byte != '\n') {
      if (heard_.size() < kLongestLine) heard_.push_back(static_cast<char>(byte));
    } else if (!heard_.empty()) {
      handle(std::exchange(heard_, {}), t_s);
    }
  }
}

void GreisReceiver::handle(std::string line, double t_s) {
  std::string prefix;
  if (line.front() == '%') {
    const std::size_t end = line.find('%', 1);
    if (end == std::string::npos) return;
    prefix = line.substr(0, end + 1);
    line.erase(0, end + 1);
  }
  const std::string command = line.substr(0, line.find(','));
  const std::string arguments = line.size() > command.size() ? line.substr(command.size() + 1) : "";
  bool understood = true;
  if (command == "em")
    understood = enable(arguments);
  else if (command == "dm")
    enabled_.clear();
  else
    understood = command == "set" || command.empty();
  if (!understood) {
    replies_.push_back({t_s + kReceiverAnswerDelay_s, text_reply("ER", prefix + "{4,wrong command}")});
  } else if (!prefix.empty()) {
    replies_.push_back({t_s + kReceiverAnswerDelay_s, text_reply("RE", prefix)});
  }
}

/// "[port],jps/{RT,RD,...}[:period]" or "[port],/msg/jps/RT[:period]"
bool GreisReceiver::enable(const std::string& arguments) {
  const std::size_t colon = arguments.find(':');
  const std::string list = arguments.substr(0, colon);
  if (colon != std::string::npos) {
    const double period_s = std::strtod(arguments.c_str() + colon + 1, nullptr);
    if (!(period_s > 0.0)) return false;
    epochs_per_output_ = std::max<std::int64_t>(1, std::llround(period_s * options_.rate_hz));
  }
  std::vector<std::string> wanted;
  for (const std::string_view name : kKnown)
    if (list.find(name) != std::string::npos) wanted.emplace_back(name);
  if (wanted.empty()) return false;
  enabled_ = std::move(wanted);
  return true;
}

Bytes GreisReceiver::epoch_bytes(std::int64_t index) const {
  greis::Solution solution = solver_(grid_.instant(index));
  // Time base GPS: what the receiver calls its date and time of day is ahead of UTC by the leap seconds.
  const CalendarTime gps = calendar_time(gps_after(options_.utc_begin, grid_.device_time(index)));
  solution.time_of_day_ms =
      static_cast<std::uint32_t>(std::chrono::round<std::chrono::milliseconds>(gps.time_of_day).count());
  solution.year = static_cast<std::uint16_t>(gps.year);
  solution.month = static_cast<std::uint8_t>(gps.month);
  solution.day = static_cast<std::uint8_t>(gps.day);
  solution.date_base = 0;
  Bytes bytes;
  for (const std::string& name : enabled_) {
    if (std::find(left_out_.begin(), left_out_.end(), name) != left_out_.end()) continue;
    put_bytes(bytes, greis::encode(name, solution));
    put_text(bytes, "\r\n");
  }
  return bytes;
}

void GreisReceiver::run_until(double t_s, std::vector<Emission>& out) {
  for (Emission& reply : replies_) out.push_back(std::move(reply));
  replies_.clear();
  while (true) {
    const double ready_s = grid_.instant(next_index_) + options_.latency_s;
    if (ready_s > t_s) break;
    const bool due = next_index_ % epochs_per_output_ == 0 && !enabled_.empty();
    if (due) out.push_back({ready_s, epoch_bytes(next_index_)});
    ++next_index_;
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const Emission& a, const Emission& b) { return a.ready_s < b.ready_s; });
}

}  // namespace imusim
