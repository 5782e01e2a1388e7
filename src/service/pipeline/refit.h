#pragma once

/// What a refit of the noise models says. Non-real-time.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "models/noise/fit.h"
#include "models/noise/wavelet_variance.h"
#include "sample/regime.h"
#include "sample/utc_scale.h"
#include "service/pipeline/motion_book.h"

namespace imuscope {

/// One axis in one regime.
struct AxisRefit {
  std::size_t axis = 0;  ///< 0 to 5, see noise_series.h
  Regime regime{};
  double rate_hz = 0.0;
  noise::WaveletVariance wv;
  std::optional<noise::FitResult> fit;  ///< absent where none could be made
  std::optional<noise::JTest> change;   ///< distance of what is new from the model before; not at the first
  bool changed = false;                 ///< the distance is none of chance
};

/// Wavelet variances, models and motion of one S-IMU.
struct Refit {
  std::size_t study = 0;
  std::string name;  ///< of the S-IMU
  HostTime time{};   ///< of the last sample used
  UtcStamp utc{};    ///< of the same
  HostTime first_reference_time{};
  std::vector<AxisRefit> axes;
  MotionSummary motion;
  std::int64_t samples = 0;  ///< of the error process so far
  double duration_s = 0.0;
};

}  // namespace imuscope
