#pragma once

/// What the page shows: the newest messages of a service or of a recording, and as much of the past as a
/// page that was opened late needs. Bounded, whatever comes.

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <imuscope/calibration_t.hpp>
#include <imuscope/error_t.hpp>
#include <imuscope/navigation_t.hpp>
#include <imuscope/noise_model_t.hpp>
#include <imuscope/odometry_t.hpp>
#include <imuscope/status_t.hpp>
#include <imuscope/wavelet_variance_t.hpp>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "view/thinned_curve.h"

namespace imuscope::view {

/// Thread: one at a time. Deterministic: a function of the messages.
class Picture {
 public:
  static constexpr std::size_t kNamesMax = 16;   ///< S-IMUs; a run has six at most
  static constexpr std::size_t kPastMax = 100;   ///< tenths of a second of errors that a late page gets
  static constexpr std::size_t kRowsMax = 4096;  ///< of one S-IMU between two parts; the rest is counted
  static constexpr std::size_t kMarksMax = 20;   ///< newest events
  static constexpr std::size_t kTrackPointsMax = 800;
  static constexpr std::size_t kConvergencePointsMax = 120;
  static constexpr double kTrackStep_m = 0.5;

  /// Takes a message by the fingerprint that it begins with; what is none that a page shows is passed over.
  /// A service that began anew begins a new picture.
  /// @return whether it was taken
  bool hear(std::span<const std::uint8_t> message);
  /// Forgets all but the number of the picture, which goes on.
  void begin_anew();
  /// Becomes what another picture of the same recording was, under a number of its own.
  void become(const Picture& other);
  /// The next part is the whole picture, and no row is lost by it.
  void tell_all_next() noexcept { all_next_ = news_ = true; }

  /// What was heard since the last part, as one JSON object; all of it after begin_anew() or tell_all_next().
  /// `extra` are members of the object, each after a comma.
  [[nodiscard]] std::string part(std::string_view extra = {});
  /// All of it, for a page that knows nothing. The parts that follow go on from the last part().
  [[nodiscard]] std::string whole(std::string_view extra = {}) const;

  /// Whether a part would tell anything.
  [[nodiscard]] bool has_news() const noexcept { return news_; }
  /// Time of validity of the newest message that has one, seconds since the run's first R-IMU epoch.
  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  [[nodiscard]] const std::optional<status_t>& status() const noexcept { return status_; }
  /// Rows of error processes that were heard, and messages of them that were missing by their own count.
  [[nodiscard]] std::uint64_t rows() const noexcept { return rows_; }
  [[nodiscard]] std::uint64_t messages_lost() const noexcept { return messages_lost_; }

 private:
  /// Six axes of one S-IMU: extremes of the rows of a message.
  struct Extremes {
    double time_s = 0.0;
    std::array<double, 6> least{};
    std::array<double, 6> most{};
  };
  struct Imu {
    std::optional<calibration_t> calibration;
    std::optional<wavelet_variance_t> variances;
    std::optional<noise_model_t> models;
    ThinnedCurve<4> convergence{kConvergencePointsMax};  ///< time, sd of psi, r and t_d: the largest of each
    std::deque<Extremes> past;
    std::vector<error_row_t> rows;  ///< since the last part
    std::string regime;
    std::int8_t validity = 0;
    std::int64_t next_sequence = -1;
    bool new_calibration = false;
    bool new_variances = false;
    bool new_models = false;
  };
  struct Origin {
    double lat_deg, lon_deg, north_m_per_deg, east_m_per_deg;
  };
  struct Mark {
    double time_s;
    std::string text;
  };

  [[nodiscard]] Imu* imu(const std::string& name);
  void take(status_t&& status);
  void take(calibration_t&& calibration);
  void take(const navigation_t& navigation);
  void take(const odometry_t& odometry);
  void take(imuscope::error_t&& errors);
  void take(wavelet_variance_t&& variances);
  void take(noise_model_t&& models);
  void take_event(std::string_view text);
  void advance(double time_s);
  void draw_mounting();
  void append_head(std::string& out, bool whole, std::string_view extra) const;
  void append_navigation(std::string& out, bool whole) const;
  void append_imus(std::string& out, bool whole) const;
  void append_mounting(std::string& out, bool whole) const;
  void append_errors(std::string& out, bool whole) const;
  void append_marks(std::string& out, bool whole) const;

  std::optional<status_t> status_;
  std::optional<navigation_t> navigation_;
  std::optional<odometry_t> odometry_;
  std::map<std::string, Imu> imus_;
  std::optional<Origin> origin_;
  ThinnedCurve<2> track_{kTrackPointsMax};  ///< east, north of the origin, m
  std::vector<std::array<double, 2>> new_track_;
  std::array<double, 2> last_track_{};
  std::deque<Mark> marks_;
  std::size_t new_marks_ = 0;
  std::string mounting_;  ///< drawings of where the S-IMUs sit, as markup
  double time_s_ = 0.0;
  std::uint64_t number_ = 0;  ///< of the picture: a page that knows another one forgets it
  std::uint64_t rows_ = 0;
  std::uint64_t rows_left_out_ = 0;
  std::uint64_t messages_lost_ = 0;
  bool new_status_ = false;
  bool new_navigation_ = false;
  bool new_odometry_ = false;
  bool new_mounting_ = false;
  bool news_ = false;
  bool all_next_ = true;
};

}  // namespace imuscope::view
