/// What odometry is worth without GNSS: the simulated drive with GNSS cut for a minute, again and again, with
/// each kind of update alone, with none and with all. Prints the position error at the end of the cut, per
/// class of reference, beside the filter's own sd.
///
/// Every drive is another road and other sensors. In each, GNSS is cut at 130 s + k * 120 s + a part of a
/// minute that differs from drive to drive, and the minute after a cut lets the filter settle again.
///
/// Exits 0 only where all three together drift less than the inertial sensors alone, for either reference.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/units.h"
#include "estimation/navigation/so3.h"
#include "tools/trials/wheeled_drive.h"

namespace {

using Eigen::Vector3d;
using imuscope::study::ReferenceClass;
using imuscope::study::WheeledDrive;

constexpr double kFirstCut_s = 130.0;
constexpr double kCutEvery_s = 120.0;
constexpr double kCut_s = 60.0;
constexpr double kAxleGuessSd_m = 0.1;
constexpr double kWheelScaleSd = 0.01;

struct Aiding {
  const char* name;
  bool speed;
  bool non_holonomic;
  bool zero_velocity;
};
constexpr std::array<Aiding, 5> kAidings{{{"inertial alone", false, false, false},
                                          {"speed only", true, false, false},
                                          {"no slip only", false, true, false},
                                          {"standstill only", false, false, true},
                                          {"all three", true, true, true}}};

struct Outage {
  double horizontal_m;
  double vertical_m;
  double heading_mdeg;
  double travelled_m;
  double nees;  ///< of the horizontal position, 2 degrees of freedom
};

struct Results {
  std::vector<Outage> outages;
  Vector3d nis = Vector3d::Zero();
  int runs = 0;
  double scale2 = 0.0;
  std::uint64_t rejected = 0;
};

bool in_cut(double t_s, double offset_s, double duration_s) {
  const double since = t_s - kFirstCut_s - offset_s;
  if (since < 0.0) return false;
  const double begin_s = t_s - std::fmod(since, kCutEvery_s);
  return std::fmod(since, kCutEvery_s) < kCut_s && begin_s + kCut_s < duration_s;
}

Outage outage_at_end(const imuscope::Estimator& estimator, const WheeledDrive& drive, double t_s,
                     double travelled_m) {
  const imuscope::NavigationOutput& navigation = estimator.navigation();
  const WheeledDrive::Truth truth = drive.truth_at(t_s);
  const Vector3d error = imuscope::study::position_error_n_m(navigation, truth);
  const imuscope::EulerAngles rpy = imuscope::euler_from_rotation(truth.C_b_n);
  const double heading = imuscope::wrapped_angle(rpy.heading_rad - navigation.rpy_rad[2]);
  // North and east errors are nearly independent: their correlation is left out of this check.
  const double north = error.x() / navigation.sd_position_m[0];
  const double east = error.y() / navigation.sd_position_m[1];
  return {std::hypot(error.x(), error.y()), std::abs(error.z()),
          1e3 * imuscope::kDegPerRad * std::abs(heading), travelled_m, north * north + east * east};
}

void run(ReferenceClass reference, const Aiding& aiding, std::uint64_t seed, Results& results) {
  imusim::Random random(seed, "odometry study");
  imuscope::study::WheeledDriveOptions options;
  options.seed = seed;
  options.road_seed = seed;
  options.reference = reference;
  options.wheels.scale = kWheelScaleSd * random.normal();
  WheeledDrive drive(options);
  const Vector3d guess_error(random.normal(), random.normal(), random.normal());
  imuscope::EstimatorConfig config = drive.config(drive.r_bv_b_m() - kAxleGuessSd_m * guess_error);
  config.odometry.use_speed = aiding.speed;
  config.odometry.use_non_holonomic = aiding.non_holonomic;
  config.odometry.use_zero_velocity = aiding.zero_velocity;
  imuscope::Estimator estimator(config);

  const double offset_s = random.uniform(0.0, kCut_s);
  bool was_cut = false;
  double travelled_m = 0.0;
  while (!drive.done()) {
    const double t_s = drive.time_s();
    const bool cut = in_cut(t_s, offset_s, options.duration_s);
    if (was_cut && !cut)
      results.outages.push_back(
          outage_at_end(estimator, drive, t_s - 1.0 / WheeledDrive::kRate_hz, travelled_m));
    if (!cut) travelled_m = 0.0;
    const std::vector<imuscope::Sample> samples = drive.next();
    for (const imuscope::Sample& sample : samples) {
      if (cut && sample.kind == imuscope::SampleKind::kGnss) continue;
      estimator.add(sample);
    }
    estimator.advance(samples.front().arrival);
    const Vector3d v(estimator.navigation().v_n_mps.data());
    travelled_m += v.norm() / WheeledDrive::kRate_hz;
    was_cut = cut;
  }
  ++results.runs;
  const imuscope::OdometryOutput& odometry = estimator.odometry();
  const double scale_error = options.wheels.scale - odometry.scale;
  if (aiding.speed) results.scale2 += scale_error * scale_error / (odometry.sd_scale * odometry.sd_scale);
  results.nis += Vector3d(odometry.nis.data());
  results.rejected +=
      estimator.counters().odometry_speed_rejected + estimator.counters().odometry_slip_rejected;
}

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::lround(share * static_cast<double>(values.size() - 1)))];
}

