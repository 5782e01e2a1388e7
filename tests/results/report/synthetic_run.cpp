#include "tests/results/report/synthetic_run.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "base/units.h"

namespace imuscope::test {
namespace {

using nlohmann::json;
using Matrix = std::array<double, 9>;
using Vector = std::array<double, 3>;

constexpr double kSampleRate_hz = 100.0;
constexpr double kSeriesRate_hz = 10.0;
constexpr unsigned kSeed = 20240607;
constexpr const char* kAxes[] = {"gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"};

/// Rotation by a rotation vector.
Matrix exp_matrix(const Vector& v) {
  const Eigen::Vector3d turn(v[0], v[1], v[2]);
  Matrix out{};
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.data()) =
      Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()).toRotationMatrix();
  return out;
}

Matrix product(const Matrix& A, const Matrix& B) {
  Matrix C{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) C[3 * i + j] += A[3 * i + k] * B[3 * k + j];
  return C;
}

/// The first sensor looks as b does, the second is turned by a right angle about z, the third is upside down.
Matrix square_of(std::size_t imu) {
  constexpr std::array<Matrix, 3> kSquares{Matrix{1, 0, 0, 0, 1, 0, 0, 0, 1},
                                           Matrix{0, 1, 0, -1, 0, 0, 0, 0, 1},
                                           Matrix{1, 0, 0, 0, -1, 0, 0, 0, -1}};
  return kSquares[imu % kSquares.size()];
}

/// Boresight of sensor `imu` from its square mounting: C_b_s = square * Exp(-psi), psi in b.
Vector true_psi_deg(std::size_t imu) {
  const double shift = 0.3 * static_cast<double>(imu);
  return {0.8 - shift, -1.1 + shift, 0.6};
}

Vector true_lever_arm_m(std::size_t imu) {
  const double shift = 0.1 * static_cast<double>(imu);
  return {0.35 - shift, -0.22 + shift, 0.12};
}

Matrix mounting(std::size_t imu, const Vector& psi_deg) {
  return product(square_of(imu),
                 exp_matrix({-kRadPerDeg * psi_deg[0], -kRadPerDeg * psi_deg[1], -kRadPerDeg * psi_deg[2]}));
}

/// Error of the estimate relative to its sd, by axis; the same at all times.
constexpr Vector kErrorInSd{0.7, -1.2, 0.4};

/// Falls from a coarse value to `end` with the square root of time.
double sd_at(double time_s, double end, double duration_s) {
  return end * std::sqrt(duration_s / (time_s + duration_s * 1e-4));
}

bool at_rest(double time_s) { return std::fmod(time_s, 150.0) < 30.0; }

double speed_mps(double time_s) {
  if (at_rest(time_s)) return 0.0;
  const double phase = (std::fmod(time_s, 150.0) - 30.0) / 120.0;
  return 14.0 * std::sin(kPi * phase) * (1.0 + 0.2 * std::sin(0.3 * time_s));
}

void write_json(const std::filesystem::path& file, const json& document) {
  std::ofstream(file) << document.dump(2) << '\n';
}

void write_navigation(const std::filesystem::path& folder, const SyntheticRun& options) {
  std::ofstream out(folder / "navigation.csv");
  out << "time_s,lat_deg,lon_deg,height_m,v_n_mps,v_e_mps,v_d_mps,roll_deg,pitch_deg,heading_deg,"
         "sd_n_m,sd_e_m,sd_d_m,sd_v_n_mps,sd_v_e_mps,sd_v_d_mps,sd_roll_deg,sd_pitch_deg,sd_heading_deg\n";
  constexpr double kMetresPerDeg = 111320.0;
  double north_m = 0.0;
  double east_m = 0.0;
  for (double t = 0.0; t < options.duration_s; t += 1.0 / kSeriesRate_hz) {
    const double v = speed_mps(t);
    const double heading = 0.012 * t + 0.9 * std::sin(0.04 * t);
    north_m += v * std::cos(heading) / kSeriesRate_hz;
    east_m += v * std::sin(heading) / kSeriesRate_hz;
    out << fmt::format("{},{},{},{},{},{},0,0,0,{},0.02,0.02,0.04,0.01,0.01,0.01,0.005,0.005,0.02\n", t,
                       46.52 + north_m / kMetresPerDeg, 6.57 + east_m / (kMetresPerDeg * 0.688),
                       430.0 + 6.0 * std::sin(0.01 * t), v * std::cos(heading), v * std::sin(heading),
                       std::fmod(heading * kDegPerRad, 360.0));
  }
}

