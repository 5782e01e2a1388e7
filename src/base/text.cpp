#include "base/text.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <system_error>

#include "base/contracts.h"
#include "base/missing_file.h"

namespace imuscope {
namespace {

constexpr std::uint32_t kFirstPrintable = 0x20;
constexpr std::uint32_t kDelete = 0x7F;
constexpr std::uint32_t kLastC1 = 0x9F;
constexpr std::uint32_t kFirstSurrogate = 0xD800;
constexpr std::uint32_t kLastSurrogate = 0xDFFF;
constexpr std::uint32_t kLastCharacter = 0x10FFFF;

struct Character {
  std::uint32_t code;
  std::size_t length;  ///< bytes; 0: the bytes are no character
};

Character character_at(std::string_view text) {
  const auto byte = [text](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC0 || lead >= 0xF8 || text.size() < length) return {0, 0};
  std::uint32_t code = lead & (0x7FU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0U) != 0x80) return {0, 0};
    code = code << 6U | (byte(i) & 0x3FU);
  }
  // A character has one encoding, the shortest.
  constexpr std::uint32_t kSmallest[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= kFirstSurrogate && code <= kLastSurrogate;
  return {code, code < kSmallest[length] || code > kLastCharacter || surrogate ? 0 : length};
}

bool acts_on_terminal(std::uint32_t code) {
  return code < kFirstPrintable || (code >= kDelete && code <= kLastC1);
}

}  // namespace

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = character_at(text).length;
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string printable(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const Character character = character_at(text);
    if (character.length == 0 || acts_on_terminal(character.code)) {
      result += '?';
    } else {
      result += text.substr(0, character.length);
    }
    text.remove_prefix(std::max<std::size_t>(character.length, 1));
  }
  return result;
}

std::string one_line(std::string_view text, std::size_t longest) {
  std::string line = printable(text);
  if (line.size() <= longest) return line;
  std::size_t end = longest;
  while (end > 0 && (static_cast<std::uint8_t>(line[end]) & 0xC0U) == 0x80) --end;
  line.resize(end);
  return line;
}

bool is_device_name(std::string_view text) {
  const auto is_of_a_name = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  return !text.empty() && text.size() <= kDeviceNameMax &&
         std::all_of(text.begin(), text.end(), is_of_a_name);
}

std::string device_file_name(std::string_view stem, std::string_view name, std::string_view suffix) {
  IMUSCOPE_EXPECTS(is_device_name(name));
  std::string file(stem);
  return file.append(1, '_').append(name).append(suffix);
}

Result<std::string> read_text_file(const std::filesystem::path& file, std::string_view what,
                                   const std::string& remedy) {
  const std::string name = std::string(what) + " " + file.string();
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status)) return tl::unexpected<Error>(explain_missing(name, error, remedy));
  if (std::filesystem::is_directory(status)) return usage_error(name + " is a folder", remedy);
  if (!std::filesystem::is_regular_file(status))
    return usage_error(name + " is a device or a pipe, not a file", remedy);
  const auto size = std::filesystem::file_size(file, error);
  if (error || size > kTextFileMax)
    return usage_error(name + " is larger than 64 MiB, which no such file is", remedy);
  std::ifstream in(file, std::ios::binary);
  if (!in) return usage_error(name + " cannot be read: " + std::strerror(errno), "check its permissions");
  std::string text(size, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (in.bad())
    return usage_error(name + " cannot be read: " + std::strerror(errno), "check its permissions");
  text.resize(static_cast<std::size_t>(in.gcount()));
  return text;
}

}  // namespace imuscope
