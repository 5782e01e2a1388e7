#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "check/checks.h"

namespace imuscope::check {

namespace {

constexpr std::size_t kSamplesMin = 500;
/// A signal that reaches the end of its range stays there: so many samples at the very same largest value,
/// ...
constexpr std::size_t kClippedMin = 15;
/// ... of which so many follow one another, ...
constexpr std::size_t kClippedRun = 3;
/// ... and so many times more than just below it, where a signal that is not cut off has more.
constexpr double kPileUp = 3.0;
/// Just below: this share of the signal's range, or its next step.
constexpr double kBelow = 0.002;
constexpr double kSteps = 1.5;
/// White noise of sd s read in steps of q repeats a value with probability q / (2 sqrt(pi) s): half of the
/// samples do where a step is 1.8 sd.
constexpr double kSameShareMax = 0.5;
/// A value held this long is no measurement where other axes measure.
constexpr double kStuck_s = 2.0;
constexpr double kStuckShareMax = 0.02;

std::string axis_words(std::size_t axis) {
  return fmt::format("{} {}", axis < 3 ? "gyro" : "accelerometer",
                     std::string_view("xyzxyz").substr(axis, 1));
}

std::vector<float> axis_of(const ImuTrack& track, std::size_t axis) {
  std::vector<float> values(track.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(axis % 3);
    values[i] = axis < 3 ? track.omega_radps[i][k] : track.f_mps2[i][k];
  }
  return values;
}

/// Whether values pile up at `end`, the largest or smallest of them.
bool piles_up(const std::vector<float>& values, float end, float range, float step) {
  if (range == 0.0F) return false;  // it stands
  const float band = std::max(static_cast<float>(kBelow) * range, static_cast<float>(kSteps) * step);
  std::size_t at_end = 0;
  std::size_t below = 0;
  std::size_t run = 0;
  std::size_t longest = 0;
  for (const float value : values) {
    const bool there = value == end;
    run = there ? run + 1 : 0;
    longest = std::max(longest, run);
    if (there) {
      ++at_end;
    } else if (std::abs(value - end) < band) {
      ++below;
    }
  }
  return at_end >= kClippedMin && longest >= kClippedRun &&
         static_cast<double>(at_end) > kPileUp * static_cast<double>(below);
}

/// Axes with the same trouble, and the largest number of it.
struct Worst {
  std::vector<std::size_t> axes;
  double value = 0.0;
  void add(std::size_t axis, double of_axis) {
    axes.push_back(axis);
    if (std::abs(of_axis) > std::abs(value)) value = of_axis;
  }
  [[nodiscard]] std::string words() const {
    std::string all = axis_words(axes.front());
    for (std::size_t i = 1; i < axes.size(); ++i) {
      all += i + 1 == axes.size() ? " and " : ", ";
      all += std::string_view("xyzxyz").substr(axes[i], 1);
    }
    return all + (axes.size() > 1 ? " are" : " is");
  }
};

struct Held {
  double same_share = 0.0;  ///< of the steps between samples
  std::size_t in_long = 0;  ///< samples held for kStuck_s and longer
  float smallest_step = 0.0F;
};

Held held(const std::vector<float>& values, std::size_t stuck) {
  Held out;
  std::size_t same = 0;
  std::size_t run = 0;
  const auto end_run = [&] {
    if (run >= stuck) out.in_long += run;
    run = 0;
  };
  for (std::size_t i = 1; i < values.size(); ++i) {
    const float step = std::abs(values[i] - values[i - 1]);
    if (step == 0.0F) {
      ++same;
      ++run;
      continue;
    }
    end_run();
    if (out.smallest_step == 0.0F || step < out.smallest_step) out.smallest_step = step;
  }
  end_run();
  const std::size_t moving = values.size() - 1 - out.in_long;
  if (moving > 0) out.same_share = static_cast<double>(same - out.in_long) / static_cast<double>(moving);
  return out;
}

}  // namespace

void check_signals(const Drive& drive, std::size_t device, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[device];
  const ImuTrack& track = drive.imu(device);
  if (track.size() < kSamplesMin) return;
  const auto stuck = static_cast<std::size_t>(kStuck_s * config.rate_hz);
  // One finding for gyros and accelerometers each.
  for (std::size_t first = 0; first < 6; first += 3) {
    const std::string unit = first == 0 ? "rad/s" : "m/s2";
    Worst standing;
    Worst cut_off;
    Worst coarse;
    for (std::size_t axis = first; axis < first + 3; ++axis) {
      const auto values = axis_of(track, axis);
      const auto [low, high] = std::minmax_element(values.begin(), values.end());
      const Held repeats = held(values, stuck);
      const double stuck_share = static_cast<double>(repeats.in_long) / static_cast<double>(values.size());
      const float range = *high - *low;
      if (piles_up(values, *high, range, repeats.smallest_step)) {
        cut_off.add(axis, static_cast<double>(*high));
      } else if (piles_up(values, *low, range, repeats.smallest_step)) {
        cut_off.add(axis, static_cast<double>(*low));
      } else if (repeats.same_share > kSameShareMax) {
        coarse.add(axis, static_cast<double>(repeats.smallest_step));
      } else if (stuck_share > kStuckShareMax) {
        standing.add(axis, 100.0 * stuck_share);
      }
    }
    if (!standing.axes.empty()) {
      findings.push_back({Harm::kWrong,
                          "stuck axis",
                          config.name,
                          standing.words() + " at one value",
                          standing.value,
                          0.0,
                          "% of the time",
                          "look at the sensor and at the columns of its file",
                          {}});
    }
    if (!cut_off.axes.empty()) {
      findings.push_back({Harm::kLimits,
                          "saturation",
                          config.name,
                          cut_off.words() + " cut off at the end of the range",
                          cut_off.value,
                          0.0,
                          unit,
                          "set the sensor to a larger range, or fasten it where it shakes less",
                          {}});
    }
    if (!coarse.axes.empty()) {
      findings.push_back({Harm::kLimits,
                          "quantisation",
                          config.name,
                          coarse.words() + " written in steps coarser than the noise",
                          coarse.value,
                          0.0,
                          unit,
                          "write more digits, or choose a smaller range of the sensor",
                          {}});
    }
  }
  constexpr double kClippedShareMax = 1e-3;
  if (static_cast<double>(track.clipped) > kClippedShareMax * static_cast<double>(track.size())) {
    findings.push_back({Harm::kLimits,
                        "saturation",
                        config.name,
                        "it says that it is at the end of its range",
                        100.0 * static_cast<double>(track.clipped) / static_cast<double>(track.size()),
                        0.0,
                        "% of the samples",
                        "set the sensor to a larger range, or fasten it where it shakes less",
                        {}});
  }
}

}  // namespace imuscope::check
