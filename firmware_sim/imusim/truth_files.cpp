#include "firmware_sim/imusim/truth_files.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "firmware_sim/motion/degrees.h"

namespace imusim {
namespace {

using nlohmann::json;

json numbers_of(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

json rows_of(const Eigen::Matrix3d& matrix) {
  json rows = json::array();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) rows.push_back(matrix(row, column));
  return rows;
}

/// One axis in one regime, in the terms of imuscope's fits: Gauss-Markov processes by falling beta.
json noise_model(const std::string& axis, const char* regime, const std::string& unit,
                 const AxisNoise& noise) {
  json parameters = json::array();
  const auto add = [&](const std::string& process, const char* name, const std::string& parameter_unit,
                       double value) {
    parameters.push_back({{"process", process}, {"name", name}, {"unit", parameter_unit}, {"value", value}});
  };
  const std::string squared = "(" + unit + ")^2";
  add("WN", "sigma2", squared, noise.white_variance);
  std::vector<GaussMarkov> processes = noise.processes;
  std::sort(processes.begin(), processes.end(),
            [](const GaussMarkov& a, const GaussMarkov& b) { return a.beta_per_s > b.beta_per_s; });
  for (std::size_t i = 0; i < processes.size(); ++i) {
    const std::string process = fmt::format("GM{}", i + 1);
    add(process, "beta", "1/s", processes[i].beta_per_s);
    add(process, "sigma2", squared, processes[i].variance);
  }
  return {{"axis", axis}, {"regime", regime}, {"unit", unit}, {"parameters", parameters}};
}

json noise_models(const ImuErrors& errors) {
  json models = json::array();
  const auto add_triad = [&](const char* kind, const std::string& unit, const TriadErrors& triad) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::string axis = fmt::format("{}_{}", kind, "xyz"[i]);
      models.push_back(noise_model(axis, "static", unit, triad.noise[i].at_rest));
      models.push_back(noise_model(axis, "dynamic", unit, triad.noise[i].in_motion));
    }
  };
  add_triad("gyro", "rad/s", errors.gyro);
  add_triad("accel", "m/s^2", errors.accel);
  return models;
}

/// What the harsh world adds, and every sensor has: matrices of the triads, and where and when they measure.
void add_sensor(const ImuErrors& errors, json& imu) {
  imu["gyro_bias_radps"] = numbers_of(errors.gyro.bias);
  imu["accel_bias_mps2"] = numbers_of(errors.accel.bias);
  imu["gyro_scale"] = numbers_of(errors.gyro.scale);
  imu["accel_scale"] = numbers_of(errors.accel.scale);
  imu["gyro_misalignment"] = rows_of(errors.gyro.misalignment);
  imu["accel_misalignment"] = rows_of(errors.accel.misalignment);
  imu["g_sensitivity"] = rows_of(errors.gyro.g_sensitivity);
  // Reading = matrix x truth in s (of the R-IMU: in b) + bias + noise.
  imu["gyro_matrix"] = rows_of(triad_matrix(errors.gyro));
  imu["accel_matrix"] = rows_of(triad_matrix(errors.accel));
  imu["C_s_accel"] = rows_of(errors.accel.C_s_triad);
  // One row per accelerometer.
  imu["accel_places_s_m"] = rows_of(errors.accel_places_s_m.transpose());
  // Behind a slow motion: pure delay and low-pass.
  imu["gyro_delay_s"] = slow_delay_s(errors.gyro);
  imu["accel_delay_s"] = slow_delay_s(errors.accel);
  const auto corner = [](const TriadErrors& triad) {
    return std::isfinite(triad.low_pass_hz) ? json(triad.low_pass_hz) : json(nullptr);
  };
  imu["gyro_low_pass_hz"] = corner(errors.gyro);
  imu["accel_low_pass_hz"] = corner(errors.accel);
  imu["own_vibration"] = errors.own_vibration;
  imu["noise"] = noise_models(errors);
}

json study_json(const World& world, const SImuTruth& study) {
  // s is the frame of the gyro triad, as calibration.json has it; the sensor's own errors are told about its
  // nominal axes.
  const Eigen::Matrix3d gyros = triad_matrix(study.errors.gyro) * study.mounting.C_b_s;
  const Eigen::Matrix3d accels = triad_matrix(study.errors.accel) * study.mounting.C_b_s;
  const Eigen::Matrix3d C_b_s = triad_frame(gyros);
  const Eigen::Quaterniond q(C_b_s);
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  json imu;
  imu["name"] = study.name;
  imu["C_b_s"] = rows_of(C_b_s);
  imu["q_b_s"] = {sign * q.w(), sign * q.x(), sign * q.y(), sign * q.z()};
  imu["r_bs_b_m"] = numbers_of(study.mounting.r_bs_b_m);
  imu["t_d_s"] = true_time_offset_s(world, study);
  imu["accel_t_d_s"] = true_accel_time_offset_s(world, study);
  imu["stream_latency_s"] = study.latency_s;
  imu["reference_stream_latency_s"] = world.reference_latency_s();
  imu["clock_skew_ppm"] = study.clock_skew_ppm;
  imu["sample_time"] = {{"counter0", study.first_counter},
                        {"t0_s", study.first_sample_s - world.first_reference_sample_s()},
                        {"period_s", study.period_s}};
  add_sensor(study.errors, imu);
  imu["gyro_matrix"] = rows_of(gyros * C_b_s.transpose());
  imu["accel_matrix"] = rows_of(accels * C_b_s.transpose());
  imu["C_s_accel"] = rows_of(triad_frame(accels) * C_b_s.transpose());
  return imu;
}

