#include "estimation/regimes/labels.h"

#include <fmt/format.h>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>

#include "base/text.h"
#include "base/utc_text.h"

namespace imuscope {

namespace {

constexpr std::string_view kHeader = "begin_s,end_s,regime";
constexpr std::string_view kUtcHeader = "begin_utc,end_utc,regime";
/// What spreadsheets write at the beginning of a file in UTF-8.
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::string_view kEvent = "regime ";
constexpr std::string_view kEnd = "end";
/// Some thirty years: no run is as long, and every time of the host can be counted from there.
constexpr double kRunMax_s = 1e9;
/// Nanoseconds since 1970 end in 2262.
constexpr double kUtcMax_s = 9e9;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\n";
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

/// As a cell of a table: without what would break its line, and nothing around it.
std::string as_cell(std::string_view text) {
  std::string cell(text);
  std::replace_if(
      cell.begin(), cell.end(), [](char c) { return c == ',' || c == '"' || c == '\n' || c == '\r'; }, ' ');
  return one_line(trimmed(cell), kRegimeNameMax);
}

bool is_regime_name(std::string_view text) {
  return !text.empty() && text.find_first_of(",\"") == std::string_view::npos &&
         one_line(text, kRegimeNameMax) == text;
}

std::optional<double> number(std::string_view text) {
  double value = 0.0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// Seconds since 1970. A date without a zone may be meant in the time of whoever wrote it.
std::optional<double> utc_number(std::string_view text) {
  if (const auto date = parse_utc_text(text); date && date->has_zone) return date->since_1970_s;
  return number(text);
}

std::optional<Label> parse_line(std::string_view line, bool in_utc) {
  const auto first = line.find(',');
  if (first == std::string_view::npos) return std::nullopt;
  const auto second = line.find(',', first + 1);
  if (second == std::string_view::npos) return std::nullopt;
  const auto time = [&](std::string_view text) { return in_utc ? utc_number(text) : number(text); };
  const auto begin = time(trimmed(line.substr(0, first)));
  const auto end = time(trimmed(line.substr(first + 1, second - first - 1)));
  const auto name = trimmed(line.substr(second + 1));
  const auto is_of_a_run = [&](double time_s) {
    return std::abs(time_s) <= (in_utc ? kUtcMax_s : kRunMax_s);
  };
  if (!begin || !end || !is_of_a_run(*begin) || !is_of_a_run(*end)) return std::nullopt;
  if (*end <= *begin || !is_regime_name(name)) return std::nullopt;
  return Label{*begin, *end, std::string(name), in_utc};
}

}  // namespace

Result<std::vector<Label>> parse_labels(std::string_view text, const std::string& file) {
  const std::string remedy = fmt::format(
      "a file of labels begins with the line {} or {}, then one stretch a line, "
      "such as 12.0,340.5,motorway",
      kHeader, kUtcHeader);
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  std::vector<Label> labels;
  bool has_header = false;
  bool in_utc = false;
  int line_number = 0;
  while (!text.empty()) {
    const auto end = text.find('\n');
    const auto line = trimmed(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
    ++line_number;
    if (line.empty() || line.front() == '#') continue;
    if (!has_header) {
      in_utc = line == kUtcHeader;
      if (line != kHeader && !in_utc)
        return usage_error(
            fmt::format("{}:{}: '{}' is not the header {}", file, line_number, one_line(line), kHeader),
            remedy);
      has_header = true;
      continue;
    }
    const auto label = parse_line(line, in_utc);
    if (!label)
      return usage_error(
          fmt::format("{}:{}: '{}' is no stretch of a regime", file, line_number, one_line(line)), remedy);
    if (!labels.empty() && label->begin_s < labels.back().end_s) {
      return usage_error(fmt::format("{}:{}: begins at {} s, before the stretch above it ends ({} s)", file,
                                     line_number, label->begin_s, labels.back().end_s),
                         "stretches are in order and do not overlap");
    }
    labels.push_back(*label);
  }
  if (labels.empty()) return usage_error(fmt::format("{} holds no regime", file), remedy);
  return labels;
}

std::vector<Label> labels_of_moments(const std::vector<MarkedMoment>& moments, HostTime origin,
                                     HostTime end) {
  std::vector<Label> labels;
  bool open = false;
  auto ordered = moments;
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const MarkedMoment& a, const MarkedMoment& b) { return a.time < b.time; });
  for (const auto& moment : ordered) {
    const auto text = trimmed(moment.text);
    if (!text.starts_with(kEvent)) continue;
    const double time_s = to_seconds(moment.time - origin);
    if (open) labels.back().end_s = time_s;
    const auto name = as_cell(text.substr(kEvent.size()));
    open = !name.empty() && name != kEnd;
    if (open) labels.push_back({time_s, time_s, name, false});
  }
  if (open) labels.back().end_s = std::max(labels.back().begin_s, to_seconds(end - origin));
  return labels;
}

Result<std::vector<Label>> labels_of_run(std::vector<Label> labels, HostTime origin,
                                         const std::function<std::optional<HostTime>(UtcTime)>& time_of) {
  const auto in_run = [&](double utc_s) {
    const auto time = time_of(UtcTime{from_seconds(utc_s)});
    return time ? std::optional(to_seconds(*time - origin)) : std::nullopt;
  };
  for (auto& label : labels) {
    if (!label.in_utc) continue;
    const auto begin = in_run(label.begin_s);
    const auto end = in_run(label.end_s);
    if (!begin || !end)
      return usage_error("the labels are in UTC, which nothing in this recording tells",
                         fmt::format("give them by time_s, under the header {}", kHeader));
    label = {*begin, *end, label.name, false};
  }
  return labels;
}

std::size_t keep_first_names(std::vector<Label>& labels, std::size_t n_names) {
  std::set<std::string> kept;
  std::set<std::string> left_out;
  std::erase_if(labels, [&](const Label& label) {
    if (kept.contains(label.name)) return false;
    const bool is_kept = kept.size() < n_names;
    (is_kept ? kept : left_out).insert(label.name);
    return !is_kept;
  });
  return left_out.size();
}

RegimeTrack labelled_regimes(const std::vector<Label>& labels, HostTime origin) {
  std::vector<std::string> names;
  std::vector<RegimeStretch> stretches;
  for (const auto& label : labels) {
    auto found = std::find(names.begin(), names.end(), label.name);
    if (found == names.end()) found = names.insert(names.end(), label.name);
    stretches.push_back({origin + from_seconds(label.begin_s), origin + from_seconds(label.end_s),
                         static_cast<std::size_t>(found - names.begin())});
  }
  return {std::move(names), stretches};
}

}  // namespace imuscope
