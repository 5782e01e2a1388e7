/// Models of real sensors, none of which is right.

#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "models/noise/lines.h"
#include "models/noise/select.h"
#include "oracle_files.h"

namespace imuscope::noise {
namespace {

constexpr double kAdisRate_hz = 100.0;

bool is_part(const ModelSpec& part, const ModelSpec& whole) {
  return part.processes.size() < whole.processes.size() &&
         std::ranges::all_of(part.processes,
                             [&](ProcessKind kind) { return part.count(kind) <= whole.count(kind); });
}

class RealSensors : public ::testing::TestWithParam<const char*> {};

TEST_P(RealSensors, NoModelIsFurtherFromTheDataThanAPartOfIt) {
  std::vector<double> x = test::read_series(GetParam());
  if (x.empty()) GTEST_SKIP() << GetParam() << " is kept beside the checkout";
  const std::vector<std::uint8_t> mask(x.size(), 1);
  LineOptions options;
  options.rate_hz = kAdisRate_hz;
  remove_lines(x, mask, find_lines(x, mask, options), kAdisRate_hz);
  const auto wv = haar_wavelet_variance(x).value();
  const auto ranked = rank_models(wv, parse_model("QN+WN+2*GM+RW").value(), kAdisRate_hz).value();
  for (const RankedModel& whole : ranked) {
    for (const RankedModel& part : ranked) {
      if (!is_part(part.fit.spec, whole.fit.spec)) continue;
      constexpr double kSolver = 1e-3;
      EXPECT_LE(whole.fit.model_error, part.fit.model_error * (1.0 + kSolver))
          << whole.fit.spec.name() << " beside " << part.fit.spec.name();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Adis16405, RealSensors,
                         ::testing::Values("adis16405_imu1_gyroX", "adis16405_imu1_gyroY",
                                           "adis16405_imu1_gyroZ", "adis16405_imu1_accX",
                                           "adis16405_imu1_accY", "adis16405_imu1_accZ"));

}  // namespace
}  // namespace imuscope::noise
