/// The estimator on recorded drives with known mountings: what it found, what it claims and what is known.
///
///   imuscope_real_drives DATA [--config DIR] [--json]
///
/// DATA holds car_drive/{02,07,08} and xsens_pair. Every recording goes the way of a user's: CSV files, a
/// committed configuration, nothing known of the mounting or the clocks. A component is inside where it lies
/// within three published sd plus the known value's own spread.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/units.h"
#include "calibration/filter_core.h"
#include "navigation/so3.h"
#include "service/estimator_setup.h"
#include "service/recording.h"
#include "service/replay.h"

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using imuscope::kDegPerRad;
using imuscope::kRadPerDeg;

/// Forward-left-up (or any z-up) axes to those with y and z turned over, as the configurations do.
const Matrix3d kTurnedOver = Vector3d(1.0, -1.0, -1.0).asDiagonal();

/// A recording and what others found of it. Known values are in the axes of the reference's file.
struct Known {
  std::string name;
  std::string config;
  std::vector<std::string> inputs;
  Vector3d euler_deg;  ///< zyx, about x, y, z: takes study components to reference components
  Vector3d euler_spread_deg;
  Vector3d r_m;  ///< of the study in the reference's axes
  double r_spread_m;
  double t_d_s;  ///< to be added to the study's times
};

std::vector<Known> recordings(const std::string& data) {
  std::vector<Known> all;
  const auto car = [&](const std::string& drive, double t_d_s) {
    const std::string folder = data + "/car_drive/" + drive;
    all.push_back({"car " + drive,
                   "csv_drive.toml",
                   {"reference=" + folder + "/reference_imu.csv", "gnss=" + folder + "/gnss.csv",
                    "dot=" + folder + "/study_imu.csv"},
                   {-1.93, 0.20, -93.63},
                   {0.05, 0.18, 0.08},
                   {0.002, 0.038, 0.154},
                   0.004,
                   t_d_s});
  };
  car("02", 0.253);
  car("07", 0.035);
  car("08", -0.075);
  const auto pair = [&](const std::string& name, const Vector3d& euler_deg, const Vector3d& r_m,
                        double t_d_s) {
    const std::string file = data + "/xsens_pair/" + name;
    all.push_back({"pair " + name,
                   "csv_pair.toml",
                   {"reference=" + file + "_b.csv", "study=" + file + "_a.csv"},
                   euler_deg,
                   {0.1, 0.1, 0.1},
                   r_m,
                   0.003,
                   t_d_s});
  };
  pair("45_1", {-1.35, 1.60, -45.01}, {-0.170, -0.197, 0.001}, 0.0);
  pair("45_2", {-1.32, 1.67, -44.98}, {-0.170, -0.197, 0.001}, 0.0);
  pair("90_1", {-2.11, 0.30, -90.08}, {-0.197, -0.198, 0.003}, -0.251);
  return all;
}

/// Keeps the last snapshot, and the mean of the NIS while the vehicle moves.
class Last final : public imuscope::CoreSink {
 public:
  void on_error(const imuscope::ErrorRecord&) noexcept override {}
  void on_event(const imuscope::EstimatorEvent&) noexcept override {}
  void on_snapshot(const imuscope::Snapshot& snapshot) noexcept override {
    last = snapshot;
    const imuscope::StudyOutput& study = snapshot.studies[0];
    if (!has_estimate(study.status) || study.regime != imuscope::Regime::kDynamic) return;
    nis[0] += imuscope::to_eigen(study.nis_gyro);
    nis[1] += imuscope::to_eigen(study.nis_accel);
    n += 1.0;
  }
  void on_late_sample(const imuscope::LateSample&) noexcept override {}
  imuscope::Snapshot last{};
  std::array<Vector3d, 2> nis{Vector3d::Zero(), Vector3d::Zero()};
  double n = 0.0;
};

