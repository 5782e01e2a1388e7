#include "results/report/run_files.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>

#include "base/grouped.h"
#include "base/text.h"
#include "base/units.h"
#include "base/wgs84_ellipsoid.h"
#include "results/tables/csv_reader.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"

namespace imuscope::report {
namespace {

using tables::CsvReader;
using tables::field;
using tables::named;
using tables::read_json_file;
using tables::text_at;

using nlohmann::json;

/// Stretches a figure is made of: more than a wide screen has pixels across one is not seen.
constexpr std::size_t kBinsMax = 700;
constexpr std::size_t kMapBinsMax = 2000;
/// Shorter than any stretch of interest, longer than a sample period at 20 Hz or faster.
constexpr double kFirstBin_s = 0.05;
/// Fewest standstills that a figure shades one by one.
constexpr std::size_t kStretchesMax = 200;

template <typename T>
tl::unexpected<Error> passed_on(const Result<T>& failed) {
  return tl::unexpected<Error>(failed.error());
}

/// The document in `file`; null where the file is absent, which is noted in `absent`.
Result<json> read_json(const std::filesystem::path& file, std::vector<std::string>& absent) {
  if (!std::filesystem::exists(file)) {
    absent.push_back(file.filename().string());
    return json{};
  }
  json document = read_json_file(file);
  if (document.is_discarded() || !document.is_object()) {
    return work_error(file.string() + " is not a JSON object", "make the run again, or remove the file");
  }
  return document;
}

/// True where the file is there; else notes its absence.
bool present(const std::filesystem::path& file, std::vector<std::string>& absent) {
  if (std::filesystem::exists(file)) return true;
  absent.push_back(file.filename().string());
  return false;
}

/// Metres north and east of an origin. Radii of curvature of the WGS-84 ellipsoid at the origin:
/// good to a metre over a drive of tens of kilometres, finer than the map shows.
class LocalPlane {
 public:
  LocalPlane(double latitude_deg, double longitude_deg) : lat0_deg_(latitude_deg), lon0_deg_(longitude_deg) {
    const RadiiOfCurvature radii = radii_of_curvature(latitude_deg * kRadPerDeg);
    north_m_per_deg_ = kRadPerDeg * radii.meridian_m;
    east_m_per_deg_ = kRadPerDeg * radii.transverse_m * std::cos(latitude_deg * kRadPerDeg);
  }
  [[nodiscard]] double north_m(double latitude_deg) const {
    return (latitude_deg - lat0_deg_) * north_m_per_deg_;
  }
  [[nodiscard]] double east_m(double longitude_deg) const {
    return std::remainder(longitude_deg - lon0_deg_, 360.0) * east_m_per_deg_;
  }

