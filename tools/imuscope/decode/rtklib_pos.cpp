#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <string_view>

#include "drivers/rtklib_pos/messages.h"
#include "sample/gps_time.h"
#include "stream_protocols.h"
#include "whole_stream.h"

namespace imuscope::cli {
namespace {

using namespace rtklib_pos;
using Json = nlohmann::ordered_json;

constexpr std::int64_t kNsPerMs = 1'000'000;
constexpr std::int64_t kNsPerDay = 86'400'000 * kNsPerMs;

bool is_printable(std::string_view line) {
  return std::all_of(line.begin(), line.end(), [](char c) { return (c >= ' ' && c <= '~') || c == '\t'; });
}

/// Integers of a solution; all other values are reals.
bool is_integer(std::string_view name) { return name == "Q" || name == "ns"; }

std::string_view name_of(TimeSystem system) {
  switch (system) {
    case TimeSystem::kGpst:
      return "GPST";
    case TimeSystem::kUtc:
      return "UTC";
    case TimeSystem::kJst:
      return "JST";
  }
  return {};
}

/// "2026-03-14T12:34:56.100 GPST"
std::string time_text(std::int64_t time_ns, TimeSystem system) {
  const std::int64_t ms = (time_ns + kNsPerMs / 2) / kNsPerMs;
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03} {}", fmt::gmtime(static_cast<std::time_t>(ms / 1000)),
                     ms % 1000, name_of(system));
}

/// As the line writes it: a calendar date, or week and time of week.
void add_time(std::string_view line, const Solution& solution, TimeSystem system, Json& fields) {
  if (line.find('/') != std::string_view::npos) {
    fields["time"] = time_text(solution.time_ns, system);
    return;
  }
  const std::int64_t since_epoch_ns = solution.time_ns - kGpsEpochDays * kNsPerDay;
  const std::int64_t week = since_epoch_ns / (7 * kNsPerDay);
  fields["week"] = week;
  const std::int64_t tow_us = (since_epoch_ns - 7 * week * kNsPerDay) / 1000;
  fields["tow"] = static_cast<double>(tow_us) / 1e6;
}

Json solution_json(std::string_view line, const Solution& solution, const Format& format) {
  Json fields = Json::object();
  add_time(line, solution, format.time_system, fields);
  for_each_field(solution, format.layout, [&](std::string_view name, double value) {
    fields[std::string(name)] = json_number(value, is_integer(name));
  });
  if (format.has_velocity) {
    fields["velocity_ms"] = solution.velocity;
    fields["velocity_std_ms"] = solution.velocity_sd;
  }
  return fields;
}

}  // namespace

void decode_rtklib_pos(std::span<const std::uint8_t> stream, const Visitor& visitor) {
  const std::string_view text(reinterpret_cast<const char*>(stream.data()), stream.size());
  Format format;
  std::optional<ReferencePosition> base;
  std::uint64_t told = 0;
  for (std::size_t at = 0; at < text.size();) {
    tell_position(visitor, at, told);
    const std::size_t end = line_end(text, at, "\r\n");
    const std::size_t next = behind_line_end(stream, end);
    const std::string_view line = text.substr(at, end - at);
    if (!line.empty() && line[0] == '%' && is_printable(line)) {
      const bool columns = read_comment(line, format, base);
      visitor.message({at, next - at, columns ? "columns" : "comment", columns, {{"text", line}}});
    } else if (const auto solution = parse_solution(line, format)) {
      visitor.message({at, next - at, "solution", true, solution_json(line, *solution, format)});
    }
    at = next;
  }
}

}  // namespace imuscope::cli
