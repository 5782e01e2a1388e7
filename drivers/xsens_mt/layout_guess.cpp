#include "drivers/xsens_mt/layout_guess.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace imuscope::xsens {
namespace {

constexpr double kUnitTolerance = 1e-3;
// Ranges of an MTx on a vehicle, wide.
constexpr double kOrdinaryForceMin_mps2 = 0.5;
constexpr double kOrdinaryForceMax_mps2 = 200.0;
constexpr double kOrdinaryRateMax_radps = 40.0;
constexpr double kFieldMin_au = 0.05;
constexpr double kFieldMax_au = 10.0;
constexpr double kVelocityMax_mps = 200.0;

// What speaks for a layout, per message. Structure that numbers have by chance hardly ever counts most.
constexpr double kUnitLength = 8.0;
constexpr double kCounts = 4.0;
constexpr double kPlausible = 1.0;
// Of three numbers alone, the sensor that is more likely to be asked for.
constexpr double kForcePlausible = 1.2;
constexpr double kRatePlausible = 1.1;
// Three small numbers may always be angles, and two bytes anything: the sample counter comes from the
// factory.
constexpr double kAnglesPlausible = 0.8;
constexpr double kHasCounter = 0.3;
constexpr double kNavigationPlausible = 0.7;  // an MTi-G only
// What speaks against it: each field that it needs to fill the length, so that of two readings that both make
// sense the simpler one wins.
constexpr double kPerField = 0.6;

template <std::size_t N>
double norm(const std::array<double, N>& v) {
  double sum = 0.0;
  for (const double x : v) sum += x * x;
  return std::sqrt(sum);
}
bool is_within(double value, double low, double high) {
  return value >= low && value <= high;
}  // false for NaN

/// Bytes of something else read as float32 are often next to nothing. What a sensor measures is zero or more.
template <std::size_t N>
bool is_measured(const std::array<double, N>& v) {
  constexpr double kNextToNothing = 1e-15;
  return std::none_of(v.begin(), v.end(),
                      [](double x) { return x != 0.0 && !(std::abs(x) > kNextToNothing); });
}

bool is_rotation(const std::array<double, 9>& m) {
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = i; j < 3; ++j) {
      const double dot = m[3 * i] * m[3 * j] + m[3 * i + 1] * m[3 * j + 1] + m[3 * i + 2] * m[3 * j + 2];
      if (!is_within(dot - (i == j ? 1.0 : 0.0), -kUnitTolerance, kUnitTolerance)) return false;
    }
  }
  return true;
}

/// Nothing where the message cannot be this.
std::optional<double> orientation_score(const MtData& m) {
  if (m.has(Field::kQuaternion)) {
    if (!is_within(norm(m.quaternion), 1.0 - kUnitTolerance, 1.0 + kUnitTolerance)) return std::nullopt;
    return kUnitLength;
  }
  if (m.has(Field::kMatrix)) {
    if (!is_rotation(m.matrix_as_sent)) return std::nullopt;
    return kUnitLength;
  }
  if (m.has(Field::kEuler)) {
    const auto& e = m.euler_deg;
    if (!is_within(std::abs(e[0]), 0.0, 180.0) || !is_within(std::abs(e[1]), 0.0, 90.0)) return std::nullopt;
    if (!is_within(std::abs(e[2]), 0.0, 180.0) || norm(e) < 1e-6 || !is_measured(e)) return std::nullopt;
    return kAnglesPlausible;
  }
  return 0.0;
}