struct Found {
  imuscope::StudyOutput study;
  double clock_shift_s = 0.0;
  std::uint64_t gnss_rejected = 0;
  std::array<Vector3d, 2> nis;  ///< mean in motion: gyro, accelerometer
};

imuscope::Result<Found> calibrate(const Known& known, const std::string& configs) {
  const auto opened = imuscope::open_recording(known.inputs, configs + "/" + known.config);
  if (!opened) return tl::unexpected<imuscope::Error>(opened.error());
  Last sink;
  const auto replayed = imuscope::replay(
      opened->configuration, imuscope::estimator_config(opened->configuration), opened->recording, sink);
  if (!replayed) return tl::unexpected<imuscope::Error>(replayed.error());
  const auto index = opened->configuration.study_indices().front();
  return Found{sink.last.studies[0],
               opened->recording.clocks[index].shift_s,
               sink.last.counters.gnss_rejected,
               {sink.nis[0] / sink.n, sink.nis[1] / sink.n}};
}

Vector3d euler_deg(const Matrix3d& R) {
  const imuscope::EulerAngles angles = imuscope::euler_from_rotation(R);
  return kDegPerRad * Vector3d(angles.roll_rad, angles.pitch_rad, angles.heading_rad);
}

Vector3d wrapped_deg(Vector3d v) {
  for (Eigen::Index i = 0; i < 3; ++i) v(i) = kDegPerRad * imuscope::wrapped_angle(kRadPerDeg * v(i));
  return v;
}

/// Seven components: Euler angles, lever arm, time offset.
struct Comparison {
  std::array<double, 7> error{};
  std::array<double, 7> sd{};
  std::array<double, 7> allowed{};
};

Comparison compare(const Known& known, const Found& found) {
  const Matrix3d C_b_s = imuscope::to_eigen(found.study.C_b_s);
  // C_b_s takes b to s; the known rotation takes s to the reference's file axes.
  const auto file_from_study = [&](const Vector3d& psi) -> Matrix3d {
    return kTurnedOver * (C_b_s * imuscope::exp_so3(-psi)).transpose();
  };
  const Vector3d angles = euler_deg(file_from_study(Vector3d::Zero()));
  constexpr double kStep_rad = 1e-5;
  Matrix3d slope;
  for (Eigen::Index i = 0; i < 3; ++i)
    slope.col(i) =
        wrapped_deg(euler_deg(file_from_study(kStep_rad * Vector3d::Unit(i))) - angles) / kStep_rad;
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> P(found.study.covariance_psi_r.data());
  const Matrix3d P_euler = slope * P.topLeftCorner<3, 3>() * slope.transpose();
  const Vector3d angle_error = wrapped_deg(angles - known.euler_deg);
  const Vector3d r_error = kTurnedOver * imuscope::to_eigen(found.study.r_bs_b_m) - known.r_m;
  Comparison out;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    out.error[i] = angle_error(k);
    out.sd[i] = std::sqrt(P_euler(k, k));
    out.allowed[i] = 3.0 * out.sd[i] + known.euler_spread_deg(k);
    out.error[i + 3] = r_error(k);
    out.sd[i + 3] = found.study.sd_r_bs_b_m[i];
    out.allowed[i + 3] = 3.0 * out.sd[i + 3] + known.r_spread_m;
  }
  // The known offsets are given to the millisecond.
  constexpr double kTimeOffsetSpread_s = 0.001;
  out.error[6] = found.study.t_d_s + found.clock_shift_s - known.t_d_s;
  out.sd[6] = found.study.sd_t_d_s;
  out.allowed[6] = 3.0 * out.sd[6] + kTimeOffsetSpread_s;
  return out;
}

constexpr std::array<const char*, 7> kNames{"x", "y", "z", "x", "y", "z", "t_d"};
constexpr std::array<double, 7> kUnits{1e3, 1e3, 1e3, 1e3, 1e3, 1e3, 1e3};

