#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "base/units.h"
#include "check/checks.h"
#include "check/signed_axes.h"

namespace imuscope::check {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d configured(const DeviceConfig& config) {
  Matrix3d axes;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) axes(i, k) = config.axes[static_cast<std::size_t>(3 * i + k)];
  }
  return axes;
}

/// "gyros: +y +x +z" and the lines that name the columns so.
void mend_columns(const DeviceConfig& config, const Matrix3d& turn, bool gyro, Finding& finding) {
  if (turn == Matrix3d::Identity()) return;
  const char* key = gyro ? "gyro_columns" : "accel_columns";
  const Matrix3d axes = configured(config);
  // What the axes make of the columns is turned; the columns are, so that the axes can stay.
  const auto columns =
      columns_toml(axes.transpose() * turn * axes, gyro ? config.csv.gyro_columns : config.csv.accel_columns);
  if (!columns || !traits_of(config.protocol).is_text) return;
  finding.remedy += fmt::format("{}write {} = {}", finding.remedy.empty() ? "" : " and ", key, *columns);
  finding.mends.push_back({config.name, std::string("csv.") + key, *columns});
}

std::string how_turned(const Matrix3d& turn) {
  if (turn == -Matrix3d::Identity()) return "all of the wrong sign";
  const Matrix3d size = turn.cwiseAbs();
  std::string words;
  const std::string names = "xyz";
  for (int i = 0; i < 3; ++i) {
    if (size(i, i) > 0.5) {
      if (turn(i, i) < 0.0)
        words += fmt::format("{}{} of the wrong sign", words.empty() ? "" : ", ",
                             names.substr(static_cast<std::size_t>(i), 1));
      continue;
    }
    int k = 0;
    size.row(i).maxCoeff(&k);
    if (size(k, i) > 0.5 && k > i && size(i, k) > 0.5)
      words += fmt::format("{}{} and {} swapped", words.empty() ? "" : ", ",
                           names.substr(static_cast<std::size_t>(i), 1),
                           names.substr(static_cast<std::size_t>(k), 1));
  }
  return words.empty() ? fmt::format("in another order (they are {})", axes_words(turn)) : words;
}

/// A triad, or both, of one device.
void report_triads(const DeviceConfig& config, const Matrix3d& gyro, const Matrix3d& accel, double cost,
                   std::vector<Finding>& findings) {
  const bool of_gyro = gyro != Matrix3d::Identity();
  const bool of_accel = accel != Matrix3d::Identity();
  if (!of_gyro && !of_accel) return;
  Finding finding{Harm::kWrong,
                  "order of axes",
                  config.name,
                  {},
                  cost,
                  1.0,
                  "times the misfit of rates and forces that is left when mended",
                  {},
                  {}};
  if (of_gyro && of_accel && gyro == accel) {
    finding.check = "handedness";
    finding.what =
        "its axes are left-handed: one has the wrong sign, or two are swapped (which, the data do not tell)";
  } else if (of_accel && accel == -Matrix3d::Identity()) {
    finding.check = "sign of forces";
    finding.what = "its forces have the wrong sign (they point down at rest)";
  } else if (of_accel && !of_gyro) {
    finding.what = fmt::format("accelerometer axes do not belong to its gyro's: {}", how_turned(accel));
  } else {
    finding.what = fmt::format("gyro axes do not belong to its accelerometer's: {}", how_turned(gyro));
    if (gyro.determinant() > 0.0) finding.what += ", or the accelerometer's the other way about";
  }
  mend_columns(config, gyro, true, finding);
  mend_columns(config, accel, false, finding);
  if (finding.remedy.empty()) finding.remedy = "correct them where they are written";
  findings.push_back(std::move(finding));
}

/// Rows: forward, right and down, in b as configured.
Matrix3d vehicle_axes(const ReferenceAxes& axes) {
  Vector3d forward = axes.ahead;
  if (axes.has_forward)
    forward = std::cos(axes.forward_rad) * axes.ahead + std::sin(axes.forward_rad) * axes.right;
  Matrix3d rows;
  rows << forward.transpose(), axes.down.cross(forward).transpose(), axes.down.transpose();
  return rows;
}