void write_calibration_series(const std::filesystem::path& file, std::size_t imu,
                              const SyntheticRun& options) {
  std::ofstream out(file);
  out << "time_s,psi_x_deg,psi_y_deg,psi_z_deg,q_w,q_x,q_y,q_z,r_x_m,r_y_m,r_z_m,t_d_ms,sd_psi_x_deg,sd_psi_"
         "y_deg,"
         "sd_psi_z_deg,sd_r_x_m,sd_r_y_m,sd_r_z_m,sd_t_d_ms\n";
  const Vector psi = true_psi_deg(imu);
  const Vector r = true_lever_arm_m(imu);
  for (double t = 12.0; t < options.duration_s; t += 1.0 / kSeriesRate_hz) {
    const double sd_psi = sd_at(t - 12.0, options.boresight_sd_deg, options.duration_s);
    const double sd_r = sd_at(t - 12.0, 0.0008, options.duration_s);
    const double sd_t = sd_at(t - 12.0, 0.03, options.duration_s);
    std::string row = fmt::format("{}", t);
    for (std::size_t i = 0; i < 3; ++i)
      row += fmt::format(",{}", psi[i] + kErrorInSd[i] * sd_psi * std::cos(0.01 * t));
    row += ",1,0,0,0";
    for (std::size_t i = 0; i < 3; ++i) row += fmt::format(",{}", r[i] - kErrorInSd[i] * sd_r);
    row += fmt::format(",{},{},{},{},{},{},{},{}\n", -8.4 + 0.5 * sd_t, sd_psi, sd_psi, sd_psi, sd_r, sd_r,
                       sd_r, sd_t);
    out << row;
  }
}

void write_errors(const std::filesystem::path& file, std::size_t imu, const SyntheticRun& options) {
  std::ofstream out(file);
  out << "time_s,counter,e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,e_accel_x_mps2,e_accel_y_mps2,"
         "e_accel_z_mps2,regime\n";
  std::minstd_rand random(kSeed + static_cast<unsigned>(imu));
  std::normal_distribution<double> normal;
  const auto n = static_cast<int>(options.duration_s * kSampleRate_hz);
  std::string rows;
  for (int k = 0; k < n; ++k) {
    const double t = k / kSampleRate_hz;
    if (t >= options.gap_begin_s && t < options.gap_end_s) continue;
    const double louder = at_rest(t) ? 1.0 : 1.15;
    rows += fmt::format("{},{}", t, k);
    for (int axis = 0; axis < 6; ++axis) {
      const double sd = axis < 3 ? 0.71 * kRadPerDeg : 0.012;
      const double slow = sd * (0.3 * std::sin(0.007 * t + axis) + 0.2 * axis);
      rows += fmt::format(",{:.6g}", slow + louder * sd * normal(random));
    }
    rows += at_rest(t) ? ",static\n" : ",dynamic\n";
  }
  out << rows;
}

