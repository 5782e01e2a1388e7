#pragma once

/// What a fuzz target that forges records makes of its input: choices, and values that programs stumble over.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace imuscope::fuzz {

/// Choices in the order of the input's bytes; zeros after its end.
class Choices {
 public:
  explicit Choices(std::span<const std::uint8_t> input) : rest_(input) {}
  [[nodiscard]] bool at_end() const { return rest_.empty(); }

  std::uint8_t byte() {
    if (rest_.empty()) return 0;
    const std::uint8_t first = rest_[0];
    rest_ = rest_.subspan(1);
    return first;
  }
  std::uint32_t word() {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < sizeof value; ++i) value = value << 8U | byte();
    return value;
  }
  /// 0 .. n - 1
  std::size_t below(std::size_t n) { return n <= 256 ? byte() % n : word() % n; }

  /// One that is at the edge of a type, of a range or of what a double holds; or any.
  std::int64_t integer() {
    constexpr std::array<std::int64_t, 16> kEdges{0,
                                                  1,
                                                  -1,
                                                  2,
                                                  64,
                                                  255,
                                                  65'536,
                                                  2'000'000'000,
                                                  std::int64_t{1} << 31U,
                                                  -(std::int64_t{1} << 31U),
                                                  std::int64_t{1} << 53U,
                                                  (std::int64_t{1} << 62U) - 1,
                                                  -(std::int64_t{1} << 62U) + 1,
                                                  std::numeric_limits<std::int64_t>::max(),
                                                  std::numeric_limits<std::int64_t>::min(),
                                                  86'399'000'000'000};
    const std::size_t which = below(kEdges.size() + 1);
    if (which < kEdges.size()) return kEdges[which];
    return static_cast<std::int64_t>(std::uint64_t{word()} << 32U | word());
  }
  double real() {
    constexpr std::array kEdges{0.0,  -0.0,  1.0,   -1.0, 1e-300, 1e300,
                                1e19, -1e19, 2.0e9, 1e-9, 0.5,    std::numeric_limits<double>::denorm_min()};
    const std::size_t which = below(kEdges.size() + 1);
    if (which < kEdges.size()) return kEdges[which];
    return std::bit_cast<double>(std::uint64_t{word()} << 32U | word());
  }
  std::string text() {
    static const std::array<std::string, 16> kTexts{"",
                                                    "static",
                                                    "mtx1",
                                                    "all",
                                                    "gyro_x",
                                                    "../../x",
                                                    "\xff\xfe",
                                                    "a\x1b[2J\nb",
                                                    "calm\n!command",
                                                    "'`command`'",
                                                    "<script>x</script>",
                                                    "WN+2*GM+SIN",
                                                    "__proto__",
                                                    std::string(5'000, 'x'),
                                                    std::string(300, '['),
                                                    "rad/s"};
    const std::size_t which = below(kTexts.size() + 1);
    if (which < kTexts.size()) return kTexts[which];
    std::string any;
    for (std::size_t n = below(32); n > 0; --n) any += static_cast<char>(byte());
    return any;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

/// Anything that a JSON document may hold in one place.
inline nlohmann::json forged_value(Choices& choices) {
  switch (choices.below(8)) {
    case 0:
      return nullptr;
    case 1:
      return choices.byte() % 2 == 0;
    case 2:
      return choices.integer();
    case 3:
    case 4:
      return choices.real();
    case 5:
      return nlohmann::json::array();
    case 6:
      return nlohmann::json::object();
    default:
      return choices.text();
  }
}

/// Changes one place of the document: another value there, a member or an element less, or one twice.
inline void forge(nlohmann::json& value, Choices& choices) {
  nlohmann::json* at = &value;
  for (;;) {
    const bool is_inner = at->is_structured() && !at->empty();
    if (!is_inner) {
      *at = forged_value(choices);
      return;
    }
    const std::size_t which = choices.below(at->size());
    auto place = at->begin();
    std::advance(place, static_cast<std::ptrdiff_t>(which));
    switch (choices.below(16)) {
      case 0:
        at->erase(place);
        return;
      case 1:
        if (at->is_array()) at->push_back(*place);
        return;
      case 2:
        *place = forged_value(choices);
        return;
      default:
        at = &*place;
    }
  }
}

}  // namespace imuscope::fuzz
