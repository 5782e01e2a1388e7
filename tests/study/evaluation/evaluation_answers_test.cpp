/// The coasting filter's whole state and the outages of a drive with gaps: what is right about them, the tests beside
/// this one prove.

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/units.h"
#include "estimation/navigation/so3.h"
#include "study/evaluation/outages.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;
using test::Answer;

HostTime instant(double t_s) { return HostTime{from_seconds(t_s)}; }

/// Every axis with another model: none, one or two slow processes, a walk, a turn-on.
CoastingModel uneven_model() {
  CoastingModel model;
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    const double unit = (axis < 3 ? 1e-3 : 0.05) * (1.0 + 0.2 * static_cast<double>(axis));
    AxisNoise& noise = model.axes[axis];
    noise.white_density = 0.01 * unit * unit;
    noise.turn_on_variance = axis == 1 ? 0.0 : unit * unit;
    noise.walk_density = axis % 2 == 0 ? 1e-4 * unit * unit : 0.0;
    for (std::size_t i = 0; i < axis % 3; ++i)
      noise.slow.push_back({0.5 * unit * unit, 0.02 + 0.3 * static_cast<double>(i)});
  }
  std::array<double, kImuAxes> louder{};
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) louder[axis] = 9.0 * model.axes[axis].white_density;
  model.changes = {{20.0, louder}, {45.0, louder}};
  model.changes[1].white_density[2] *= 4.0;
  return model;
}

NavigationState start_state() {
  NavigationState state;
  state.position = {46.5 * kRadPerDeg, 6.6 * kRadPerDeg, 400.0};
  state.v_n_mps = {12.0, 3.0, -0.5};
  state.C_b_n = exp_so3({0.05, -0.1, 0.9});
  state.gyro_bias_b_radps = {1e-3, -2e-3, 1.5e-3};
  state.accel_bias_b_mps2 = {0.02, -0.03, 0.04};
  return state;
}

InertialRates winding(double t_s) {
  return {{0.05 * std::sin(1.1 * t_s), 0.04 * std::cos(0.9 * t_s), 0.25 * std::sin(0.3 * t_s)},
          {1.2 * std::sin(0.4 * t_s), 2.0 * std::sin(0.3 * t_s), -9.8 + 0.5 * std::cos(1.3 * t_s)}};
}

void add_filter(Answer& lines, std::string_view name, CoastingFilter& filter) {
  lines.line(name, 1e6 * (filter.state().position.latitude_rad - 0.81),
             1e6 * (filter.state().position.longitude_rad - 0.115), filter.state().position.height_m,
             filter.state().v_n_mps);
  lines.line(" attitude", filter.state().C_b_n);
  lines.line(" biases", filter.state().gyro_bias_b_radps, filter.state().accel_bias_b_mps2);
  lines.line(" covariance", filter.covariance());
}

TEST(EvaluationAnswers, CoastingFilter) {
  Answer lines;
  const CoastingModel model = uneven_model();
  KinematicVector sd;
  sd << 0.5, 0.6, 0.7, 0.1, 0.2, 0.3, 0.01, 0.02, 0.03;
  CoastingFilter filter(model, start_state(), sd);
  add_filter(lines, "at first", filter);
  std::array<double, kImuAxes> density{};
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) density[axis] = model.axes[axis].white_density;
  const Vector3d arm(0.4, -0.2, -1.1);
  double t_s = 0.0;
  const auto drive = [&](int n, double dt_s) {
    for (int i = 0; i < n; ++i, t_s += dt_s)
      filter.propagate(winding(t_s), winding(t_s + dt_s), dt_s, density);
  };
  drive(203, 0.01);
  add_filter(lines, "driven", filter);
  const auto antenna = [&](const Vector3d& off_n_m) {
    return displaced(filter.state().position, filter.state().C_b_n * arm + off_n_m);
  };
  lines.line("position",
             filter.update_position(instant(t_s), antenna({0.1, -0.2, 0.3}), {0.05, 0.06, 0.1}, arm));
  add_filter(lines, "corrected", filter);
  drive(12, 0.03);
  lines.line("velocity",
             filter.update_velocity(instant(t_s), filter.state().v_n_mps + Vector3d(0.05, -0.02, 0.03),
                                    {0.03, 0.04, 0.05}, winding(t_s), arm));
  add_filter(lines, "corrected", filter);
  lines.line("refused",
             filter.update_position(instant(t_s), antenna({30.0, 0.0, 0.0}), {0.05, 0.06, 0.1}, arm),
             filter.update_velocity(instant(t_s), {40.0, 0.0, 0.0}, {0.03, 0.04, 0.05}, winding(t_s), arm));
  for (int i = 0; i < 14; ++i) {
    drive(10, 0.1);
    lines.line("insists", i,
               filter.update_position(instant(t_s), antenna({40.0, 20.0, 0.0}), {0.05, 0.06, 0.1}, arm));
  }
  add_filter(lines, "taken at last", filter);
  drive(300, 0.1);
  add_filter(lines, "coasted", filter);
  test::expect_recorded("study/evaluation/coasting_filter.txt", lines.text(), 1e-6, 1e-14);
}