json calibration_entry(std::size_t imu, const std::string& name, const SyntheticRun& options) {
  Vector psi = true_psi_deg(imu);
  Vector r = true_lever_arm_m(imu);
  for (std::size_t i = 0; i < 3; ++i) {
    psi[i] += kErrorInSd[i] * options.boresight_sd_deg;
    r[i] -= kErrorInSd[i] * 0.0008;
  }
  const double sd = options.boresight_sd_deg;
  return {
      {"name", name},
      {"C_b_s", mounting(imu, psi)},
      {"C_prior", square_of(imu)},
      {"q_b_s", {1.0, 0.0, 0.0, 0.0}},
      {"boresight_sd_deg", {sd, 0.8 * sd, 0.6 * sd}},
      {"r_bs_b_m", r},
      {"r_bs_b_sd_m", {0.0008, 0.0008, 0.0008}},
      {"t_d_s", -0.00838},
      {"t_d_sd_s", 0.00003},
      {"gyro_bias_radps", {0.0012, -0.0008, 0.0004}},
      {"gyro_bias_sd_radps", {0.00002, 0.00002, 0.00003}},
      {"accel_bias_mps2", {0.021, -0.034, 0.015}},
      {"accel_bias_sd_mps2", {0.001, 0.001, 0.002}},
      {"gyro_scale", {0.0011, -0.0007, 0.0002}},
      {"gyro_scale_sd", {0.0003, 0.0003, 0.0001}},
      {"accel_scale", {0.0004, 0.0002, nullptr}},
      {"observable",
       {{"psi_x", true}, {"psi_y", true}, {"psi_z", options.psi_z_observable}, {"r_x", true}, {"t_d", true}}},
      {"method", "filter end value"}};
}

json truth_entry(std::size_t imu, const std::string& name) {
  return {{"name", name},
          {"C_b_s", mounting(imu, true_psi_deg(imu))},
          {"r_bs_b_m", true_lever_arm_m(imu)},
          {"t_d_s", -0.0084},
          {"gyro_bias_radps", {0.00119, -0.00082, 0.00043}},
          {"accel_bias_mps2", {0.0205, -0.0335, 0.0161}}};
}

/// WN + two GM whose wavelet variance is drawn as a sum of a falling line and two humps.
json fit_entry(const std::string& name, const std::string& axis, const std::string& regime,
               const SyntheticRun& options) {
  const bool gyro = axis.rfind("gyro", 0) == 0;
  const double unit = gyro ? kRadPerDeg * kRadPerDeg : 1e-4;
  const double white = (regime == "static" ? 0.5055 : 0.6538) * unit;
  const auto hump = [](double tau, double beta, double sigma2) {
    const double x = beta * tau;
    return sigma2 * x / (1.0 + x * x / 3.0 + x);
  };
  const auto n = static_cast<int>(options.duration_s * kSampleRate_hz / 2);
  json wv = json::array();
  for (int level = 1; (1 << level) <= n / 2; ++level) {
    const double tau = (1 << level) / kSampleRate_hz;
    const double fitted =
        white / (1 << level) + hump(tau, 1.68, 0.0017 * unit) + hump(tau, 0.02, 0.0098 * unit);
    const double relative = std::sqrt(3.0 * (1 << level) / n);
    const double value = fitted * (1.0 + 0.4 * relative * std::sin(2.0 * level));
    wv.push_back({{"level", level},
                  {"tau_s", tau},
                  {"value", value},
                  {"ci_low", value * std::exp(-1.96 * relative)},
                  {"ci_high", value * std::exp(1.96 * relative)},
                  {"fitted", fitted},
                  {"n_coefficients", n - (1 << level)}});
  }
  const std::string squared = gyro ? "(rad/s)^2" : "(m/s^2)^2";
  const auto parameter = [](const char* process, const char* label, const std::string& of, double value,
                            double relative) {
    return json{{"process", process},
                {"name", label},
                {"unit", of},
                {"value", value},
                {"sd", value * relative},
                {"ci_low", value * std::exp(-1.96 * relative)},
                {"ci_high", value * std::exp(1.96 * relative)}};
  };
  return {
      {"name", name},
      {"axis", axis},
      {"regime", regime},
      {"unit", gyro ? "rad/s" : "m/s^2"},
      {"n", n},
      {"rate_hz", kSampleRate_hz},
      {"model", "WN+2*GM"},
      {"weights", "optimal"},
      {"wv", wv},
      {"parameters",
       {parameter("WN", "sigma2", squared, white, 0.004), parameter("GM1", "beta", "1/s", 1.68, 0.3),
        parameter("GM1", "sigma2", squared, 0.0017 * unit, 0.2), parameter("GM2", "beta", "1/s", 0.0049, 0.9),
        parameter("GM2", "sigma2", squared, 0.0098 * unit, 0.5)}},
      {"objective", 7.2},
      {"j_test", {{"statistic", 7.2}, {"dof", 6}, {"p_value", options.j_p_value}}},
      {"criterion", 19.0},
      {"identifiable", true},
      {"warnings", json::array()}};
}