std::string three(const std::array<double, 7>& values, std::size_t first, int digits) {
  return fmt::format("{:8.{}f} {:8.{}f} {:8.{}f}", kUnits[first] * values[first], digits,
                     kUnits[first] * values[first + 1], digits, kUnits[first] * values[first + 2], digits);
}

nlohmann::json to_json(const Known& known, const Found& found, const Comparison& c) {
  return {{"recording", known.name},
          {"error",
           {{"euler_deg", {c.error[0], c.error[1], c.error[2]}},
            {"r_m", {c.error[3], c.error[4], c.error[5]}},
            {"t_d_s", c.error[6]}}},
          {"sd",
           {{"euler_deg", {c.sd[0], c.sd[1], c.sd[2]}},
            {"r_m", {c.sd[3], c.sd[4], c.sd[5]}},
            {"t_d_s", c.sd[6]}}},
          {"allowed",
           {{"euler_deg", {c.allowed[0], c.allowed[1], c.allowed[2]}},
            {"r_m", {c.allowed[3], c.allowed[4], c.allowed[5]}},
            {"t_d_s", c.allowed[6]}}},
          {"nis_gyro", imuscope::to_array(found.nis[0])},
          {"nis_accel", imuscope::to_array(found.nis[1])},
          {"resets", found.study.counters.resets},
          {"gnss_rejected", found.gnss_rejected}};
}

void print(const Known& known, const Found& found, const Comparison& c) {
  std::string outside;
  for (std::size_t i = 0; i < c.error.size(); ++i) {
    if (std::abs(c.error[i]) > c.allowed[i])
      outside += fmt::format(" {}{}", i < 3 ? "angle " : i < 6 ? "r " : "", kNames[i]);
  }
  fmt::print("{:<10} error   {}   {}   {:8.2f}   {}\n", known.name, three(c.error, 0, 0),
             three(c.error, 3, 1), 1e3 * c.error[6], outside.empty() ? "inside" : "outside:" + outside);
  fmt::print("{:<10} sd      {}   {}   {:8.2f}\n", "", three(c.sd, 0, 0), three(c.sd, 3, 1), 1e3 * c.sd[6]);
  fmt::print(
      "{:<10} NIS in motion   gyro {:.2f} {:.2f} {:.2f}   accel {:.2f} {:.2f} {:.2f}   GNSS rejected {}\n",
      "", found.nis[0].x(), found.nis[0].y(), found.nis[0].z(), found.nis[1].x(), found.nis[1].y(),
      found.nis[1].z(), found.gnss_rejected);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"The estimator on recorded drives with known mountings"};
  std::string data;
  std::string configs = "config";
  bool json = false;
  app.add_option("data", data, "folder with car_drive and xsens_pair")
      ->required()
      ->check(CLI::ExistingDirectory);
  app.add_option("--config", configs, "folder of csv_drive.toml and csv_pair.toml");
  app.add_flag("--json", json, "print JSON");
  CLI11_PARSE(app, argc, argv);
  nlohmann::json rows = nlohmann::json::array();
  if (!json) {
    fmt::print("{:<18} {:^26}   {:^26}   {:>8}\n", "", "zyx Euler x y z, mdeg", "lever arm x y z, mm",
               "t_d, ms");
  }
  for (const Known& known : recordings(data)) {
    const auto found = calibrate(known, configs);
    if (!found) {
      fmt::print(stderr, "{}: {}\n", known.name, found.error().text());
      return 1;
    }
    if (!has_estimate(found->study.status)) {
      fmt::print(stderr, "{}: no mounting was found\n", known.name);
      return 1;
    }
    const Comparison comparison = compare(known, *found);
    if (json) {
      rows.push_back(to_json(known, *found, comparison));
    } else {
      print(known, *found, comparison);
    }
  }
  if (json) fmt::print("{}\n", nlohmann::json{{"recordings", rows}}.dump(2));
  return 0;
}