/// The reference's axes as a whole are turned.
void report_turned(const DeviceConfig& config, const ReferenceAxes& axes, std::vector<Finding>& findings) {
  const Matrix3d turn = nearest_signed_axes(vehicle_axes(axes));
  if (turn == Matrix3d::Identity()) return;
  const Matrix3d mended = turn * configured(config);
  const bool down_is_right = turn(2, 2) > 0.5;
  Finding finding{Harm::kWrong, "reference axes", config.name, {}, 0.0, 0.0, {}, {}, {}};
  if (down_is_right) {
    finding.what = "its x axis does not point forward";
    finding.value = std::remainder(axes.forward_rad, 2.0 * kPi) * kDegPerRad;
    finding.unit = "deg from x to the direction of travel";
  } else {
    finding.what = "its z axis does not point down";
    finding.value = -axes.down.z() * kMps2PerG;
    finding.expected = -kMps2PerG;
    finding.unit = "m/s2 along z";
  }
  constexpr double kWhole = 1e-9;
  const Matrix3d whole = nearest_signed_axes(mended);
  if ((whole - mended).cwiseAbs().maxCoeff() < kWhole) {
    finding.remedy = fmt::format("write axes = \"{}\"", axes_words(whole));
    finding.mends.push_back({config.name, "axes", fmt::format("\"{}\"", axes_words(whole))});
  } else {
    finding.remedy = fmt::format("its axes are to be turned by \"{}\" once more", axes_words(turn));
  }
  if (!axes.has_forward && !down_is_right)
    finding.remedy += " (if x points forward; without curves and braking beside positions only down is seen)";
  findings.push_back(std::move(finding));
}

/// The reference by itself, with what its positions tell. @return whether a triad of its own is wrong
bool check_reference(const DeviceConfig& config, ReferenceAxes axes, bool forces_inverted,
                     std::vector<Finding>& findings) {
  if (!axes.has_course) {
    if (forces_inverted) {
      report_triads(config, Matrix3d::Identity(), -Matrix3d::Identity(), axes.down.z(), findings);
      return true;
    }
    report_turned(config, axes, findings);
    return false;
  }
  constexpr double kAlong = 0.7;  // 45 degrees
  const double along = axes.down.dot(axes.gyro_down);
  if (along > kAlong && !(axes.has_forward && axes.mirrored)) {
    report_turned(config, axes, findings);
    return false;
  }
  if (along > kAlong) {
    const Matrix3d turn = Vector3d(1.0, -1.0, 1.0).asDiagonal();
    report_triads(config, turn, turn, 1.0, findings);
    return true;
  }
  return false;
}

}  // namespace

void check_axes(const Drive& drive, const ReferenceAxes& reference,
                const std::vector<std::pair<std::size_t, PairAxes>>& pairs, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[drive.configuration().reference_index()];
  std::vector<std::pair<std::size_t, PairAxes>> misfits;
  std::size_t compared = 0;
  for (const auto& pair : pairs) {
    if (pair.second.compared) ++compared;
    if (pair.second.compared && !pair.second.fits) misfits.push_back(pair);
  }
  constexpr double kAlong = 0.7;
  const double along = reference.down.dot(reference.gyro_down);
  // Its gyros and its forces contradict each other where they are held against the course.
  const bool by_course = reference.has_course && along < kAlong;
  bool by_studies = !misfits.empty() && misfits.size() == compared;
  constexpr double kAsGood = 1.05;
  constexpr double kBetter = 0.8;
  for (const auto& [study, pair] : misfits) {
    by_studies = by_studies && (compared > 1 ? pair.reference_cost < kAsGood * pair.study_cost
                                             : pair.reference_cost < kBetter * pair.study_cost);
  }
  const bool inverted = !misfits.empty() && reference.down.z() < -kAlong && !reference.has_course &&
                        misfits.front().second.study_accel == -Matrix3d::Identity();
  if (inverted) by_studies = true;
  if (by_course || by_studies) {
    const bool seen = !misfits.empty();
    Matrix3d gyro = seen ? misfits.front().second.reference_gyro : Matrix3d::Identity();
    Matrix3d accel = seen ? misfits.front().second.reference_accel : Matrix3d::Identity();
    if (inverted || (by_course && along < -kAlong && (!reference.has_forward || reference.mirrored))) {
      gyro = Matrix3d::Identity();
      accel = -Matrix3d::Identity();
    }
    if (seen || along < -kAlong) {
      report_triads(config, gyro, accel, seen ? misfits.front().second.healthy_cost : 1.0, findings);
      return;
    }
  }
  // A left-handed reference fits no S-IMU, which is not theirs to mend.
  if (check_reference(config, reference, inverted, findings)) return;
  for (const auto& [study, pair] : misfits) {
    report_triads(drive.configuration().devices[study], pair.study_gyro, pair.study_accel, pair.healthy_cost,
                  findings);
  }
}

}  // namespace imuscope::check