json run_document(const SyntheticRun& options) {
  json devices = json::array();
  const auto device = [&](const std::string& name, const char* role, const char* protocol, double rate_hz) {
    const auto samples = static_cast<long>(options.duration_s * rate_hz);
    devices.push_back({{"name", name},
                       {"role", role},
                       {"protocol", protocol},
                       {"samples", samples},
                       {"rate_hz", rate_hz},
                       {"frames", samples},
                       {"bytes", samples * 58},
                       {"bytes_skipped", 0},
                       {"bad_checksums", 0},
                       {"samples_lost", 0},
                       {"gaps", 0},
                       {"late", 0}});
  };
  device("airins", "reference", "ixblue_stdbin", kSampleRate_hz);
  for (const std::string& name : options.names) device(name, "study", "xsens_mt", kSampleRate_hz);
  device("gnss", "gnss", "greis", 10.0);
  return {{"schema", "imuscope.run/1"},
          {"version", "0.1.0"},
          {"build", "release"},
          {"configuration", "config/demo.toml"},
          {"configuration_text", "[run]\nname = \"demo\"\n"},
          {"configuration_sha256", "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"},
          {"inputs", {"airins=airins.bin", "gnss=gnss.bin"}},
          {"duration_s", options.duration_s},
          {"t0_utc", "2024-06-07T08:00:00Z"},
          {"devices", devices},
          {"regimes",
           {{"static_s", 0.2 * options.duration_s + 60.0}, {"dynamic_s", 0.8 * options.duration_s + 60.0}}},
          {"warnings", json::array()}};
}

/// One coefficient that is clear of chance and one that is not, among so many.
json regression_entry(const std::string& name, const char* axis, const char* method, bool projected,
                      double r2, double p_value) {
  const json clear{{"covariate", "f_x"}, {"value", 1e-3},   {"sd", 1e-5},
                   {"p_value", 1e-12},   {"p_holm", 1e-10}, {"means", "g-sensitivity of 0.56 deg/s per g"}};
  const json chance{{"covariate", "f_y"}, {"value", 1e-6}, {"sd", 1e-5},
                    {"p_value", 0.003},   {"p_holm", 0.4}, {"means", "g-sensitivity of nothing"}};
  return {{"name", name},
          {"axis", axis},
          {"n", 1000},
          {"r2", r2},
          {"f", 2600.0},
          {"p_value", p_value},
          {"method", method},
          {"projected", projected},
          {"coefficients", projected ? json::array({clear, chance}) : json::array()}};
}

void write_scatter(const std::filesystem::path& file) {
  constexpr int kRows = 4000;
  std::ofstream out(file);
  out << "time_s,omega_x,omega_y,omega_z,omega_dot_x,omega_dot_y,omega_dot_z,omega_ddot_x,omega_ddot_y,"
         "omega_ddot_z,f_x,f_y,f_z,f_dot_x,f_dot_y,f_dot_z,e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,"
         "e_accel_x_mps2,e_accel_y_mps2,e_accel_z_mps2\n";
  for (int i = 0; i < kRows; ++i) {
    out << 0.1 * i;
    for (int column = 0; column < 15; ++column) out << ',' << std::sin(0.7 * i + column);
    // The first error follows its axis' rate; a clipped gyro row has no values.
    if (i % 100 == 7) {
      out << ",,,";
    } else {
      out << ',' << 0.01 * std::sin(0.7 * i) << ",0.01,0.01";
    }
    out << ",0.1,0.1," << 0.1 * std::cos(0.3 * i) << '\n';
  }
}

