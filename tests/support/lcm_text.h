#pragma once

/// An encoded message of the bus as text, field by field, by the .lcm files themselves: for answers that are held
/// whole (recorded_answer.h).

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/support/shared_data.h"

namespace imuscope::test {

class LcmText {
 public:
  LcmText() {
    for (const auto& file : std::filesystem::directory_iterator(source_path("src/publish/lcm")))
      if (file.path().extension() == ".lcm") read(file.path());
  }

  /// @param type     such as "status_t"
  /// @param message  with the fingerprint that it begins with
  [[nodiscard]] std::string text(const std::string& type, std::span<const std::uint8_t> message) const {
    constexpr std::size_t kFingerprintBytes = 8;
    std::string out = type + ':';
    auto rest = message.subspan(kFingerprintBytes);
    append(type, rest, out, "  ");
    if (!rest.empty()) out += " and more";
    return out + '\n';
  }

 private:
  struct Field {
    std::string type;
    std::string name;
    std::vector<std::string> lengths;  ///< empty: no array
  };

  void read(const std::filesystem::path& path) {
    std::ifstream file(path);
    std::vector<Field>* fields = nullptr;
    for (std::string line; std::getline(file, line);) {
      line.erase(std::min(line.find("//"), line.size()));
      for (char& c : line)
        if (c == ';' || c == '[' || c == ']' || c == '{') c = ' ';
      std::istringstream words(line);
      Field field;
      words >> field.type >> field.name;
      for (std::string length; words >> length;) field.lengths.push_back(length);
      if (field.type == "struct") {
        fields = &types_[field.name];
      } else if (fields != nullptr && !field.name.empty() && field.type != "const") {
        fields->push_back(field);
      }
    }
  }

  static std::uint64_t take(std::span<const std::uint8_t>& rest, std::size_t n) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < n; ++i) value = value << 8U | rest[i];
    rest = rest.subspan(n);
    return value;
  }

  /// In groups of three digits: a comparison of numbers looks at six of them.
  static std::string whole_number(std::int64_t value) {
    std::string digits = std::to_string(value);
    for (std::size_t at = digits.size(); at > 3 + (value < 0 ? 1U : 0U); at -= 3) digits.insert(at - 3, "_");
    return digits;
  }

  std::int64_t append(const std::string& type, std::span<const std::uint8_t>& rest, std::string& out,
                      const std::string& indent) const {
    static const std::map<std::string, std::size_t> kWhole{{"int8_t", 1},  {"byte", 1},    {"boolean", 1},
                                                           {"int16_t", 2}, {"int32_t", 4}, {"int64_t", 8}};
    if (const auto found = kWhole.find(type); found != kWhole.end()) {
      const unsigned unused = 64U - 8U * static_cast<unsigned>(found->second);
      const auto value = static_cast<std::int64_t>(take(rest, found->second) << unused) >> unused;
      out += ' ' + whole_number(value);
      return value;
    }
    if (type == "double" || type == "float") {
      const double value = type == "double" ? std::bit_cast<double>(take(rest, 8))
                                            : std::bit_cast<float>(static_cast<std::uint32_t>(take(rest, 4)));
      out += std::isnan(value) ? " nan" : fmt::format(" {:.9g}", value);
    } else if (type == "string") {
      const std::uint64_t size = take(rest, 4);
      out += fmt::format(" '{}'",
                         std::string(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(size) - 1));
      rest = rest.subspan(size);
    } else {
      append_fields(type, rest, out, indent);
    }
    return 0;
  }

  void append_fields(const std::string& type, std::span<const std::uint8_t>& rest, std::string& out,
                     const std::string& indent) const {
    std::map<std::string, std::int64_t> counts;
    for (const Field& field : types_.at(type)) {
      out += '\n' + indent + field.name;
      std::int64_t n = 1;
      for (const std::string& length : field.lengths) {
        const auto counted = counts.find(length);
        n *= counted != counts.end() ? counted->second : std::stoll(length);
      }
      for (std::int64_t i = 0; i < n; ++i) counts[field.name] = append(field.type, rest, out, indent + "  ");
    }
  }

  std::map<std::string, std::vector<Field>> types_;
};

/// One message that is not encoded yet.
template <typename Message>
std::string lcm_text(const LcmText& reader, const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return reader.text(Message::getTypeName(), bytes);
}

}  // namespace imuscope::test