double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

template <typename Field>
std::vector<double> column(const std::vector<Outage>& outages, Field field) {
  std::vector<double> values;
  for (const Outage& outage : outages) values.push_back(outage.*field);
  return values;
}

void print(const Aiding& aiding, const Results& results) {
  const std::vector<double> horizontal = column(results.outages, &Outage::horizontal_m);
  const std::vector<double> vertical = column(results.outages, &Outage::vertical_m);
  const std::vector<double> heading = column(results.outages, &Outage::heading_mdeg);
  const std::vector<double> travelled = column(results.outages, &Outage::travelled_m);
  const std::vector<double> nees = column(results.outages, &Outage::nees);
  double mean_nees = 0.0;
  for (const double value : nees) mean_nees += value / static_cast<double>(nees.size());
  double share = 0.0;
  for (std::size_t i = 0; i < horizontal.size(); ++i) share += horizontal[i];
  double distance = 0.0;
  for (const double value : travelled) distance += value;
  fmt::print(
      "| {:<15} | {:>7} | {:>8.3f} | {:>8.3f} | {:>8.3f} | {:>6.3f} | {:>8.3f} | {:>8.1f} | {:>5.2f} |\n",
      aiding.name, horizontal.size(), percentile(horizontal, 0.5), rms(horizontal),
      percentile(horizontal, 0.95), 100.0 * share / distance, rms(vertical), rms(heading), mean_nees);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Drift in a minute without GNSS, with and without odometry"};
  int seeds = 8;
  std::uint64_t first = 1;
  app.add_option("--seeds", seeds, "drives per line; each gives six outages");
  app.add_option("--first", first, "first seed");
  CLI11_PARSE(app, argc, argv);
  bool helps = true;
  for (const ReferenceClass reference : {ReferenceClass::kNavigationGrade, ReferenceClass::kIndustrial}) {
    double inertial_rms_m = 0.0;
    fmt::print("{}; {} s without GNSS, position error at its end\n",
               reference == ReferenceClass::kNavigationGrade
                   ? "Reference of navigation grade (Airins class)"
                   : "Industrial MEMS reference (0.15 deg/sqrt(h), 10 deg/h)",
               kCut_s);
    fmt::print(
        "| aiding          | outages | median m |   rms m  |  95 % m  | % path | height m | head mdeg | "
        "NEES2 |\n");
    fmt::print("|---|---|---|---|---|---|---|---|---|\n");
    for (const Aiding& aiding : kAidings) {
      Results results;
      for (int i = 0; i < seeds; ++i) run(reference, aiding, first + static_cast<std::uint64_t>(i), results);
      print(aiding, results);
      const double rms_m = rms(column(results.outages, &Outage::horizontal_m));
      if (&aiding == &kAidings.front()) inertial_rms_m = rms_m;
      if (&aiding == &kAidings.back()) helps = helps && rms_m < inertial_rms_m;
      const double runs = results.runs;
      if (aiding.speed || aiding.non_holonomic)
        fmt::print(
            "  mean NIS speed {:.2f}, sideways {:.2f}, upwards {:.2f}; {} rejected; scale NEES {:.2f}\n",
            results.nis.x() / runs, results.nis.y() / runs, results.nis.z() / runs, results.rejected,
            results.scale2 / runs);
      std::fflush(stdout);
    }
    fmt::print("\n");
  }
  fmt::print("{}\n", helps ? "odometry helps either reference" : "ODOMETRY MAKES A REFERENCE WORSE");
  return helps ? 0 : 1;
}
