#include "view/run_folder_messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <imuscope/calibration_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/status_t.hpp>
#include <imuscope/wavelet_variance_t.hpp>
#include <limits>
#include <map>
#include <string>
#include <utility>

#include "base/calibration_levels.h"
#include "base/text.h"
#include "base/units.h"
#include "publish/message_codec.h"
#include "publish/message_values.h"
#include "results/tables/csv_reader.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"

namespace imuscope::view {

namespace {

using nlohmann::json;
using tables::CsvReader;
using tables::field;
using tables::number_at;
using tables::text_at;
using Bytes = std::vector<std::uint8_t>;

constexpr double kNever = std::numeric_limits<double>::infinity();
/// More fits than any run writes: six S-IMUs, six axes, some regimes.
constexpr std::size_t kModelsMax = 2048;
constexpr std::size_t kDevicesMax = 64;
constexpr std::size_t kLevelsMax = 64;
constexpr std::size_t kParametersMax = 64;
/// Of what a table does not tell: none of the constants of the message.
constexpr std::int8_t kNoValidity = -1;

double or_unknown(const json& object, const char* key) { return number_at(object, key).value_or(kUnknown); }

std::int64_t count_at(const json& object, const char* key) {
  constexpr double kMost = 9e15;  // whole numbers of a double
  const double value = number_at(object, key).value_or(0.0);
  return static_cast<std::int64_t>(std::clamp(std::isfinite(value) ? value : 0.0, 0.0, kMost));
}

template <typename Message>
using Column = std::pair<const char*, double Message::*>;

/// Goes to the next row that has a time, which stands in the first column.
double next_time_s(CsvReader& reader) {
  while (reader.next()) {
    if (std::isfinite(reader.number(0))) return reader.number(0);
  }
  return kNever;
}

/// Rows of one table as messages. `time_s()` is that of the row under way, kNever at the end.
class Table {
 public:
  Table() = default;
  Table(const Table&) = delete;
  Table& operator=(const Table&) = delete;
  virtual ~Table() = default;
  [[nodiscard]] virtual double time_s() const = 0;
  virtual Bytes take() = 0;
  /// Of the row under way, and back to it.
  struct Row {
    std::uint64_t place;
    std::int64_t sequence;  ///< of the message that begins with it
  };
  [[nodiscard]] virtual Row row() const = 0;
  virtual void go_to(const Row& row) = 0;
};

/// Tables whose rows are messages: each column is a field.
template <typename Message>
class PlainTable final : public Table {
 public:
  PlainTable(CsvReader reader, std::vector<Column<Message>> columns, Message fixed)
      : reader_(std::move(reader)), columns_(std::move(columns)), message_(std::move(fixed)) {
    advance();
  }
  [[nodiscard]] double time_s() const override { return time_s_; }
  Bytes take() override {
    for (std::size_t i = 0; i < columns_.size(); ++i) message_.*columns_[i].second = reader_.number(i);
    Bytes bytes = encode_message(message_);
    ++message_.sequence;
    advance();
    return bytes;
  }
  [[nodiscard]] Row row() const override { return {reader_.place(), message_.sequence}; }
  void go_to(const Row& row) override {
    reader_.go_to(row.place);
    message_.sequence = row.sequence;
    advance();
  }

 private:
  void advance() { time_s_ = next_time_s(reader_); }

