/// Time of a fit in C++, for tools/python/fit_cost, which has the same fit made from NumPy.
/// Usage: fit_cost FILE RATE_HZ MODEL TIMES       FILE: little-endian float64

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <vector>

#include "models/noise/fit.h"
#include "models/noise/signal.h"

namespace {

constexpr int kArguments = 5;

/// @return false where the signal cannot be fitted
bool fit(const std::vector<double>& x, double rate_hz, const imuscope::noise::ModelSpec& spec) {
  using namespace imuscope::noise;
  const auto look = look_at_signal(x, {}, rate_hz, Lines::kTakenOut);
  if (!look) return false;
  FitOptions options;
  options.intervals = Intervals::kInverted;
  return imuscope::noise::fit(look->wv, spec, rate_hz, options).has_value();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != kArguments) return 2;
  std::error_code failed;
  std::vector<double> x(std::filesystem::file_size(argv[1], failed) / sizeof(double));
  std::ifstream file(argv[1], std::ios::binary);
  if (failed ||
      !file.read(reinterpret_cast<char*>(x.data()), static_cast<std::streamsize>(x.size() * sizeof(double))))
    return 2;
  const auto spec = imuscope::noise::parse_model(argv[3]);
  if (!spec) return 2;
  for (int i = 0; i < std::atoi(argv[4]); ++i) {
    const auto begin = std::chrono::steady_clock::now();
    if (!fit(x, std::atof(argv[2]), *spec)) return 1;
    std::printf("%.6f\n", std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  return 0;
}