/// A drive that stands at first, with a hole in the samples, one in the fixes and one in the reference, doubled samples,
/// velocities from some of the fixes.
Drive holed_drive() {
  Drive drive;
  drive.r_sa_s_m = {0.4, -0.2, -1.1};
  NavigationState truth = start_state();
  truth.gyro_bias_b_radps.setZero();
  truth.accel_bias_b_mps2.setZero();
  truth.v_n_mps.setZero();
  KinematicVector sd = KinematicVector::Constant(1e-3);
  for (int k = 0; k < 14'000; ++k) {
    const double t_s = 0.01 * k;
    const double speed_mps = t_s < 5.0 ? 0.0 : 10.0 * std::min(1.0, 0.2 * (t_s - 5.0));
    const double heading = 0.4 + 0.5 * std::sin(0.1 * t_s);
    const double turn = t_s < 5.0 ? 0.0 : 0.05 * std::cos(0.1 * t_s);
    truth.C_b_n = rotation_from_euler({0.0, 0.0, heading});
    truth.v_n_mps = speed_mps * Vector3d(std::cos(heading), std::sin(heading), 0.0);
    truth.position = displaced(truth.position, 0.01 * truth.v_n_mps);
    const double pull = t_s > 5.0 && t_s < 10.0 ? 2.0 : 0.0;
    const InertialRates measured{{0.0, 0.0, turn + 1e-3 * std::sin(40.0 * t_s)},
                                 {pull, speed_mps * turn, -9.806 + 0.02 * std::cos(31.0 * t_s)}};
    const bool lost = (t_s >= 70.0 && t_s < 71.0) || (t_s >= 30.0 && t_s < 30.3);
    if (!lost) drive.samples.push_back({t_s, measured});
    if (k % 1000 == 500) {
      drive.samples.push_back({t_s, winding(t_s)});
      drive.samples.push_back({t_s, measured});
    }
    if (k % 25 == 0 && !(t_s >= 103.0 && t_s < 107.0))
      drive.fixes.push_back({t_s + 0.004,
                             displaced(truth.position, truth.C_b_n * drive.r_sa_s_m +
                                                           Vector3d(0.02 * std::sin(t_s), 0.0, 0.01)),
                             {0.03, 0.04, 0.06},
                             k % 50 == 0,
                             truth.v_n_mps,
                             {0.05, 0.05, 0.08}});
    if (k % 20 == 0 && !(t_s >= 40.0 && t_s < 43.0)) drive.reference.push_back({t_s, truth, sd});
  }
  return drive;
}

TEST(EvaluationAnswers, OutagesOfADriveWithHoles) {
  Answer lines;
  const Drive drive = holed_drive();
  std::vector<double> progress;
  OutageOptions options{{2.0, 5.0, 12.0}, 6.0, 15.0, [&](double share) { progress.push_back(share); }};
  const std::vector<OutageResult> results = play_outages(drive, uneven_model(), options);
  lines.line("outages", results.size());
  for (std::size_t i = 0; i < results.size(); ++i) {
    const OutageResult& r = results[i];
    lines.line("outage", r.start_s, r.duration_s, r.error, r.covariance.diagonal(), r.reference_sd[4]);
    if (i % 9 == 0) lines.line(" covariance", r.covariance);
  }
  lines.line("progress", progress);
  for (const Consistency& c : consistency_of(results, {2.0, 3.0, 5.0, 12.0})) {
    lines.line("after", c.duration_s, c.n, c.n_independent);
    lines.line(" rms", c.horizontal_rms_m, c.vertical_rms_m, c.velocity_rms_mps, c.attitude_rms_rad);
    lines.line(" sd", c.horizontal_sd_m, c.vertical_sd_m, c.velocity_sd_mps, c.attitude_sd_rad);
    lines.line(" nees", c.nees_position, c.nees_velocity, c.nees_attitude, c.nees_low, c.nees_high,
               c.surprise);
  }
  test::expect_recorded("study/evaluation/outages.txt", lines.text(), 1e-6, 1e-10);
}

TEST(EvaluationAnswers, WithoutSamplesOrReferenceThereIsNoOutage) {
  const OutageOptions options{{2.0}, 6.0, 15.0, {}};
  Drive drive = holed_drive();
  std::vector<DriveReference> reference;
  reference.swap(drive.reference);
  EXPECT_TRUE(play_outages(drive, uneven_model(), options).empty());
  drive.reference = reference;
  for (DriveReference& at : drive.reference) at.state.v_n_mps.setZero();
  EXPECT_TRUE(play_outages(drive, uneven_model(), options).empty()) << "it never moves";
  drive.reference = reference;
  drive.samples.resize(1);
  EXPECT_TRUE(play_outages(drive, uneven_model(), options).empty());
  EXPECT_TRUE(consistency_of({}, {2.0}).empty());
}

}  // namespace
}  // namespace imuscope