std::optional<double> score(const MtData& m) {
  const auto orientation = orientation_score(m);
  if (!orientation) return std::nullopt;
  double sum = *orientation;
  bool possible = true;
  const auto check = [&](Field field, bool plausible, double weight = kPlausible) {
    if (!m.has(field)) return;
    possible = possible && plausible;
    sum += weight;
  };
  check(Field::kAcceleration,
        is_measured(m.acceleration_mps2) &&
            is_within(norm(m.acceleration_mps2), kOrdinaryForceMin_mps2, kOrdinaryForceMax_mps2),
        kForcePlausible);
  check(Field::kRate, is_measured(m.rate_radps) && norm(m.rate_radps) < kOrdinaryRateMax_radps,
        kRatePlausible);
  check(Field::kMagneticField,
        is_measured(m.field_au) && is_within(norm(m.field_au), kFieldMin_au, kFieldMax_au));
  check(Field::kTemperature,
        is_within(m.temperature_degc, -55.0, 125.0) && std::abs(m.temperature_degc) > 1e-6);
  check(Field::kPosition,
        is_within(m.position[0], -90.0, 90.0) && is_within(m.position[1], -180.0, 360.0) &&
            is_within(m.position[2], -500.0, 20000.0) && norm(m.position) > 1e-6 && is_measured(m.position),
        kNavigationPlausible);
  check(Field::kVelocity, is_measured(m.velocity_mps) && norm(m.velocity_mps) < kVelocityMax_mps,
        kNavigationPlausible);
  check(Field::kStatus, m.status < 8);
  check(Field::kUtc, utc_ns(m.utc).has_value());
  if (!possible) return std::nullopt;
  if (m.has(Field::kCounter)) sum += kHasCounter;
  return sum;
}

int count_fields(std::uint32_t fields) {
  int n = 0;
  for (; fields != 0; fields &= fields - 1U) ++n;
  return n;
}

/// Sum over the messages; nothing where one of them cannot be this.
std::optional<double> score(const std::vector<std::span<const std::uint8_t>>& messages,
                            const DataLayout& layout) {
  double sum = 0.0;
  MtData message;
  std::uint16_t counter = 0;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    if (!read_mtdata(messages[i], layout, message)) return std::nullopt;
    const auto one = score(message);
    if (!one) return std::nullopt;
    const auto step = static_cast<std::uint16_t>(message.counter - counter);
    const bool counts = i > 0 && message.has(Field::kCounter) && step > 0 && step < 16;
    sum += *one + (counts ? kCounts : 0.0) - kPerField * count_fields(message.fields);
    counter = message.counter;
  }
  return sum;
}

}  // namespace

std::optional<DataLayout> guess_layout(const std::vector<std::span<const std::uint8_t>>& messages) {
  if (messages.empty()) return std::nullopt;
  constexpr std::array<std::uint16_t, 8> kModeBits{
      output_mode::kTemperature, output_mode::kCalibrated, output_mode::kOrientation, output_mode::kAuxiliary,
      output_mode::kPosition,    output_mode::kVelocity,   output_mode::kStatus,      output_mode::kRaw};
  std::optional<DataLayout> best;
  double best_score = 0.0;
  const auto consider = [&](const DataLayout& layout) {
    const auto length = data_length(layout);
    if (!length || *length != messages[0].size()) return;
    const auto sum = score(messages, layout);
    if (!sum || (best && *sum <= best_score)) return;
    best = layout;
    best_score = *sum;
  };
  for (unsigned modes = 1; modes < 1U << kModeBits.size(); ++modes) {
    DataLayout layout;
    for (std::size_t i = 0; i < kModeBits.size(); ++i) {
      if ((modes >> i & 1U) != 0) layout.mode = static_cast<std::uint16_t>(layout.mode | kModeBits[i]);
    }
    const bool calibrated = (layout.mode & output_mode::kCalibrated) != 0;
    const bool oriented = (layout.mode & output_mode::kOrientation) != 0;
    const bool auxiliary = (layout.mode & output_mode::kAuxiliary) != 0;
    for (std::uint32_t stamp = 0; stamp < 4; ++stamp) {
      for (std::uint32_t format = 0; format < 4; ++format) {
        for (std::uint32_t orientation = 0; orientation < (oriented ? 3U : 1U); ++orientation) {
          for (std::uint32_t off = 0; off < (calibrated ? 7U : 1U); ++off) {
            for (std::uint32_t no_analogue = 0; no_analogue < (auxiliary ? 3U : 1U); ++no_analogue) {
              layout.settings = stamp | orientation << 2U | off << 4U |
                                format << output_settings::kFormatShift | no_analogue << 10U;
              consider(layout);
            }
          }
        }
      }
    }
  }
  return best;
}

}  // namespace imuscope::xsens
