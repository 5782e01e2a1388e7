#include "service/run/run_folder.h"

#include <fmt/compile.h>
#include <fmt/format.h>
#include <Eigen/Geometry>
#include <cmath>
#include <utility>

#include "base/json_text.h"
#include "base/text.h"
#include "base/units.h"
#include "results/tables/columns.h"
#include "sample/gps_time.h"
#include "service/pipeline/observability.h"
#include "service/run/mounting_quaternion.h"

namespace imuscope {

namespace {

constexpr const char* kOdometryFile = "odometry.csv";

void append(fmt::memory_buffer& row, const Vector3& v, double unit) {
  for (const double value : v) fmt::format_to(fmt::appender(row), FMT_COMPILE(",{}"), value * unit);
}

nlohmann::json numbers(const Vector3& v, double unit = 1.0) {
  return {v[0] * unit, v[1] * unit, v[2] * unit};
}

constexpr std::array kDirectionNames{"psi_x", "psi_y", "psi_z", "r_x", "r_y", "r_z"};

}  // namespace

Result<void> CsvFile::open(const OutputFolder& folder, const std::string& name, const std::string& header) {
  auto begun = folder.begin(name);
  if (!begun) return tl::unexpected<Error>(begun.error());
  out_ = std::move(*begun);
  out_.write(header);
  return {};
}

Result<void> write_json(const OutputFolder& folder, const std::string& name, const nlohmann::json& document) {
  return folder.write_whole(name, json_text(document) + "\n");
}

void SampleTimeLine::add(std::int64_t counter, double time_s) {
  if (n_ == 0.0) counter0_ = counter;
  const auto c = static_cast<double>(counter - counter0_);
  n_ += 1.0;
  const double delta_c = c - mean_c_;
  mean_c_ += delta_c / n_;
  const double delta_t = time_s - mean_t_;
  mean_t_ += delta_t / n_;
  sum_cc_ += delta_c * (c - mean_c_);
  sum_ct_ += delta_c * (time_s - mean_t_);
}

double SampleTimeLine::period_s() const { return sum_ct_ / sum_cc_; }
double SampleTimeLine::t0_s() const { return mean_t_ - period_s() * mean_c_; }

void append_time(const RowTime& time, fmt::memory_buffer& row) {
  fmt::format_to(fmt::appender(row), FMT_COMPILE("{},"), time.time_s);
  if (!time.utc.is_known) return;
  constexpr std::int64_t kUsPerS = 1'000'000;
  const std::int64_t us =
      std::chrono::round<std::chrono::microseconds>(time.utc.utc).time_since_epoch().count();
  fmt::format_to(fmt::appender(row), FMT_COMPILE("{}.{:06}"), us / kUsPerS, us % kUsPerS);
}

std::string navigation_csv_header() { return tables::csv_header(tables::run_table("navigation")); }

std::string navigation_csv_row(const NavigationOutput& nav, const RowTime& time) {
  fmt::memory_buffer row;
  append_time(time, row);
  if (time.utc.is_known) {
    const GpsTime gps =
        gps_time(std::chrono::round<std::chrono::microseconds>(time.utc.utc), time.utc.gps_minus_utc_s);
    fmt::format_to(fmt::appender(row), FMT_COMPILE(",{},{:.6f}"), gps.week, gps.tow_s);
  } else {
    row.append(std::string_view(",,"));
  }
  fmt::format_to(fmt::appender(row), FMT_COMPILE(",{},{},{}"), nav.latitude_rad * kDegPerRad,
                 nav.longitude_rad * kDegPerRad, nav.height_m);
  append(row, nav.v_n_mps, 1.0);
  append(row, nav.rpy_rad, kDegPerRad);
  append(row, nav.sd_position_m, 1.0);
  append(row, nav.sd_velocity_mps, 1.0);
  append(row, nav.sd_rpy_rad, kDegPerRad);
  row.push_back('\n');
  return fmt::to_string(row);
}

std::string odometry_csv_header() { return tables::csv_header(tables::run_table("odometry")); }

std::string odometry_csv_row(const OdometryOutput& odometry, const RowTime& time) {
  constexpr double kPercent = 100.0;
  fmt::memory_buffer row;
  append_time(time, row);
  fmt::format_to(fmt::appender(row), FMT_COMPILE(",{},{:d},{:d},{:d},{},{},{}"), odometry.speed_mps,
                 odometry.standing, odometry.resting, odometry.lost, kPercent * odometry.scale,
                 odometry.mount_rad[1] * kDegPerRad, odometry.mount_rad[2] * kDegPerRad);
  append(row, odometry.r_bv_b_m, 1.0);
  fmt::format_to(fmt::appender(row), FMT_COMPILE(",{},{},{}"), kPercent * odometry.sd_scale,
                 odometry.sd_mount_rad[1] * kDegPerRad, odometry.sd_mount_rad[2] * kDegPerRad);
  append(row, odometry.sd_r_bv_b_m, 1.0);
  row.push_back('\n');
  return fmt::to_string(row);
}

std::string calibration_csv_header() { return tables::csv_header(tables::run_table("calibration")); }

std::string calibration_csv_row(const SImuOutput& study, const SImuFileInfo& info, const RowTime& time) {
  const auto q = mounting_quaternion(study.C_b_s);
  fmt::memory_buffer row;
  append_time(time, row);
  append(row, study.psi_rad, kDegPerRad);
  fmt::format_to(fmt::appender(row), FMT_COMPILE(",{},{},{},{}"), q.w(), q.x(), q.y(), q.z());
  append(row, study.r_bs_b_m, 1.0);
  fmt::format_to(fmt::appender(row), FMT_COMPILE(",{}"), (study.t_d_s + info.clock_shift_s) * kMsPerS);
  append(row, study.gyro_bias_radps, 1.0);
  append(row, study.accel_bias_mps2, 1.0);
  append(row, study.gyro_scale, 1.0);
  append(row, study.accel_scale, 1.0);
  append(row, study.sd_psi_rad, kDegPerRad);
  append(row, study.sd_r_bs_b_m, 1.0);
  fmt::format_to(fmt::appender(row), FMT_COMPILE(",{}"), study.sd_t_d_s * kMsPerS);
  append(row, study.sd_gyro_bias_radps, 1.0);
  append(row, study.sd_accel_bias_mps2, 1.0);
  append(row, study.sd_gyro_scale, 1.0);
  append(row, study.sd_accel_scale, 1.0);
  row.push_back('\n');
  return fmt::to_string(row);
}

std::string error_csv_header() { return tables::csv_header(tables::run_table("errors")); }

std::string error_csv_row(const ErrorRow& row, double time_s, std::string_view regime) {
  fmt::memory_buffer text;
  append_time({time_s, row.utc}, text);
  fmt::format_to(fmt::appender(text), FMT_COMPILE(",{}"), row.counter);
  // An invalid triad is an empty field: nothing is invented.
  for (std::size_t i = 0; i < 3; ++i) {
    text.push_back(',');
    if (row.gyro_valid) fmt::format_to(fmt::appender(text), FMT_COMPILE("{}"), row.e_gyro_radps[i]);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    text.push_back(',');
    if (row.accel_valid) fmt::format_to(fmt::appender(text), FMT_COMPILE("{}"), row.e_accel_mps2[i]);
  }
  fmt::format_to(fmt::appender(text), FMT_COMPILE(",{}\n"), regime);
  return fmt::to_string(text);
}

nlohmann::json calibration_json(const SImuFileInfo& info, const SImuOutput& study,
                                const SampleTimeLine& times) {
  const auto q = mounting_quaternion(study.C_b_s);
  nlohmann::json imu;
  imu["name"] = info.name;
  imu["C_b_s"] = study.C_b_s;
  imu["C_prior"] = study.C_prior;
  imu["q_b_s"] = {q.w(), q.x(), q.y(), q.z()};
  imu["boresight_sd_deg"] = numbers(study.sd_psi_rad, kDegPerRad);
  imu["r_bs_b_m"] = study.r_bs_b_m;
  imu["r_bs_b_sd_m"] = study.sd_r_bs_b_m;
  imu["t_d_s"] = study.t_d_s + info.clock_shift_s;
  imu["t_d_sd_s"] = study.sd_t_d_s;
  if (times.valid()) {
    imu["sample_time"] = {
        {"counter0", times.counter0()}, {"t0_s", times.t0_s() + study.t_d_s}, {"period_s", times.period_s()}};
  } else {
    imu["sample_time"] = nullptr;
  }
  imu["gyro_bias_radps"] = study.gyro_bias_radps;
  imu["gyro_bias_sd_radps"] = study.sd_gyro_bias_radps;
  imu["accel_bias_mps2"] = study.accel_bias_mps2;
  imu["accel_bias_sd_mps2"] = study.sd_accel_bias_mps2;
  imu["gyro_scale"] = study.gyro_scale;
  imu["gyro_scale_sd"] = study.sd_gyro_scale;
  imu["accel_scale"] = study.accel_scale;
  imu["accel_scale_sd"] = study.sd_accel_scale;
  if (study.sd_accel_boresight_rad[0] > 0.0) {
    imu["accel_boresight_deg"] = numbers(study.accel_boresight_rad, kDegPerRad);
    imu["accel_boresight_sd_deg"] = numbers(study.sd_accel_boresight_rad, kDegPerRad);
  }
  if (study.sd_accel_t_d_s > 0.0) {
    imu["accel_time_offset_s"] = study.accel_t_d_s;
    imu["accel_time_offset_sd_s"] = study.sd_accel_t_d_s;
  }
  imu["covariance_psi_r"] = study.covariance_psi_r;
  nlohmann::json observable;
  for (std::size_t i = 0; i < kDirectionNames.size(); ++i)
    observable[kDirectionNames[i]] = study.observable[i];
  observable["t_d"] = study.t_d_observable;
  imu["observable"] = observable;
  imu["observability"] =
      has_estimate(study.status) ? observability_json(observability_of(study)) : nlohmann::json(nullptr);
  imu["status"] = key_of(study.status);
  imu["method"] = "filter end value";
  imu["samples"] = {{"received", study.counters.samples},
                    {"used", study.counters.used},
                    {"late", study.counters.late},
                    {"no_reference", study.counters.no_reference},
                    {"gated_gyro", study.counters.gated_gyro},
                    {"gated_accel", study.counters.gated_accel}};
  imu["nis_gyro"] = study.nis_gyro;
  imu["nis_accel"] = study.nis_accel;
  return imu;
}

Result<std::unique_ptr<RunFolder>> RunFolder::create(const std::filesystem::path& folder,
                                                     std::vector<SImuFileInfo> studies, bool write_errors) {
  auto opened_folder = OutputFolder::open(folder);
  if (!opened_folder) return tl::unexpected<Error>(opened_folder.error());
  std::unique_ptr<RunFolder> run(new RunFolder(std::move(*opened_folder)));
  run->studies_ = std::move(studies);
  const std::size_t n = run->studies_.size();
  run->calibrations_.resize(n);
  run->errors_.resize(n);
  run->sample_times_.resize(n);
  if (auto opened = run->navigation_.open(run->folder_, "navigation.csv", navigation_csv_header()); !opened) {
    return tl::unexpected<Error>(opened.error());
  }
  run->folder_.remove(kOdometryFile);
  for (std::size_t i = 0; i < n; ++i) {
    const auto& name = run->studies_[i].name;
    auto opened = run->calibrations_[i].open(run->folder_, device_file_name("calibration", name, ".csv"),
                                             calibration_csv_header());
    if (opened && write_errors) {
      opened =
          run->errors_[i].open(run->folder_, device_file_name("errors", name, ".csv"), error_csv_header());
    }
    if (!opened) return tl::unexpected<Error>(opened.error());
  }
  return run;
}

void RunFolder::on_error(const ErrorRecord& record) noexcept {
  write_error(record, regime_name(record.row.regime));
}

void RunFolder::write_error(const ErrorRecord& record, std::string_view regime) {
  const double time_s = to_seconds(record.row.time - record.first_reference_time);
  sample_times_[record.study].add(record.row.counter, time_s);
  if (errors_[record.study].is_open())
    errors_[record.study].append(error_csv_row(record.row, time_s, regime));
}

void RunFolder::on_event(const EstimatorEvent& event) noexcept { events_.push_back(event); }

void RunFolder::on_late_sample(const LateSample& late) noexcept { late_.push_back(late); }

RowTime RunFolder::row_time(HostTime time, double shift_s) const {
  return {to_seconds(time - last_->first_reference_time), last_->time_scale.at(time + from_seconds(shift_s))};
}

void RunFolder::on_snapshot(const Snapshot& snapshot) noexcept {
  last_ = snapshot;
  utc_.add(snapshot.time_scale);
  if (!snapshot.has_reference) return;
  // A row is of a time: while nothing comes, none is repeated.
  if (snapshot.has_new_navigation)
    navigation_.append(navigation_csv_row(snapshot.navigation, row_time(snapshot.navigation.time)));
  if (snapshot.has_new_odometry) add_odometry();
  for (std::size_t i = 0; i < snapshot.n_studies; ++i) {
    const auto& study = snapshot.studies[i];
    if (snapshot.has_new_study[i])
      calibrations_[i].append(calibration_csv_row(study, studies_[i], row_time(study.time, study.t_d_s)));
  }
}

/// The file is made with the first speed: a run without odometry has none.
void RunFolder::add_odometry() {
  if (!odometry_.is_open()) odometry_opened_ = odometry_.open(folder_, kOdometryFile, odometry_csv_header());
  if (!odometry_opened_) return;
  odometry_.append(odometry_csv_row(last_->odometry, row_time(last_->odometry.time)));
}

Result<void> RunFolder::write_calibration() {
  std::vector<CalibrationEntry> entries;
  for (std::size_t i = 0; last_ && i < last_->n_studies; ++i)
    entries.push_back({last_->studies[i], {{"weighted_mean", nullptr}}});
  return write_calibration(entries);
}

Result<void> RunFolder::write_calibration(const std::vector<CalibrationEntry>& entries) {
  nlohmann::json imus = nlohmann::json::array();
  for (std::size_t i = 0; i < entries.size(); ++i) {
    imus.push_back(calibration_json(studies_[i], entries[i].study, sample_times_[i]));
    imus.back().update(entries[i].more);
  }
  return write_json(folder_, "calibration.json", {{"schema", "imuscope.calibration/1"}, {"imus", imus}});
}

std::optional<Error> RunFolder::problem() const {
  if (!odometry_opened_) return odometry_opened_.error();
  for (const auto* file : {&navigation_, &odometry_}) {
    if (auto problem = file->problem()) return problem;
  }
  for (const auto* files : {&calibrations_, &errors_}) {
    for (const auto& file : *files) {
      if (auto problem = file.problem()) return problem;
    }
  }
  return std::nullopt;
}

Result<void> RunFolder::close() {
  auto result = navigation_.close();
  if (result && !odometry_opened_) result = odometry_opened_;
  if (auto closed = odometry_.close(); result && !closed) result = closed;
  for (auto* files : {&calibrations_, &errors_}) {
    for (auto& file : *files) {
      auto closed = file.close();
      if (result && !closed) result = closed;
    }
  }
  return result;
}

}  // namespace imuscope
