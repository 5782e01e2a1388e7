#pragma once

/// The vehicle's state to which a sample belongs. Measurement noise, error process and noise models are kept
/// apart by it.

#include <cstddef>
#include <cstdint>

namespace imuscope {

enum class Regime : std::uint8_t { kStatic, kDynamic };
inline constexpr std::size_t kRegimeCount = 2;

/// "static" or "dynamic", as in files and messages.
constexpr const char* regime_name(Regime regime) noexcept {
  return regime == Regime::kStatic ? "static" : "dynamic";
}

}  // namespace imuscope
