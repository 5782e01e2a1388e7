#pragma once

/// The files of a run: navigation.csv, odometry.csv (where there is odometry), calibration_NAME.csv,
/// errors_NAME.csv while it goes, calibration.json and run.json at its end. Columns and keys are promised to
/// users; see docs/files.md. Non-real-time: one thread, allocates, writes files.

#include <fmt/format.h>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "service/pipeline/core.h"
#include "service/run/utc_track.h"

namespace imuscope {

/// Rows are formatted in memory and written in blocks; a failed write is told by close().
class CsvFile {
 public:
  /// Begins a new file in place of whatever has its name in the folder.
  Result<void> open(const OutputFolder& folder, const std::string& name, const std::string& header);
  /// Appends text that ends in a newline.
  void append(std::string_view rows) { out_.write(rows); }
  [[nodiscard]] Result<void> close() { return out_.close(); }
  [[nodiscard]] std::optional<Error> problem() const { return out_.problem(); }
  [[nodiscard]] bool is_open() const { return out_.is_open(); }

 private:
  OutputFile out_;
};

/// When a row is valid, in the columns time_s and utc_s.
struct RowTime {
  double time_s = 0.0;  ///< since the run's first R-IMU epoch, by the host's clock
  UtcStamp utc;         ///< utc_s: seconds since 1970-01-01, six decimals; empty where nobody told UTC
};

/// Writes `document`, indented, numbers with the digits that give the same double back.
Result<void> write_json(const OutputFolder& folder, const std::string& name, const nlohmann::json& document);

/// Straight line through (counter, time of validity): when a sample of the device showed the motion.
class SampleTimeLine {
 public:
  void add(std::int64_t counter, double time_s);
  [[nodiscard]] bool valid() const { return n_ >= 2.0 && sum_cc_ > 0.0; }
  [[nodiscard]] std::int64_t counter0() const { return counter0_; }
  [[nodiscard]] double period_s() const;
  /// Time of counter0.
  [[nodiscard]] double t0_s() const;
  [[nodiscard]] double n() const { return n_; }

 private:
  std::int64_t counter0_ = 0;
  double n_ = 0.0;
  double mean_c_ = 0.0;
  double mean_t_ = 0.0;
  double sum_cc_ = 0.0;
  double sum_ct_ = 0.0;
};

/// What a file needs to know of one S-IMU beyond its estimate.
struct SImuFileInfo {
  std::string name;
  /// Seconds that were added to the device's own times before the estimator saw them (recordings with a clock
  /// of their own). Written time offsets include it, so that they refer to the times as recorded.
  double clock_shift_s = 0.0;
};

/// Writes the series of a run as the core produces them. Errors of the disk are kept and told by close().
/// What calibration.json says of one S-IMU: the estimate, and keys that are added to it or replace its own.
struct CalibrationEntry {
  SImuOutput study;
  nlohmann::json more = nlohmann::json::object();
};

class RunFolder final : public CoreSink {
 public:
  /// Creates the folder if needed. Existing files of an earlier run in it are replaced.
  static Result<std::unique_ptr<RunFolder>> create(const std::filesystem::path& folder,
                                                   std::vector<SImuFileInfo> studies, bool write_errors);

  void on_error(const ErrorRecord& record) noexcept override;
  void on_event(const EstimatorEvent& event) noexcept override;
  void on_snapshot(const Snapshot& snapshot) noexcept override;
  void on_late_sample(const LateSample& late) noexcept override;

  /// A row of the error process under the name of its regime.
  void write_error(const ErrorRecord& record, std::string_view regime);

  [[nodiscard]] const OutputFolder& folder() const { return folder_; }
  [[nodiscard]] const std::optional<Snapshot>& last_snapshot() const { return last_; }
  [[nodiscard]] const std::vector<LateSample>& late_samples() const { return late_; }
  [[nodiscard]] const std::vector<EstimatorEvent>& events() const { return events_; }
  [[nodiscard]] const UtcTrack& utc() const { return utc_; }

  /// Writes calibration.json from the last snapshot, or from what a study made of it.
  [[nodiscard]] Result<void> write_calibration();
  [[nodiscard]] Result<void> write_calibration(const std::vector<CalibrationEntry>& entries);
  /// What is wrong with the disk now, of the first of the files that has lost a line to it.
  [[nodiscard]] std::optional<Error> problem() const;
  /// Closes the CSV files; the first failed write, if any, is the error.
  [[nodiscard]] Result<void> close();

 private:
  explicit RunFolder(OutputFolder folder) : folder_(std::move(folder)) {}
  /// @param shift_s  from the host's time to the motion's: the time offset of an S-IMU
  [[nodiscard]] RowTime row_time(HostTime time, double shift_s = 0.0) const;
  void add_odometry();

  OutputFolder folder_;
  std::vector<SImuFileInfo> studies_;
  CsvFile navigation_;
  CsvFile odometry_;
  Result<void> odometry_opened_;
  std::vector<CsvFile> calibrations_;
  std::vector<CsvFile> errors_;
  std::vector<SampleTimeLine> sample_times_;
  std::vector<EstimatorEvent> events_;
  std::vector<LateSample> late_;
  std::optional<Snapshot> last_;
  UtcTrack utc_;
};

/// The two columns that every row begins with: time_s, utc_s.
void append_time(const RowTime& time, fmt::memory_buffer& row);
/// Header and rows of navigation.csv.
std::string navigation_csv_header();
std::string navigation_csv_row(const NavigationOutput& navigation, const RowTime& time);
/// Header and rows of odometry.csv.
std::string odometry_csv_header();
std::string odometry_csv_row(const OdometryOutput& odometry, const RowTime& time);
/// Header and rows of calibration_NAME.csv.
std::string calibration_csv_header();
std::string calibration_csv_row(const SImuOutput& study, const SImuFileInfo& info, const RowTime& time);
/// Row of errors_NAME.csv.
/// @param regime  its last column; empty where none holds
std::string error_csv_row(const ErrorRow& row, double time_s, std::string_view regime);
/// Header of errors_NAME.csv.
std::string error_csv_header();

/// One entry of calibration.json's "imus".
nlohmann::json calibration_json(const SImuFileInfo& info, const SImuOutput& study,
                                const SampleTimeLine& times);

}  // namespace imuscope