json comparison_entry(const std::string& name, const std::string& axis) {
  const json parameter{{"process", "WN"},      {"name", "sigma2"},      {"unit", "(rad/s)^2"},
                       {"first", 1.0},         {"second", 1.29},        {"ratio", 1.293},
                       {"ratio_ci_low", 1.28}, {"ratio_ci_high", 1.31}, {"p_value", 1e-12},
                       {"p_holm", 1e-11},      {"verdict", "differs"}};
  const json unsure{{"process", "GM2"},   {"name", "beta"},          {"unit", "1/s"},
                    {"ratio", nullptr},   {"ratio_ci_low", nullptr}, {"ratio_ci_high", nullptr},
                    {"p_value", nullptr}, {"p_holm", nullptr},       {"verdict", "not determined"}};
  return {{"name", name},
          {"axis", axis},
          {"first", "static"},
          {"second", "dynamic"},
          {"parameters", {parameter, unsure}},
          {"joint", {{"statistic", 812.5}, {"dof", 5}, {"p_value", 1e-99}, {"p_holm", 1e-98}}},
          {"remarks", json::array()}};
}

void write_dependence(const std::filesystem::path& folder, const SyntheticRun& options) {
  json dependences = json::array();
  json points = json::array();
  for (const std::string& name : options.names) {
    dependences.push_back({{"name", name},
                           {"axis", "gyro_x"},
                           {"driver", "vibration"},
                           {"driver_unit", "m/s^2"},
                           {"process", "WN"},
                           {"parameter", "sigma2"},
                           {"unit", "(rad/s)^2"},
                           {"n_windows", 30},
                           {"at_mean_driver", 1.9e-4},
                           {"mean_driver", 0.4},
                           {"slope", 0.3},
                           {"slope_sd", 0.04},
                           {"ci_low", 0.22},
                           {"ci_high", 0.38},
                           {"p_value", 1e-9},
                           {"p_holm", 4e-9},
                           {"percent_per_unit", 35.0},
                           {"sentence", "louder on rough road"}});
    for (int i = 0; i < 30; ++i) {
      const double vibration = 0.02 * i;
      points.push_back({{"name", name},
                        {"axis", "gyro_x"},
                        {"process", "WN"},
                        {"driver", {{"rate", 0.1}, {"vibration", vibration}, {"speed", 10.0}}},
                        {"time_s", 2.0 * i},
                        {"value", 1.9e-4 * std::exp(0.3 * (vibration - 0.4))},
                        {"ci_low", 1.8e-4},
                        {"ci_high", 2.0e-4}});
    }
  }
  write_json(folder / "dependence.json", {{"schema", "imuscope.dependence/1"},
                                          {"window_s", 20.0},
                                          {"dependences", dependences},
                                          {"points", points},
                                          {"not_determined",
                                           {{{"name", options.names.front()},
                                             {"axis", "accel_z"},
                                             {"driver", "temperature"},
                                             {"process", "WN"},
                                             {"why", "the temperature did not change"}}}},
                                          {"remarks", json::array()}});
}

void write_evaluation(const std::filesystem::path& folder, const SyntheticRun& options) {
  json evaluations = json::array();
  for (const std::string& name : options.names) {
    for (const double duration_s : {10.0, 30.0, 60.0}) {
      for (const auto& [model, nees] : {std::pair{"dynamic", 1.02}, std::pair{"data sheet", 9.5}}) {
        evaluations.push_back({{"name", name},
                               {"model", model},
                               {"source", "made up"},
                               {"duration_s", duration_s},
                               {"n", 100},
                               {"n_independent", 20},
                               {"horizontal_rms_m", 0.05 * duration_s * duration_s},
                               {"horizontal_sd_m", 0.05 * duration_s * duration_s / std::sqrt(nees)},
                               {"nees_position", nees},
                               {"nees_velocity", nees},
                               {"nees_attitude", nees},
                               {"nees_low", 0.7},
                               {"nees_high", 1.4},
                               {"surprise", 3.0 + nees}});
      }
    }
  }
  write_json(
      folder / "evaluation.json",
      {{"schema", "imuscope.evaluation/1"},
       {"durations_s", {10.0, 30.0, 60.0}},
       {"evaluations", evaluations},
       {"absent", {{{"name", options.names.front()}, {"model", "static"}, {"why", "no model of rest"}}}}});
}