 private:
  double lat0_deg_;
  double lon0_deg_;
  double north_m_per_deg_;
  double east_m_per_deg_;
};

constexpr const char* kNavigationFile = "navigation.csv";

Result<void> read_navigation(RunFiles& run) {
  auto reader = CsvReader::open(
      run.folder / kNavigationFile,
      {"time_s", "lat_deg", "lon_deg", "height_m", "v_n_mps", "v_e_mps", "sd_n_m", "sd_e_m", "sd_d_m"});
  if (!reader) return passed_on(reader);
  BinnedSignals signals(kNavigationSignals, kMapBinsMax, kFirstBin_s);
  std::optional<LocalPlane> plane;
  double previous_s = 0.0;
  while (reader->next()) {
    const double time_s = reader->number(0);
    const double latitude_deg = reader->number(1);
    const double longitude_deg = reader->number(2);
    if (!std::isfinite(time_s) || !std::isfinite(latitude_deg) || !std::isfinite(longitude_deg)) continue;
    const double speed_mps = std::hypot(reader->number(4), reader->number(5));
    if (!plane) {
      plane.emplace(latitude_deg, longitude_deg);
      run.origin_deg = {latitude_deg, longitude_deg};
    } else if (std::isfinite(speed_mps)) {
      run.distance_m += speed_mps * (time_s - previous_s);
    }
    previous_s = time_s;
    signals.add(time_s,
                std::array{plane->north_m(latitude_deg), plane->east_m(longitude_deg), reader->number(3),
                           speed_mps, reader->number(6), reader->number(7), reader->number(8)});
  }
  signals.coarsen();
  if (signals.size() > 0) run.navigation = std::move(signals);
  return {};
}

/// A run without odometry has no such file, and lacks nothing.
Result<void> read_odometry(RunFiles& run) {
  const auto file = run.folder / "odometry.csv";
  if (!std::filesystem::exists(file)) return {};
  auto reader = CsvReader::open(
      file, {"time_s", "speed_mps", "standing", "zero_velocity", "scale_percent", "sd_scale_percent"});
  if (!reader) return passed_on(reader);
  BinnedSignals signals(kOdometrySignals, kBinsMax, kFirstBin_s);
  std::optional<double> previous_s;
  while (reader->next()) {
    const double time_s = reader->number(0);
    if (!std::isfinite(time_s)) continue;
    // A row stands for the time since the one before; a gap is nobody's.
    constexpr double kRowMax_s = 0.2;
    const double step_s = std::clamp(time_s - previous_s.value_or(time_s), 0.0, kRowMax_s);
    previous_s = time_s;
    if (reader->number(2) > 0.0) run.wheels_stood_s += step_s;
    if (reader->number(3) > 0.0) run.zero_velocity_s += step_s;
    signals.add(time_s, std::array{reader->number(1), reader->number(4), reader->number(5)});
  }
  signals.coarsen();
  if (signals.size() > 0) run.odometry = std::move(signals);
  return {};
}

Result<void> read_calibration_series(const RunFiles& run, SImuFiles& study,
                                     std::vector<std::string>& absent) {
  const auto file = run.folder / device_file_name("calibration", study.name, ".csv");
  if (!present(file, absent)) return {};
  const std::vector<std::string> signals{"psi_x_deg", "psi_y_deg", "psi_z_deg", "r_x_m",
                                         "r_y_m",     "r_z_m",     "t_d_ms"};
  std::vector<std::string> columns{"time_s"};
  columns.insert(columns.end(), signals.begin(), signals.end());
  for (const std::string& signal : signals) columns.push_back("sd_" + signal);
  auto reader = CsvReader::open(file, columns);
  if (!reader) return passed_on(reader);
  BinnedSignals series(kCalibrationSignals, kBinsMax, kFirstBin_s);
  std::array<double, kCalibrationSignals> values{};
  while (reader->next()) {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = reader->number(i + 1);
    series.add(reader->number(0), values);
  }
  series.coarsen();
  if (series.size() > 0) study.calibration_series = std::move(series);
  return {};
}

/// Collects the times at rest from one sample after the other.
class StaticStretches {
 public:
  void add(double time_s, bool is_static) {
    if (is_static && !inside_) found_.push_back({time_s, time_s});
    if (is_static) found_.back().end_s = time_s;
    inside_ = is_static;
  }
  /// The longest ones, in order of time.
  std::vector<Stretch> take() {
    if (found_.size() > kStretchesMax) {
      const auto length = [](const Stretch& stretch) { return stretch.end_s - stretch.begin_s; };
      std::sort(found_.begin(), found_.end(),
                [&](const Stretch& a, const Stretch& b) { return length(a) > length(b); });
      found_.resize(kStretchesMax);
      std::sort(found_.begin(), found_.end(),
                [](const Stretch& a, const Stretch& b) { return a.begin_s < b.begin_s; });
    }
    return std::move(found_);
  }

