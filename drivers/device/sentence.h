#pragma once

/// A sentence for a person, kept in place. Core: no allocation.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <utility>

namespace imuscope {

class Sentence {
 public:
  /// Formats anew; what does not fit is cut off.
  template <typename... Args>
  void say(fmt::format_string<Args...> text, Args&&... args) noexcept {
    const auto result = fmt::format_to_n(text_.data(), text_.size(), text, std::forward<Args>(args)...);
    size_ = std::min(result.size, text_.size());
  }
  void clear() noexcept { size_ = 0; }
  [[nodiscard]] std::string_view view() const noexcept { return {text_.data(), size_}; }

 private:
  std::array<char, 200> text_{};
  std::size_t size_ = 0;
};

}  // namespace imuscope