  CsvReader reader_;
  std::vector<Column<Message>> columns_;
  Message message_;
  double time_s_ = kNever;
};

std::vector<Column<navigation_t>> navigation_columns() {
  using N = navigation_t;
  return {{"time_s", &N::time_s},
          {"lat_deg", &N::lat_deg},
          {"lon_deg", &N::lon_deg},
          {"height_m", &N::height_m},
          {"v_n_mps", &N::v_n_mps},
          {"v_e_mps", &N::v_e_mps},
          {"v_d_mps", &N::v_d_mps},
          {"roll_deg", &N::roll_deg},
          {"pitch_deg", &N::pitch_deg},
          {"heading_deg", &N::heading_deg},
          {"sd_n_m", &N::sd_n_m},
          {"sd_e_m", &N::sd_e_m},
          {"sd_heading_deg", &N::sd_heading_deg}};
}

std::vector<Column<calibration_t>> calibration_columns() {
  using C = calibration_t;
  return {{"time_s", &C::time_s},
          {"psi_x_deg", &C::psi_x_deg},
          {"psi_y_deg", &C::psi_y_deg},
          {"psi_z_deg", &C::psi_z_deg},
          {"q_w", &C::q_w},
          {"q_x", &C::q_x},
          {"q_y", &C::q_y},
          {"q_z", &C::q_z},
          {"r_x_m", &C::r_x_m},
          {"r_y_m", &C::r_y_m},
          {"r_z_m", &C::r_z_m},
          {"t_d_ms", &C::t_d_ms},
          {"sd_psi_x_deg", &C::sd_psi_x_deg},
          {"sd_psi_y_deg", &C::sd_psi_y_deg},
          {"sd_psi_z_deg", &C::sd_psi_z_deg},
          {"sd_r_x_m", &C::sd_r_x_m},
          {"sd_r_y_m", &C::sd_r_y_m},
          {"sd_r_z_m", &C::sd_r_z_m},
          {"sd_t_d_ms", &C::sd_t_d_ms}};
}

template <typename Message>
std::vector<std::string> names_of(const std::vector<Column<Message>>& columns) {
  std::vector<std::string> names;
  for (const auto& column : columns) names.emplace_back(column.first);
  return names;
}

/// The error process of one S-IMU: a message holds the rows of a tenth of a second in one regime.
class ErrorTable final : public Table {
 public:
  ErrorTable(CsvReader reader, const std::string& name) : reader_(std::move(reader)) {
    message_.name = name;
    message_.validity = kNoValidity;
    advance();
  }
  static std::vector<std::string> columns() {
    return {"time_s",         "e_gyro_x_radps", "e_gyro_y_radps", "e_gyro_z_radps",
            "e_accel_x_mps2", "e_accel_y_mps2", "e_accel_z_mps2", "regime"};
  }
  [[nodiscard]] double time_s() const override { return time_s_; }
  Bytes take() override {
    constexpr double kMessage_s = 0.1;
    constexpr std::size_t kRegime = 7;
    message_.rows.clear();
    message_.regime = std::string(reader_.cell(kRegime));
    const double end_s = time_s_ + kMessage_s;
    do {  // one at least, whatever its time
      error_row_t row{};
      row.time_s = time_s_;
      row.e_gyro_x_radps = reader_.number(1);
      row.e_gyro_y_radps = reader_.number(2);
      row.e_gyro_z_radps = reader_.number(3);
      row.e_accel_x_mps2 = reader_.number(4);
      row.e_accel_y_mps2 = reader_.number(5);
      row.e_accel_z_mps2 = reader_.number(6);
      message_.rows.push_back(row);
      advance();
    } while (time_s_ < end_s && message_.rows.size() < kRowsMax && reader_.cell(kRegime) == message_.regime);
    message_.n_rows = element_count(message_.rows);
    Bytes bytes = encode_message(message_);
    ++message_.sequence;
    return bytes;
  }
  [[nodiscard]] Row row() const override { return {reader_.place(), message_.sequence}; }
  void go_to(const Row& row) override {
    reader_.go_to(row.place);
    message_.sequence = row.sequence;
    advance();
  }

 private:
  static constexpr std::size_t kRowsMax = 500;
  void advance() { time_s_ = next_time_s(reader_); }

