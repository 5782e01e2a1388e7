#pragma once

/// Seeded randomness of the simulator. Every source of randomness is a stream of its own, named, so that one
/// more device or one more noise process changes nothing in the others: same seed, same bytes.

#include <cstdint>
#include <random>
#include <string_view>

namespace imusim {

/// Uniform and normal draws, the same for every standard library. Not thread-safe; one per stream.
class Random {
 public:
  /// @param seed    of the run
  /// @param stream  what the draws are for, such as "mtx1/gyro"
  Random(std::uint64_t seed, std::string_view stream);

  /// Uniform in [0, 1).
  double uniform();
  /// Uniform in [low, high).
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Normal with zero mean and unit variance.
  double normal();
  /// Any value of 32 bits.
  std::uint32_t bits() { return static_cast<std::uint32_t>(engine_() >> 32U); }

 private:
  std::mt19937_64 engine_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace imusim
