#pragma once

/// How far the navigation of a run is off beside what was claimed for it, at instants that UTC names on both
/// sides.

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "estimation/calibration/estimator.h"
#include "tools/trials/s_imu_score.h"

namespace s_imu_score {

/// The rows of a simulator's truth.csv, found by UTC.
class NavigationTruth {
 public:
  /// @param folder  of a recording: truth.json says what UTC the rows begin at
  static imuscope::Result<NavigationTruth> read(const std::filesystem::path& folder);

  struct Row {
    double latitude_rad;
    double longitude_rad;
    double height_m;
    imuscope::Vector3 v_n_mps;
    imuscope::Vector3 rpy_rad;
  };
  /// The row within half a millisecond of an instant; null where there is none.
  [[nodiscard]] const Row* at(imuscope::UtcTime utc) const;
  /// The instant of that row.
  [[nodiscard]] imuscope::UtcTime instant_of(const Row& row) const;

 private:
  imuscope::UtcTime begin_{};
  double rows_hz_ = 0.0;
  std::vector<Row> rows_;
};

/// Heading, level, velocity and position, and the UTC of a row, from a minute after the navigation's
/// beginning on. Errors of one drive hang together over minutes: a mean over drives is what tells.
class NavigationScore {
 public:
  /// @param scale  by which the files tell the row's UTC
  void add(const imuscope::NavigationOutput& out, const imuscope::TimeScale& scale,
           const NavigationTruth& truth);
  void add(const NavigationScore& other);
  [[nodiscard]] std::string table() const;
  /// Whether nine tenths of the errors of every kind are within their 95 % intervals.
  [[nodiscard]] bool is_honest() const;
  [[nodiscard]] const StateScore& heading() const { return heading_; }
  /// By name: heading, level, velocity, position.
  [[nodiscard]] std::vector<std::pair<const char*, const StateScore*>> scores() const {
    return {{"heading", &heading_}, {"level", &level_}, {"velocity", &velocity_}, {"position", &position_}};
  }
  /// Of every row, without sign.
  [[nodiscard]] const std::vector<double>& utc_errors_s() const { return utc_errors_s_; }

 private:
  StateScore heading_;
  StateScore level_;
  StateScore velocity_;
  StateScore position_;
  StateScore utc_;
  std::vector<double> utc_errors_s_;
};

}  // namespace s_imu_score
