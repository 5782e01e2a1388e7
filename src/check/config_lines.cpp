#include "check/config_lines.h"

#include <fmt/format.h>
#include <algorithm>
#include <optional>
#include <sstream>
#include <string_view>

namespace imuscope::check {

namespace {

using Lines = std::vector<std::string>;

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

bool is_quote(char c) { return c == '"' || c == '\''; }

/// One past the string that begins with the quote at `at`.
std::size_t end_of_string(std::string_view line, std::size_t at) {
  const char quote = line[at];
  for (++at; at < line.size() && line[at] != quote; ++at) {
    if (line[at] == '\\' && quote == '"') ++at;
  }
  return at + 1;
}

/// The text of a line before its comment.
std::string_view code_of(std::string_view line) {
  for (std::size_t i = 0; i < line.size(); i = is_quote(line[i]) ? end_of_string(line, i) : i + 1) {
    if (line[i] == '#') return trimmed(line.substr(0, i));
  }
  return trimmed(line);
}

bool is_header(std::string_view code) { return !code.empty() && code.front() == '['; }

/// A header without the blanks that TOML allows in it.
std::string header_of(std::string_view code) {
  std::string header;
  for (const char c : code) {
    if (c != ' ' && c != '\t') header += c;
  }
  return header;
}

/// The key of "key = value"; empty where the line is none.
std::string_view key_of(std::string_view code) {
  const auto equals = code.find('=');
  return equals == std::string_view::npos || is_header(code) ? std::string_view()
                                                             : trimmed(code.substr(0, equals));
}

/// Of lists, not of what stands in quotes.
int open_brackets(std::string_view code) {
  int open = 0;
  for (std::size_t i = 0; i < code.size(); i = is_quote(code[i]) ? end_of_string(code, i) : i + 1) {
    if (code[i] == '[') ++open;
    if (code[i] == ']') --open;
  }
  return open;
}

/// First line of a value that goes over several, to one past its last.
std::size_t end_of_value(const Lines& lines, std::size_t at) {
  const auto code = code_of(lines[at]);
  int open = open_brackets(code.substr(code.find('=') + 1));
  ++at;
  for (; open > 0 && at < lines.size(); ++at) open += open_brackets(code_of(lines[at]));
  return at;
}

struct Range {
  std::size_t begin = 0;  ///< of the lines after the header
  std::size_t end = 0;
};

/// One past the lines of a table that begins at `begin`.
std::size_t end_of_table(const Lines& lines, std::size_t begin) {
  std::size_t at = begin;
  while (at < lines.size()) {
    const auto code = code_of(lines[at]);
    if (is_header(code)) break;
    at = key_of(code).empty() ? at + 1 : end_of_value(lines, at);
  }
  return at;
}

/// The [[device]] of this name: its own keys, and all up to the next table that is not below it.
struct Device {
  Range keys;
  std::size_t end = 0;
};

std::optional<Device> find_device(const Lines& lines, const std::string& name) {
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (header_of(code_of(lines[i])) != "[[device]]") continue;
    Device device{{i + 1, end_of_table(lines, i + 1)}, 0};
    bool is_it = false;
    for (std::size_t k = device.keys.begin; k < device.keys.end; ++k) {
      const auto code = code_of(lines[k]);
      if (key_of(code) != "name") continue;
      const auto value = trimmed(code.substr(code.find('=') + 1));
      is_it = value.size() == name.size() + 2 && value.substr(1, name.size()) == name;
    }
    if (!is_it) continue;
    device.end = device.keys.end;
    while (device.end < lines.size() && header_of(code_of(lines[device.end])).rfind("[device.", 0) == 0)
      device.end = end_of_table(lines, device.end + 1);
    return device;
  }
  return std::nullopt;
}

/// Puts a line in place of the one with its key, or behind the last one of the table.
void put(Lines& lines, const Range& table, const std::string& key, const std::string& value) {
  const std::string line = fmt::format("{} = {}", key, value);
  for (std::size_t i = table.begin; i < table.end; ++i) {
    if (key_of(code_of(lines[i])) != key) continue;
    const auto end = end_of_value(lines, i);
    lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                lines.begin() + static_cast<std::ptrdiff_t>(end));
    lines[i] = line;
    return;
  }
  std::size_t at = table.end;
  while (at > table.begin && code_of(lines[at - 1]).empty()) --at;
  lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(at), line);
}

Result<void> put(Lines& lines, const ConfigLine& line) {
  const auto device = find_device(lines, line.device);
  if (!device) return work_error(fmt::format("the configuration has no [[device]] named {}", line.device));
  const auto dot = line.key.find('.');
  if (dot == std::string::npos) {
    put(lines, device->keys, line.key, line.value);
    return {};
  }
  const std::string table = line.key.substr(0, dot);
  const std::string key = line.key.substr(dot + 1);
  for (std::size_t i = device->keys.begin; i < device->keys.end; ++i) {
    const auto found = key_of(code_of(lines[i]));
    if (found == table) {
      return work_error(fmt::format("{} of {} is written in one line", table, line.device),
                        fmt::format("write it as a table, [device.{}], or correct it by hand: {} = {}", table,
                                    key, line.value));
    }
    if (found.rfind(table + '.', 0) != 0) continue;
    put(lines, device->keys, line.key, line.value);
    return {};
  }
  const std::string header = fmt::format("[device.{}]", table);
  for (std::size_t i = device->keys.end; i < device->end; ++i) {
    if (header_of(code_of(lines[i])) != header) continue;
    put(lines, {i + 1, end_of_table(lines, i + 1)}, key, line.value);
    return {};
  }
  // Behind the device's own keys: what follows them may be comments of the next table.
  std::size_t at = device->keys.end;
  while (at > device->keys.begin && code_of(lines[at - 1]).empty()) --at;
  lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(at),
               {header, fmt::format("{} = {}", key, line.value)});
  return {};
}

}  // namespace

Result<std::string> with_lines(const std::string& toml, const std::vector<ConfigLine>& corrected) {
  Lines lines;
  std::istringstream in(toml);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  for (const ConfigLine& line : corrected) {
    if (auto done = put(lines, line); !done) return tl::unexpected<Error>(done.error());
  }
  std::string out;
  for (const auto& line : lines) out += line + '\n';
  return out;
}

std::vector<ConfigLine> lines_of(const std::vector<Finding>& findings) {
  std::vector<ConfigLine> lines;
  for (const Finding& finding : findings)
    lines.insert(lines.end(), finding.mends.begin(), finding.mends.end());
  return lines;
}

}  // namespace imuscope::check