 private:
  std::vector<Stretch> found_;
  bool inside_ = false;
};

Result<void> read_errors(const RunFiles& run, SImuFiles& study, std::vector<std::string>& absent) {
  const auto file = run.folder / device_file_name("errors", study.name, ".csv");
  if (!present(file, absent)) return {};
  auto reader = CsvReader::open(file, {"time_s", "e_gyro_x_radps", "e_gyro_y_radps", "e_gyro_z_radps",
                                       "e_accel_x_mps2", "e_accel_y_mps2", "e_accel_z_mps2", "regime"});
  if (!reader) return passed_on(reader);
  constexpr std::size_t kRegime = kErrorSignals + 1;
  BinnedSignals errors(kErrorSignals, kBinsMax, kFirstBin_s);
  StaticStretches stretches;
  std::array<double, kErrorSignals> values{};
  std::array<double, kErrorSignals> sum_of_squares{};
  std::array<double, kErrorSignals> n{};
  while (reader->next()) {
    const double time_s = reader->number(0);
    if (!std::isfinite(time_s)) continue;
    for (std::size_t i = 0; i < kErrorSignals; ++i) {
      values[i] = reader->number(i + 1) * (i < 3 ? kDegPerRad : 1.0);
      if (!std::isfinite(values[i])) continue;
      sum_of_squares[i] += values[i] * values[i];
      n[i] += 1.0;
    }
    errors.add(time_s, values);
    stretches.add(time_s, reader->cell(kRegime) == "static");
    ++study.n_errors;
  }
  for (std::size_t i = 0; i < kErrorSignals; ++i) study.rms[i] = std::sqrt(sum_of_squares[i] / n[i]);
  study.static_stretches = stretches.take();
  errors.coarsen();
  if (errors.size() > 0) study.errors = std::move(errors);
  return {};
}

/// Where nothing moved there is a file without a row, and no scatter.
Result<void> read_scatter_of(const RunFiles& run, SImuFiles& study, std::vector<std::string>& absent) {
  const auto file = run.folder / device_file_name("scatter", study.name, ".csv");
  if (!present(file, absent)) return {};
  auto scatter = read_scatter(file);
  if (!scatter) return passed_on(scatter);
  if (!scatter->errors[0].empty()) study.scatter = std::move(*scatter);
  return {};
}

/// The S-IMUs by name, with what the documents say of them.
Result<void> begin_studies(RunFiles& run, const json& calibration) {
  auto truth = read_json(run.folder / "truth.json", run.absent);
  if (!truth) return passed_on(truth);
  run.has_truth = !truth->is_null();
  for (const json& imu : field(calibration, "imus")) {
    SImuFiles study;
    study.name = text_at(imu, "name");
    if (!is_device_name(study.name)) {
      return work_error(
          fmt::format("{} names an S-IMU '{}'; its name becomes part of file names and has 1 to {} "
                      "letters, digits, '_' or '-'",
                      (run.folder / "calibration.json").string(), study.name, kDeviceNameMax),
          "no run writes such a name: ask where the folder comes from");
    }
    study.calibration = imu;
    study.truth = named(field(*truth, "imus"), study.name);
    run.studies.push_back(std::move(study));
  }
  return {};
}

/// Reads one file, and notes its absence.
using FileReader = std::function<Result<void>(std::vector<std::string>& absent)>;

/// Every file by itself, on any thread. Absent files and the first failure are told as if they were read in order.
Result<void> read_side_by_side(const std::vector<FileReader>& readers, std::vector<std::string>& absent) {
  std::vector<Result<void>> read(readers.size());
  std::vector<std::vector<std::string>> absent_of(readers.size());
  tbb::parallel_for(
      std::size_t{0}, readers.size(), [&](std::size_t i) { read[i] = readers[i](absent_of[i]); },
      tbb::simple_partitioner());
  for (std::size_t i = 0; i < readers.size(); ++i) {
    absent.insert(absent.end(), absent_of[i].begin(), absent_of[i].end());
    if (!read[i]) return read[i];
  }
  return {};
}

/// The files that grow with the drive.
Result<void> read_series(RunFiles& run, bool has_navigation) {
  std::vector<FileReader> readers;
  if (has_navigation) readers.emplace_back([&](auto&) { return read_navigation(run); });
  readers.emplace_back([&](auto&) { return read_odometry(run); });
  for (SImuFiles& study : run.studies) {
    readers.emplace_back([&](auto& absent) { return read_calibration_series(run, study, absent); });
    readers.emplace_back([&](auto& absent) { return read_errors(run, study, absent); });
    readers.emplace_back([&](auto& absent) { return read_scatter_of(run, study, absent); });
  }
  return read_side_by_side(readers, run.absent);
}

}  // namespace

std::vector<std::string> names_of(const RunFiles& run) {
  std::vector<std::string> names;
  for (const SImuFiles& study : run.studies) names.push_back(study.name);
  return names;
}

std::vector<std::string> sentences_of(const RunFiles& run, const char* key) {
  std::vector<std::string> sentences;
  for (const auto& sentence : field(run.run, key)) {
    if (sentence.is_string()) sentences.push_back(sentence.get<std::string>());
  }
  return grouped_by_name(sentences, names_of(run));
}

Result<RunFiles> read_run_files(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder)) {
    return work_error(folder.string() + " is not a folder", "give the folder that a run wrote with --out");
  }
  RunFiles run;
  run.folder = folder;
  auto calibration = read_json(folder / "calibration.json", run.absent);
  if (!calibration) return passed_on(calibration);
  if (calibration->is_null() || !field(*calibration, "imus").is_array()) {
    return work_error(folder.string() + " holds no calibration.json with a list \"imus\"",
                      "a report needs the folder of a finished run; make one with --out " + folder.string());
  }
  auto document = read_json(folder / "run.json", run.absent);
  auto models = read_json(folder / "models.json", run.absent);
  auto regressions = read_json(folder / "regression.json", run.absent);
  for (const auto* read : {&document, &models, &regressions}) {
    if (!*read) return passed_on(*read);
  }
  run.run = std::move(*document);
  run.models = field(*models, "models");
  run.regressions = field(*regressions, "regressions");
  run.regression_remarks = field(*regressions, "remarks");
  const std::pair<const char*, json*> kStudies[] = {{"regimes.json", &run.regimes},
                                                    {"comparison.json", &run.comparison},
                                                    {"dependence.json", &run.dependence},
                                                    {"vibration.json", &run.vibration},
                                                    {"evaluation.json", &run.evaluation}};
  for (const auto& [name, document_of] : kStudies) {
    auto read = read_json(folder / name, run.absent);
    if (!read) return passed_on(read);
    *document_of = std::move(*read);
  }
  const bool has_navigation = present(folder / kNavigationFile, run.absent);
  if (auto begun = begin_studies(run, *calibration); !begun) return passed_on(begun);
  if (auto read = read_series(run, has_navigation); !read) return passed_on(read);
  return run;
}

}  // namespace imuscope::report
