#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>

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

}  // namespace

void check_gravity_norm(Drive& drive, std::size_t device, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[device];
  ImuTrack& track = drive.imu(device);
  const ImuBins bins = bins_of(track, kGravityMeanBins);
  std::vector<double> norms;
  for (std::size_t i = 0; i < bins.valid.size(); ++i) {
    if (bins.valid[i]) norms.push_back(bins.f_mps2[i].norm());
  }
  if (norms.size() < kGravityBinsMin) return;
  const auto middle = norms.begin() + static_cast<std::ptrdiff_t>(norms.size() / 2);
  std::nth_element(norms.begin(), middle, norms.end());
  const double ratio = *middle / kMps2PerG;
  if (std::abs(ratio - 1.0) < kNormTolerance) return;
  Finding finding{Harm::kWrong, "gravity norm", config.name, {}, *middle, kMps2PerG, "m/s2", {}, {}};
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
  constexpr double kNoGravity = 0.3;
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