void write_findings(const std::filesystem::path& folder, const SyntheticRun& options) {
  json comparisons = json::array();
  for (const std::string& name : options.names) {
    for (const char* axis : kAxes) comparisons.push_back(comparison_entry(name, axis));
  }
  write_json(folder / "comparison.json", {{"schema", "imuscope.comparison/1"},
                                          {"correction", "Holm"},
                                          {"level", 0.05},
                                          {"comparisons", comparisons}});
  write_json(
      folder / "regimes.json",
      {{"schema", "imuscope.regimes/1"},
       {"by", "motion"},
       {"regimes",
        {{{"name", "static"},
          {"total_s", 12.0},
          {"longest_s", 12.0},
          {"stretches", {{{"begin_s", 0.0}, {"end_s", 12.0}}}}},
         {{"name", "dynamic"},
          {"total_s", 48.0},
          {"longest_s", 48.0},
          {"stretches", {{{"begin_s", 12.0}, {"end_s", 60.0}}}}}}},
       {"left_out",
        {{{"name", options.names.front()},
          {"axis", "gyro_x"},
          {"regime", "static"},
          {"above_level", 9},
          {"above_tau_s", 5.12},
          {"sentence", "gyro_x, static: levels above 5.12 s are left out, its stretches are too short"}}}},
       {"remarks", {"The drive has one standstill."}}});
  write_json(folder / "vibration.json", {{"schema", "imuscope.vibration/1"},
                                         {"lines",
                                          {{{"name", options.names.front()},
                                            {"axis", "accel_z"},
                                            {"regime", "dynamic"},
                                            {"frequency_hz", 28.31},
                                            {"frequency_sd_hz", 0.02},
                                            {"amplitude", 0.05},
                                            {"amplitude_unit", "m/s^2"},
                                            {"share_of_variance", 0.12},
                                            {"p_value", 1e-8}}}},
                                         {"remarks", json::array()}});
  write_dependence(folder, options);
  write_evaluation(folder, options);
}

}  // namespace

void write_synthetic_run(const std::filesystem::path& folder, const SyntheticRun& options) {
  json calibrations = json::array();
  json truths = json::array();
  json models = json::array();
  json regressions = json::array();
  for (std::size_t i = 0; i < options.names.size(); ++i) {
    const std::string& name = options.names[i];
    calibrations.push_back(calibration_entry(i, name, options));
    truths.push_back(truth_entry(i, name));
    write_calibration_series(folder / ("calibration_" + name + ".csv"), i, options);
    write_errors(folder / ("errors_" + name + ".csv"), i, options);
    if (options.with_regression) write_scatter(folder / ("scatter_" + name + ".csv"));
    for (const char* axis : kAxes) {
      for (const char* regime : {"static", "dynamic"})
        models.push_back(fit_entry(name, axis, regime, options));
      regressions.push_back(regression_entry(name, axis, "ols", false, 0.1542, 1e-9));
      regressions.push_back(regression_entry(name, axis, "gls", false, 0.0011, 0.31));
      regressions.push_back(regression_entry(name, axis, "gls", true, 0.0123, 0.04));
    }
  }
  write_json(folder / "run.json", run_document(options));
  write_json(folder / "calibration.json", {{"schema", "imuscope.calibration/1"}, {"imus", calibrations}});
  write_json(folder / "models.json", {{"schema", "imuscope.models/1"}, {"models", models}});
  if (options.with_truth)
    write_json(folder / "truth.json", {{"schema", "imuscope.truth/1"}, {"imus", truths}});
  if (options.with_regression) {
    write_json(folder / "regression.json",
               {{"schema", "imuscope.regression/1"}, {"regressions", regressions}});
  }
  if (options.with_findings) write_findings(folder, options);
  write_navigation(folder, options);
}

}  // namespace imuscope::test
