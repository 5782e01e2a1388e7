#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "base/units.h"
#include "check/bins.h"
#include "check/checks.h"

namespace imuscope::check {

namespace {

/// Means over this time: what a vehicle does on the road averages out to a few per cent of gravity.
constexpr int kGravityMeanBins = 11;
/// Consumer accelerometers are off by up to 3 % in scale and 0.1 g in bias (data sheets of the MPU-6050,
/// BMI160, LSM6DS3 classes); recorded ones by 2 to 5 %.
constexpr double kNormTolerance = 0.1;
constexpr std::size_t kGravityBinsMin = 50;
constexpr double kGravityUnitTolerance = 0.15;
/// Of gravity's size: below it is not in the data.
constexpr double kNoGravity = 0.3;

/// What a norm is in units of gravity, if a unit explains it.
struct GravityUnit {
  double factor;  ///< of the norm
  const char* what;
  const char* accel_unit;  ///< that mends it; null where none does
};
constexpr std::array kUnits{
    GravityUnit{1.0 / kMps2PerG, "its accelerometers are in g, read as m/s2", "g"},
    GravityUnit{kMps2PerG, "its accelerometers are in m/s2, read as g", "m/s2"},
    GravityUnit{1e3 / kMps2PerG, "its accelerometers are in thousandths of g, read as m/s2", nullptr},
    GravityUnit{1e3, "its accelerometers are in mm/s2 or thousandths of g, read a thousand times too large",
                nullptr}};

/// The median length of a triad's means; nothing where there are too few.
std::optional<double> median_norm(const ImuBins& bins, const std::vector<Eigen::Vector3d>& triad) {
  std::vector<double> norms;
  for (std::size_t i = 0; i < bins.valid.size(); ++i) {
    if (bins.valid[i]) norms.push_back(triad[i].norm());
  }
  if (norms.size() < kGravityBinsMin) return std::nullopt;
  const auto middle = norms.begin() + static_cast<std::ptrdiff_t>(norms.size() / 2);
  std::nth_element(norms.begin(), middle, norms.end());
  return *middle;
}

/// The rates are of gravity's size, and the forces are not: in m/s2, or in g.
bool are_exchanged(double rates, double forces) {
  const auto is_gravity = [](double size) {
    return std::abs(size / kMps2PerG - 1.0) < kNormTolerance || std::abs(size - 1.0) < kNormTolerance;
  };
  return is_gravity(rates) && !is_gravity(forces) && forces < kNoGravity * kMps2PerG;
}

std::string columns_of(const std::array<std::string, 3>& columns) {
  return fmt::format("[\"{}\"]", fmt::join(columns, "\", \""));
}

void report_exchanged(const DeviceConfig& config, ImuTrack& track, double rates,
                      std::vector<Finding>& findings) {
  Finding finding{Harm::kWrong,
                  "gyros and accelerometers",
                  config.name,
                  "its gyros show gravity: gyros and accelerometers are exchanged",
                  rates,
                  0.0,
                  "rad/s by its gyros",
                  "exchange them where they are written",
                  {}};
  if (traits_of(config.protocol).is_text) {
    const std::string gyro = columns_of(config.csv.accel_columns);
    const std::string accel = columns_of(config.csv.gyro_columns);
    finding.remedy = fmt::format("write gyro_columns = {} and accel_columns = {}", gyro, accel);
    finding.mends = {{config.name, "csv.gyro_columns", gyro}, {config.name, "csv.accel_columns", accel}};
  }
  std::swap(track.omega_radps, track.f_mps2);
  findings.push_back(std::move(finding));
}

}  // namespace

std::string divide_by_the_time_of_a_sample(const DeviceConfig& config) {
  return fmt::format("divide them by the time of a sample (1/{:g} s) where they are written", config.rate_hz);
}

void check_gravity_norm(Drive& drive, std::size_t device, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[device];
  ImuTrack& track = drive.imu(device);
  const ImuBins bins = bins_of(track, kGravityMeanBins);
  const auto rates = median_norm(bins, bins.omega_radps);
  const auto forces = median_norm(bins, bins.f_mps2);
  if (!rates || !forces) return;
  if (are_exchanged(*rates, *forces)) {
    report_exchanged(config, track, *rates, findings);
    return;
  }
  const double ratio = *forces / kMps2PerG;
  if (std::abs(ratio - 1.0) < kNormTolerance) return;
  Finding finding{Harm::kWrong, "gravity norm", config.name, {}, *forces, kMps2PerG, "m/s2", {}, {}};
  if (std::abs(ratio * config.rate_hz - 1.0) < kGravityUnitTolerance) {
    // What a sample adds: inertial units that deliver increments in place of means.
    finding.what = "its forces are increments of velocity from sample to sample";
    finding.remedy = divide_by_the_time_of_a_sample(config);
    for (Eigen::Vector3f& f : track.f_mps2) f *= static_cast<float>(config.rate_hz);
    findings.push_back(std::move(finding));
    return;
  }
  for (const GravityUnit& unit : kUnits) {
    if (std::abs(ratio / unit.factor - 1.0) > kGravityUnitTolerance) continue;
    finding.what = unit.what;
    const bool text = traits_of(config.protocol).is_text && unit.accel_unit != nullptr;
    finding.remedy = text ? fmt::format("write accel_unit = \"{}\" in its [device.csv]", unit.accel_unit)
                          : "convert them to m/s2 where they are written";
    if (text)
      finding.mends.push_back({config.name, "csv.accel_unit", fmt::format("\"{}\"", unit.accel_unit)});
    for (Eigen::Vector3f& f : track.f_mps2) f /= static_cast<float>(unit.factor);
    findings.push_back(std::move(finding));
    return;
  }
  if (ratio < kNoGravity) {
    finding.what = "its accelerometers do not show gravity: it was taken out (\"linear acceleration\")";
    finding.remedy = "record the specific force with gravity in it";
  } else {
    finding.what = "its accelerometers show gravity of a wrong size";
    finding.remedy = "check the unit and scale of its accelerometers (accel_unit, accel_columns)";
  }
  findings.push_back(std::move(finding));
}

ReferenceAxes reference_down(const Drive& drive) {
  ReferenceAxes axes;
  const ImuTrack& track = drive.imu(drive.configuration().reference_index());
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& f : track.f_mps2) sum += f.cast<double>();
  if (sum.norm() > 0.0) axes.down = -sum.normalized();
  return axes;
}

}  // namespace imuscope::check