  CsvReader reader_;
  imuscope::error_t message_{};
  double time_s_ = kNever;
};

/// The models of the whole run, one message of each kind for every S-IMU.
std::vector<Bytes> model_messages(const std::filesystem::path& folder) {
  const json document = tables::read_json_file(folder / "models.json");
  const json& models = field(document, "models");
  std::map<std::string, std::pair<wavelet_variance_t, noise_model_t>> by_name;
  std::size_t read = 0;
  if (models.is_array()) {
    for (const json& one : models) {
      const std::string name = text_at(one, "name");
      if (!is_device_name(name) || ++read > kModelsMax) continue;
      axis_wavelet_variance_t variances{};
      axis_noise_model_t model{};
      variances.axis = model.axis = text_at(one, "axis");
      variances.regime = model.regime = text_at(one, "regime");
      variances.unit = model.unit = text_at(one, "unit");
      variances.n = model.n = count_at(one, "n");
      model.model = text_at(one, "model");
      model.intervals = text_at(one, "intervals");
      model.identifiable = field(one, "identifiable") == true ? 1 : 0;
      model.j_p_value = or_unknown(field(one, "j_test"), "p_value");
      const json& parameters = field(one, "parameters");
      if (parameters.is_array()) {
        for (const json& each : parameters) {
          if (model.parameters.size() >= kParametersMax) break;
          noise_parameter_t parameter{};
          parameter.process = text_at(each, "process");
          parameter.name = text_at(each, "name");
          parameter.unit = text_at(each, "unit");
          parameter.value = or_unknown(each, "value");
          parameter.sd = parameter.ci_low = parameter.ci_high = kUnknown;
          model.parameters.push_back(std::move(parameter));
        }
      }
      model.n_parameters = element_count(model.parameters);
      const json& levels = field(one, "wv");
      if (!levels.is_array()) continue;
      for (const json& level : levels) {
        if (variances.tau_s.size() >= kLevelsMax) break;
        variances.level.push_back(static_cast<std::int32_t>(variances.level.size() + 1));
        variances.tau_s.push_back(or_unknown(level, "tau_s"));
        variances.value.push_back(or_unknown(level, "value"));
        variances.ci_low.push_back(or_unknown(level, "ci_low"));
        variances.ci_high.push_back(or_unknown(level, "ci_high"));
        variances.n_coefficients.push_back(count_at(level, "n"));
        model.fitted.push_back(or_unknown(level, "fitted"));
      }
      model.tau_s = variances.tau_s;
      variances.n_levels = model.n_levels = element_count(variances.tau_s);
      by_name[name].first.axes.push_back(std::move(variances));
      by_name[name].second.models.push_back(std::move(model));
    }
  }
  std::vector<Bytes> messages;
  for (auto& [name, both] : by_name) {
    both.first.name = both.second.name = name;
    both.first.n_axes = element_count(both.first.axes);
    both.second.n_models = element_count(both.second.models);
    messages.push_back(encode_message(both.first));
    messages.push_back(encode_message(both.second));
  }
  return messages;
}

/// What run.json tells of the devices, as of the run's end.
Bytes status_message(const json& run) {
  status_t status{};
  status.run = text_at(run, "name");
  status.version = text_at(run, "version");
  status.configuration_hash = text_at(run, "configuration_sha256");
  status.state = "recorded";
  status.reason = "the files of a run, not a service";
  status.refit_duration_s = kUnknown;
  status.uptime_s = number_at(run, "duration_s").value_or(0.0);
  const json& devices = field(run, "devices");
  if (devices.is_array()) {
    for (const json& one : devices) {
      if (status.devices.size() >= kDevicesMax) break;
      device_status_t device{};
      device.name = text_at(one, "name");
      device.role = text_at(one, "role");
      device.protocol = text_at(one, "protocol");
      device.state = "recorded";
      device.problem = text_at(one, "problem");
      device.rate_hz = or_unknown(one, "rate_hz");
      device.samples = count_at(one, "samples");
      device.samples_lost = count_at(one, "samples_lost");
      device.samples_late = count_at(one, "late");
      device.samples_refused = count_at(one, "refused");
      device.frames_dropped = count_at(one, "frames_dropped");
      device.bad_checksums = count_at(one, "bad_checksums");
      device.clock_resets = count_at(one, "clock_resets");
      device.data_age_s = device.clock_sd_us = kUnknown;
      device.latency_ms = 1e3 * or_unknown(field(one, "time_budget"), "latency_s");
      device.clock_drift_ppm = or_unknown(field(one, "time_budget"), "clock_drift_ppm");
      status.devices.push_back(std::move(device));
    }
  }
  status.n_devices = element_count(status.devices);
  return encode_message(status);
}

class RunFolderMessages final : public RecordedMessages {
 public:
  explicit RunFolderMessages(std::filesystem::path folder) : folder_(std::move(folder)) {}

