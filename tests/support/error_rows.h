#pragma once

/// Rows of error processes that are white noise, and models that are fed with them.

#include <gtest/gtest.h>

#include <optional>
#include <random>
#include <string>
#include <utility>

#include "configuration/config.h"
#include "service/pipeline/model_book.h"
#include "tests/support/two_devices.h"

namespace imuscope::test {

inline Configuration two_devices() {
  return *parse_configuration(std::string("[noise]\nrefit_interval_s = 10.0\n") + kTwoDevices, "test.toml");
}

inline ErrorRow row_of(std::int64_t counter, Regime regime, std::mt19937& random) {
  std::normal_distribution<double> normal;
  ErrorRow row{};
  row.counter = counter;
  row.regime = regime;
  row.gyro_valid = row.accel_valid = true;
  for (auto* triad : {&row.e_gyro_radps, &row.e_accel_mps2}) {
    for (double& e : *triad) e = normal(random);
  }
  return row;
}

/// Feeds `seconds_of_rows` seconds of 100 Hz rows of sd `sd` and returns the refit at their end, which is due.
inline Refit fed(ModelBook& book, std::int64_t& counter, int seconds_of_rows, double sd,
                 std::mt19937& random) {
  for (int i = 0; i < 100 * seconds_of_rows; ++i) {
    auto row = row_of(counter++, Regime::kStatic, random);
    for (auto* triad : {&row.e_gyro_radps, &row.e_accel_mps2}) {
      for (double& e : *triad) e *= sd;
    }
    book.add({0, HostTime{}, row}, row.regime);
  }
  auto refit = book.refit();
  EXPECT_TRUE(refit);
  return refit ? std::move(*refit) : Refit{};
}

}  // namespace imuscope::test
