#include "firmware_sim/random/random.h"

#include <cmath>

namespace imusim {
namespace {

/// FNV-1a, 64 bit, over the stream's name, started from the seed: unrelated seeds for the engine.
std::uint64_t stream_seed(std::uint64_t seed, std::string_view stream) {
  constexpr std::uint64_t kOffsetBasis = 0xcbf29ce484222325ULL;
  constexpr std::uint64_t kPrime = 0x100000001b3ULL;
  std::uint64_t hash = kOffsetBasis;
  for (unsigned shift = 0; shift < 64; shift += 8) hash = (hash ^ ((seed >> shift) & 0xFFU)) * kPrime;
  for (const char letter : stream) hash = (hash ^ static_cast<unsigned char>(letter)) * kPrime;
  return hash;
}

}  // namespace

Random::Random(std::uint64_t seed, std::string_view stream) : engine_(stream_seed(seed, stream)) {}

double Random::uniform() {
  constexpr double kStep = 0x1.0p-53;
  return static_cast<double>(engine_() >> 11U) * kStep;
}

// Marsaglia's polar method: the standard leaves std::normal_distribution's algorithm open, this one is fixed.
double Random::normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  double x = 0.0;
  double y = 0.0;
  double square = 0.0;
  do {
    x = uniform(-1.0, 1.0);
    y = uniform(-1.0, 1.0);
    square = x * x + y * y;
  } while (square >= 1.0 || square == 0.0);
  const double factor = std::sqrt(-2.0 * std::log(square) / square);
  spare_ = y * factor;
  has_spare_ = true;
  return x * factor;
}

}  // namespace imusim
