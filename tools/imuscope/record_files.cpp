#include "record_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <execution>
#include <iterator>
#include <memory>
#include <string_view>

#include "axis_columns.h"
#include "base/units.h"
#include "capture_axes.h"
#include "message_signal.h"

namespace imuscope::cli {
namespace {

/// Where one axis stands.
struct AxisSource {
  std::filesystem::path file;
  AxisColumn column;
};

constexpr std::array<const char*, 6> kAxisOrder{"gyro_x",  "gyro_y",  "gyro_z",
                                                "accel_x", "accel_y", "accel_z"};

bool is_gyro_name(const std::string& axis) { return axis.starts_with("gyro"); }

std::size_t place_of(const std::string& axis) {
  return static_cast<std::size_t>(std::find(kAxisOrder.begin(), kAxisOrder.end(), axis) - kAxisOrder.begin());
}

/// Mean of what is there; NaN where it cannot be read.
double mean_of(const certificate::AxisRecord& record) {
  if (record.fetch) {
    auto values = record.fetch();
    return values ? mean_of({record.name, record.unit, record.rate_hz, std::move(*values), record.mask})
                  : std::nan("");
  }
  double sum = 0.0;
  double n = 0.0;
  for (std::size_t i = 0; i < record.values.size(); ++i) {
    if ((!record.mask.empty() && record.mask[i] == 0) || !std::isfinite(record.values[i])) continue;
    sum += record.values[i];
    n += 1.0;
  }
  return n > 0.0 ? sum / n : 0.0;
}

void multiply(certificate::AxisRecord& record, double factor) {
  if (factor == 1.0) return;
  for (double& v : record.values) v *= factor;
  if (!record.fetch) return;
  record.fetch = [fetch = std::move(record.fetch), factor]() -> Result<std::vector<double>> {
    auto values = fetch();
    if (values) std::for_each(values->begin(), values->end(), [factor](double& v) { v *= factor; });
    return values;
  };
}

/// The unit of accelerometers at rest, by the size of gravity, where names do not tell.
Result<void> units_by_gravity(SensorRecord& sensor, const std::string& file) {
  double square = 0.0;
  int n = 0;
  bool unknown = false;
  for (const auto& axis : sensor.axes) {
    if (is_gyro_name(axis.name)) continue;
    const double mean = mean_of(axis);
    square += mean * mean;
    ++n;
    unknown = unknown || axis.unit == noise::SignalUnit::kNone;
  }
  if (!unknown) return {};
  const double size = std::sqrt(square);
  constexpr double kSlack = 0.15;
  const auto near = [&](double gravity) { return std::abs(size / gravity - 1.0) < kSlack; };
  constexpr double kThousand = 1e3;
  noise::SignalUnit unit = noise::SignalUnit::kNone;
  double factor = 1.0;
  if (n == 3 && near(kMps2PerG)) unit = noise::SignalUnit::kMps2;
  if (n == 3 && near(1.0)) unit = noise::SignalUnit::kG;
  if (n == 3 && near(kThousand)) unit = noise::SignalUnit::kG, factor = 1.0 / kThousand;
  if (unit == noise::SignalUnit::kNone) {
    return usage_error(fmt::format("{} does not say the unit of its accelerometers, and {:.4g} is no "
                                   "size of gravity in m/s^2, g or mg",
                                   file, size),
                       "give --accel-unit m/s^2 or g");
  }
  for (auto& axis : sensor.axes) {
    if (is_gyro_name(axis.name)) continue;
    axis.unit = unit;
    multiply(axis, factor);
  }
  return {};
}

/// A triad whose axes have different units by their names, and one that shows no gravity in its own.
void look_at_units(SensorRecord& sensor) {
  const certificate::AxisRecord* first_gyro = nullptr;
  const certificate::AxisRecord* first_accel = nullptr;
  double square = 0.0;
  int n = 0;
  for (const auto& axis : sensor.axes) {
    const auto*& first = is_gyro_name(axis.name) ? first_gyro : first_accel;
    if (first == nullptr) first = &axis;
    if (axis.unit != first->unit) {
      sensor.warnings.push_back(
          fmt::format("{} is in {} and {} in {} by their names, and taken so; is one of them wrong?",
                      first->name, unit_name(first->unit), axis.name, unit_name(axis.unit)));
    }
    if (is_gyro_name(axis.name)) continue;
    const double mean = mean_of(axis) * si_factor(axis.unit);
    square += mean * mean;
    ++n;
  }
  constexpr double kSlack = 0.15;
  if (n != 3 || std::abs(std::sqrt(square) / kMps2PerG - 1.0) < kSlack) return;
  sensor.warnings.push_back(
      fmt::format("the accelerometers show {:.3g} m/s^2, and gravity is {:.3g}: a wrong unit, a swapped "
                  "column, or no rest",
                  std::sqrt(square), kMps2PerG));
}

Result<noise::SignalUnit> given_unit(const AxisColumn& column, const RecordChoice& choice) {
  const std::string& text = is_gyro_name(column.axis) ? choice.gyro_unit : choice.accel_unit;
  if (text.empty()) return column.unit;
  const auto unit = noise::parse_unit(text);
  if (!unit) return tl::unexpected(unit.error());
  if (is_gyro(*unit) != is_gyro_name(column.axis)) {
    return usage_error(
        fmt::format("{} is no unit of {}", text, is_gyro_name(column.axis) ? "an angular rate" : "a force"),
        "give rad/s or deg/s for gyroscopes, m/s^2 or g for accelerometers");
  }
  return *unit;
}

/// What is read of the axes' sources, one a source.
struct ReadAxes {
  std::vector<Signal> signals;
  std::vector<certificate::FetchSamples> fetches{};  ///< of raw files that stay where they are; else empty
  std::shared_ptr<const std::vector<float>> temperature_c{};  ///< null: none
};

/// Columns of one table.
Result<ReadAxes> read_table(const std::vector<AxisSource>& sources, const std::string& temperature,
                            const SignalChoice& choice) {
  std::vector<std::string> columns;
  for (const AxisSource& source : sources) columns.push_back(source.column.column);
  if (!temperature.empty()) columns.push_back(temperature);
  auto table = read_signals(sources.front().file, choice, columns);
  if (!table) return tl::unexpected(table.error());
  ReadAxes out;
  if (!temperature.empty())
    out.temperature_c = std::make_shared<const std::vector<float>>(table->columns.back().begin(),
                                                                   table->columns.back().end());
  for (std::size_t i = 0; i < sources.size(); ++i)
    out.signals.push_back({std::move(table->columns[i]), table->mask, table->rate_hz});
  return out;
}

/// Raw files that together are larger are read axis by axis, when they are needed.
constexpr std::uintmax_t kMostBytes = std::uintmax_t{96} << 20U;

bool are_long(const std::vector<AxisSource>& sources) {
  std::uintmax_t bytes = 0;
  for (const AxisSource& source : sources) {
    std::error_code error;
    const auto size = std::filesystem::file_size(source.file, error);
    if (!error) bytes += size;
  }
  return bytes > kMostBytes;
}

/// Raw files side by side.
Result<ReadAxes> read_raw_axes(const std::vector<AxisSource>& sources, const SignalChoice& choice) {
  if (are_long(sources)) {
    ReadAxes out;
    for (const AxisSource& source : sources) {
      out.signals.push_back({{}, {}, choice.rate_hz});
      out.fetches.emplace_back([file = source.file, choice]() -> Result<std::vector<double>> {
        auto signal = read_signal(file, choice);
        if (!signal) return tl::unexpected(signal.error());
        return std::move(signal->values);
      });
    }
    return out;
  }
  std::vector<Result<Signal>> read(sources.size(), work_error("not read"));
  std::transform(std::execution::par, sources.begin(), sources.end(), read.begin(),
                 [&](const AxisSource& source) { return read_signal(source.file, choice); });
  ReadAxes out;
  for (auto& signal : read) {
    if (!signal) return tl::unexpected(signal.error());
    out.signals.push_back(std::move(*signal));
  }
  return out;
}

/// Names, units and rates of what was read.
Result<void> take_axes(SensorRecord& sensor, const std::vector<AxisSource>& sources, ReadAxes&& read,
                       const RecordChoice& choice) {
  for (std::size_t i = 0; i < sources.size(); ++i) {
    Signal& signal = read.signals[i];
    const std::string file = sources[i].file.string();
    if (!signal.rate_hz)
      return usage_error(fmt::format("{} has no time stamps that would tell its rate", file),
                         "give the samples per second, --rate");
    if (!(*signal.rate_hz > 0.0) || !std::isfinite(*signal.rate_hz))
      return usage_error(fmt::format("--rate {} is impossible", *signal.rate_hz),
                         "give the samples per second");
    const auto unit = given_unit(sources[i].column, choice);
    if (!unit) return tl::unexpected(unit.error());
    if (*unit == noise::SignalUnit::kNone && is_gyro_name(sources[i].column.axis))
      return usage_error(fmt::format("{} does not say the unit of {}", file, sources[i].column.axis),
                         "give --gyro-unit rad/s or deg/s");
    certificate::AxisRecord axis;
    axis.name = sources[i].column.axis;
    axis.unit = *unit;
    axis.rate_hz = *signal.rate_hz;
    axis.values = std::move(signal.values);
    axis.mask = std::move(signal.mask);
    if (!read.fetches.empty()) axis.fetch = std::move(read.fetches[i]);
    multiply(axis, sources[i].column.factor);
    axis.temperature_c = read.temperature_c;
    sensor.axes.push_back(std::move(axis));
  }
  if (auto known = units_by_gravity(sensor, sources.front().file.string()); !known) return known;
  look_at_units(sensor);
  return {};
}

void in_order(std::vector<AxisSource>& sources) {
  std::stable_sort(sources.begin(), sources.end(), [](const AxisSource& a, const AxisSource& b) {
    return place_of(a.column.axis) < place_of(b.column.axis);
  });
}

Result<SensorRecord> read_csv(const std::filesystem::path& file, const RecordChoice& choice) {
  const auto names = header_of(file);
  if (!names) return tl::unexpected(names.error());
  std::vector<AxisSource> sources;
  std::string temperature = choice.temperature == "none" ? "" : choice.temperature;
  for (const auto& [axis, column] : choice.axes) {
    auto known = axis_of_name(column).value_or(AxisColumn{});
    known.axis = axis;
    known.column = column;
    sources.push_back({file, known});
  }
  for (const auto& name : *names) {
    if (choice.temperature.empty() && temperature.empty() && is_temperature_name(name)) temperature = name;
    const auto axis = choice.axes.empty() ? axis_of_name(name) : std::nullopt;
    const bool known = axis && std::any_of(sources.begin(), sources.end(),
                                           [&](const auto& s) { return s.column.axis == axis->axis; });
    if (axis && !known) sources.push_back({file, *axis});
  }
  if (sources.empty()) {
    return usage_error(fmt::format("{} has no column whose name tells an axis", file.string()),
                       names->empty()
                           ? std::string("it has no header: give --axis gyro_x=COLUMN and so on, by number")
                           : fmt::format("its columns are {}; give --axis gyro_x=COLUMN and so on",
                                         fmt::join(*names, ", ")));
  }
  in_order(sources);
  SensorRecord sensor{file.stem().string(), {file.filename().string()}, {}, {}};
  auto read = read_table(sources, temperature, choice.signal);
  if (!read) return tl::unexpected(read.error());
  if (auto taken = take_axes(sensor, sources, std::move(*read), choice); !taken)
    return tl::unexpected(taken.error());
  return sensor;
}

Result<SensorRecord> read_raw_files(const std::vector<std::filesystem::path>& files,
                                    const RecordChoice& choice) {
  std::vector<AxisSource> sources;
  SensorRecord sensor;
  for (const auto& file : files) {
    auto axis = axis_of_name(file.stem().string());
    if (!axis && files.size() == 1 && choice.axes.size() == 1)
      axis = AxisColumn{choice.axes.begin()->first, ""};
    if (!axis) {
      return usage_error(
          fmt::format("the name of {} tells no axis", file.string()),
          "name raw files after their axes, as gyro_x_degps.f64, or give --axis gyro_x= for a single one");
    }
    axis->column.clear();
    sources.push_back({file, *axis});
    sensor.files.push_back(file.filename().string());
  }
  in_order(sources);
  const auto folder = std::filesystem::absolute(files.front()).parent_path().filename().string();
  sensor.name = folder.empty() ? files.front().stem().string() : folder;
  auto read = read_raw_axes(sources, choice.signal);
  if (!read) return tl::unexpected(read.error());
  if (auto taken = take_axes(sensor, sources, std::move(*read), choice); !taken)
    return tl::unexpected(taken.error());
  return sensor;
}

/// All axes of one topic.
Result<SensorRecord> read_messages(const std::filesystem::path& file, const RecordChoice& choice) {
  auto read = read_message_axes(file, choice.signal.topic, choice.signal.rate_hz);
  if (!read) return tl::unexpected(read.error());
  SensorRecord sensor{file.stem().string(), {file.filename().string()}, {}, {}};
  if (!choice.signal.topic.empty()) sensor.selection = "topic " + choice.signal.topic;
  for (std::size_t i = 0; i < kMessageAxes.size(); ++i) {
    Signal& signal = read->axes[i];
    // A triad that the messages do not have is none of the record's.
    if (std::none_of(signal.mask.begin(), signal.mask.end(), [](std::uint8_t there) { return there != 0; }))
      continue;
    certificate::AxisRecord axis;
    axis.name = kMessageAxes[i];
    axis.unit = is_gyro_name(axis.name) ? noise::SignalUnit::kRadps : noise::SignalUnit::kMps2;
    axis.rate_hz = *signal.rate_hz;
    axis.values = std::move(signal.values);
    axis.mask = std::move(signal.mask);
    sensor.axes.push_back(std::move(axis));
  }
  sensor.warnings = std::move(read->warnings);
  return sensor;
}

/// The error process of one S-IMU in one regime.
Result<SensorRecord> read_run(const std::filesystem::path& folder, const RecordChoice& choice) {
  std::vector<std::string> imus;
  constexpr std::string_view kBegin = "errors_";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string stem = entry.path().stem().string();
    if (entry.path().extension() == ".csv" && stem.starts_with(kBegin))
      imus.push_back(stem.substr(kBegin.size()));
  }
  std::sort(imus.begin(), imus.end());
  if (imus.empty())
    return work_error(fmt::format("{} holds no errors_NAME.csv", folder.string()),
                      "give the folder of a study");
  std::string imu = choice.imu;
  if (imu.empty() && imus.size() == 1) imu = imus.front();
  if (std::find(imus.begin(), imus.end(), imu) == imus.end()) {
    return usage_error(imu.empty() ? fmt::format("{} holds several IMUs", folder.string())
                                   : fmt::format("{} holds no IMU {}", folder.string(), imu),
                       fmt::format("give --name; there is {}", fmt::join(imus, ", ")));
  }
  RecordChoice of_run = choice;
  if (choice.regime != "all") of_run.signal.where = "regime=" + choice.regime;
  of_run.signal.counter = "counter";
  of_run.axes.clear();
  auto sensor = read_csv(folder / (std::string(kBegin) + imu + ".csv"), of_run);
  if (!sensor) return sensor;
  sensor->name = imu;
  sensor->selection = "regime " + choice.regime;
  return sensor;
}

}  // namespace

Result<std::vector<SensorRecord>> read_records(const std::vector<std::filesystem::path>& files,
                                               const RecordChoice& choice) {
  std::vector<SensorRecord> records;
  std::vector<std::filesystem::path> raw;
  for (const auto& file : files) {
    if (file.extension() == ".f64") {
      raw.push_back(file);
      continue;
    }
    if (is_capture(file)) {
      auto of_devices = read_capture_axes(file, choice);
      if (!of_devices) return tl::unexpected(of_devices.error());
      std::move(of_devices->begin(), of_devices->end(), std::back_inserter(records));
      continue;
    }
    auto record = std::filesystem::is_directory(file) ? read_run(file, choice)
                  : is_message_log(file)              ? read_messages(file, choice)
                                                      : read_csv(file, choice);
    if (!record) return tl::unexpected(record.error());
    records.push_back(std::move(*record));
  }
  if (!raw.empty()) {
    auto record = read_raw_files(raw, choice);
    if (!record) return tl::unexpected(record.error());
    records.push_back(std::move(*record));
  }
  return records;
}

}  // namespace imuscope::cli
