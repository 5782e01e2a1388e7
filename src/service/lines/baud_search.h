#pragma once

/// The baud rate to try next on a line whose device does not answer at the configured one.

#include <array>
#include <cstddef>
#include <cstdint>

namespace imuscope {

class BaudSearch {
 public:
  explicit BaudSearch(std::uint32_t configured = 0) noexcept : configured_(configured) {}

  [[nodiscard]] std::uint32_t current() const noexcept {
    return tried_ == 0 ? configured_ : kRates[tried_ - 1];
  }
  /// The rate is not the configured one.
  [[nodiscard]] bool searching() const noexcept { return current() != configured_; }

  /// Every rate has been tried: from now on the search repeats itself.
  [[nodiscard]] bool repeats() const noexcept { return repeats_; }

  /// Goes on to the next rate: after the configured one the others, and round again.
  void next() noexcept {
    tried_ = (tried_ + 1) % (kRates.size() + 1);
    repeats_ = repeats_ || tried_ == 0;
    if (tried_ > 0 && current() == configured_) next();
  }

 private:
  /// Most usual first. The devices' own tables know no others.
  static constexpr auto kRates = std::to_array<std::uint32_t>(
      {115200, 460800, 230400, 921600, 57600, 38400, 19200, 9600, 2000000, 76800, 28800, 14400, 4800});

  std::uint32_t configured_;
  bool repeats_ = false;
  std::size_t tried_ = 0;  ///< of kRates, plus the configured one
};

}  // namespace imuscope