std::string utc_text(Utc utc) {
  const CalendarTime parts = calendar_time(utc);
  const auto micro = std::chrono::duration_cast<std::chrono::microseconds>(parts.time_of_day).count();
  constexpr std::int64_t kMicro = 1'000'000;
  const std::int64_t second = micro / kMicro;
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:06}Z", parts.year, parts.month, parts.day,
                     second / 3600, second / 60 % 60, second % 60, micro % kMicro);
}

const char* regime_word(Regime regime) { return regime == Regime::kStatic ? "static" : "dynamic"; }

}  // namespace

Outcome<void> write_file(const std::filesystem::path& path, const std::string& content) {
  std::ofstream file(path, std::ios::binary);
  file.write(content.data(), static_cast<std::streamsize>(content.size()));
  file.close();
  if (!file)
    return failed_work(fmt::format("cannot write {}; is there room, and the permission?", path.string()));
  return {};
}

Outcome<void> make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!std::filesystem::is_directory(folder))
    return failed_work(fmt::format("cannot make the folder {}: {}; choose another --out", folder.string(),
                                   error ? error.message() : "something else has that name"));
  return {};
}

Outcome<void> write_truth_json(const World& world, const std::filesystem::path& folder) {
  const Configuration& configuration = world.configuration();
  json truth;
  truth["schema"] = "imuscope.truth/1";
  truth["seed"] = configuration.scenario.seed;
  truth["duration_s"] = configuration.scenario.duration_s;
  truth["t0_utc"] =
      utc_text(utc_without_leap_second(gps_after(configuration.utc_begin, world.first_reference_sample_s())));
  truth["world"] = configuration.world == WorldKind::kIdeal ? "ideal" : "harsh";
  const PcClock& clock = world.pc_clock();
  truth["pc_clock"] = {{"rate_ppm", clock.rate_ppm},
                       {"warm_up_ppm", clock.warm_up_ppm},
                       {"counted_s", clock.seconds_at(configuration.scenario.duration_s)},
                       {"slews", json::array()}};
  for (const PcClock::Slew& slew : clock.slews)
    truth["pc_clock"]["slews"].push_back(
        {{"begin_s", slew.begin_s}, {"end_s", slew.end_s}, {"ppm", slew.ppm}});
  truth["reference"] = {{"name", world.reference().name}};
  add_sensor(world.reference().errors, truth["reference"]);
  truth["imus"] = json::array();
  for (const SImuTruth& study : world.studies()) truth["imus"].push_back(study_json(world, study));
  return write_file(folder / "truth.json", truth.dump(1) + "\n");
}

Outcome<void> write_truth_csv(const World& world, const std::filesystem::path& folder, double rows_hz) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out,
                 "time_s,lat_deg,lon_deg,height_m,v_n_mps,v_e_mps,v_d_mps,roll_deg,pitch_deg,heading_deg,"
                 "regime\n");
  const double begin_s = world.first_reference_sample_s();
  for (int row = 0;; ++row) {
    const double time_s = row / rows_hz;
    if (begin_s + time_s > world.motion().duration_s()) break;
    const MotionState state = world.motion().state_at(begin_s + time_s);
    fmt::format_to(out, "{},{:.12f},{:.12f},{:.6f},{:.7f},{:.7f},{:.7f},{:.9f},{:.9f},{:.9f},{}\n", time_s,
                   state.position.latitude_rad * kDegPerRad, state.position.longitude_rad * kDegPerRad,
                   state.position.height_m, state.v_n_mps.x(), state.v_n_mps.y(), state.v_n_mps.z(),
                   state.roll_rad * kDegPerRad, state.pitch_rad * kDegPerRad, wrapped_deg(state.heading_rad),
                   regime_word(world.motion().regime_at(begin_s + time_s)));
  }
  return write_file(folder / "truth.csv", fmt::to_string(text));
}

std::string error_header() {
  return "time_s,counter,e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,e_accel_x_mps2,e_accel_y_mps2,"
         "e_accel_z_mps2,regime\n";
}

std::string error_row(const World& world, const TrueSample& sample) {
  const Eigen::Vector3d& g = sample.reading.gyro_error_radps;
  const Eigen::Vector3d& a = sample.reading.accel_error_mps2;
  return fmt::format("{:.6f},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{}\n",
                     sample.t_s - world.first_reference_sample_s(), sample.counter, g.x(), g.y(), g.z(),
                     a.x(), a.y(), a.z(), regime_word(sample.regime));
}

}  // namespace imusim