  bool next(Bytes& message) override {
    if (at_ < first_.size()) {
      message = first_[at_++];
      return true;
    }
    const auto earliest = std::min_element(tables_.begin(), tables_.end(), [](const auto& a, const auto& b) {
      return a->time_s() < b->time_s();
    });
    if (earliest == tables_.end() || !((*earliest)->time_s() < kNever)) return false;
    message = (*earliest)->take();
    return true;
  }

  [[nodiscard]] std::optional<Place> place() const override {
    if (at_ < first_.size()) return std::nullopt;
    Place place;
    for (const auto& table : tables_) {
      const Table::Row row = table->row();
      place.at.push_back(row.place);
      place.at.push_back(static_cast<std::uint64_t>(row.sequence));
    }
    return place;
  }

  Result<void> go_to(const Place& place) override {
    if (place.at.size() != 2 * tables_.size()) return rewind();
    at_ = first_.size();
    for (std::size_t i = 0; i < tables_.size(); ++i)
      tables_[i]->go_to({place.at[2 * i], static_cast<std::int64_t>(place.at[2 * i + 1])});
    return {};
  }

  Result<void> rewind() override {
    tables_.clear();
    at_ = 0;
    const auto columns = navigation_columns();
    auto navigation = CsvReader::open(folder_ / "navigation.csv", names_of(columns));
    if (!navigation) return tl::unexpected<Error>(navigation.error());
    tables_.push_back(
        std::make_unique<PlainTable<navigation_t>>(std::move(*navigation), columns, navigation_t{}));
    const json run = tables::read_json_file(folder_ / "run.json");
    if (first_.empty()) {
      first_ = model_messages(folder_);
      first_.push_back(status_message(run));
    }
    const json& devices = field(run, "devices");
    if (!devices.is_array()) return {};
    for (const json& one : devices) {
      const std::string name = text_at(one, "name");
      if (text_at(one, "role") == "study" && is_device_name(name) && tables_.size() < kDevicesMax)
        add_imu(name);
    }
    return {};
  }

 private:
  /// A run that was killed, or that estimated nothing, lacks tables.
  void add_imu(const std::string& name) {
    const auto columns = calibration_columns();
    calibration_t fixed{};
    fixed.name = name;
    fixed.validity = kNoValidity;
    // The tables do not say the sensor's own goal; of a drive that is over one asks whether it is usable.
    fixed.goal_sd_psi_deg = kUsableGoal.boresight_sd_rad / kRadPerDeg;
    fixed.goal_sd_r_m = kUsableGoal.lever_arm_sd_m;
    fixed.goal_sd_t_d_ms = kUsableGoal.time_offset_sd_s * 1e3;
    fixed.weakest_relative_sd = kUnknown;
    fixed.psi_x_observable = fixed.psi_y_observable = fixed.psi_z_observable = 1;
    fixed.r_x_observable = fixed.r_y_observable = fixed.r_z_observable = fixed.t_d_observable = 1;
    auto calibration =
        CsvReader::open(folder_ / device_file_name("calibration", name, ".csv"), names_of(columns));
    if (calibration)
      tables_.push_back(std::make_unique<PlainTable<calibration_t>>(std::move(*calibration), columns, fixed));
    auto errors = CsvReader::open(folder_ / device_file_name("errors", name, ".csv"), ErrorTable::columns());
    if (errors) tables_.push_back(std::make_unique<ErrorTable>(std::move(*errors), name));
  }

  std::filesystem::path folder_;
  std::vector<Bytes> first_;
  std::size_t at_ = 0;
  std::vector<std::unique_ptr<Table>> tables_;
};

}  // namespace

Result<std::unique_ptr<RecordedMessages>> open_run_folder(const std::filesystem::path& folder) {
  auto messages = std::make_unique<RunFolderMessages>(folder);
  if (auto opened = messages->rewind(); !opened) return tl::unexpected<Error>(opened.error());
  return messages;
}

}  // namespace imuscope::view
