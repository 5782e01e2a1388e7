#pragma once

/// Wheel speeds inside the common filter: forward speed, no slip sideways or upwards, zero velocity at
/// standstill. A speed is applied at its time of validity, as a GNSS solution is (NavigationFilter). Its
/// error is slow rather than white (tyres, road), so that R is inflated to its low-frequency equivalent
/// (E-30). Core. Thread: one.

#include <array>
#include <cstddef>

#include "estimation/calibration/estimator.h"
#include "estimation/calibration/event_log.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/calibration/navigation_filter.h"
#include "estimation/navigation/gnss_gate.h"

namespace imuscope {

class OdometryFilter {
 public:
  OdometryFilter(const EstimatorConfig& config, FilterCore& core, const NavigationFilter& navigation,
                 EventLog& log, EstimatorCounters& counters);

  /// Takes one speed. False where it is of no use: not finite, or not newer than the one before.
  bool add(const Sample& sample) noexcept;
  /// After each R sample: applies what has its reference.
  /// @param time    of the R sample
  /// @param regime  as the regime detector sees it
  void process(HostTime time, Regime regime) noexcept;

  void update_output() noexcept;
  [[nodiscard]] const OdometryOutput& output() const noexcept { return output_; }

 private:
  /// Rows of an update whose model variance and inflated variance differ.
  struct Noise {
    Eigen::Vector3d plain;
    Eigen::Vector3d inflated;
  };

  void watch_silence(HostTime time) noexcept;
  void apply(const Sample& sample, Regime regime) noexcept;
  void apply_motion(const Sample& sample, const NavigationFilter::Delayed& then) noexcept;
  void apply_standstill(HostTime at, const NavigationFilter::Delayed& then) noexcept;
  void predict(HostTime time) noexcept;
  [[nodiscard]] Noise noise_of(const Eigen::Vector3d& sd) const noexcept;
  void note_speed(bool accepted, double excess_mps, HostTime time) noexcept;

  static constexpr std::size_t kPending = 64;

  OdometryConfig config_;
  FilterCore& core_;
  const NavigationFilter& navigation_;
  EventLog& log_;
  EstimatorCounters& counters_;
  double gate_;       ///< bound of y^2 / S of one axis
  double inflation_;  ///< of a variance, for its correlation in time
  GnssGate standstill_gate_;
  OdometryOutput output_;

  std::array<Sample, kPending> pending_{};
  std::size_t pending_size_ = 0;
  bool has_last_ = false;
  HostTime last_time_{};
  bool lost_ = false;
  bool wheels_stand_ = false;
  HostTime standing_since_{};
  bool has_predicted_ = false;
  HostTime predicted_to_{};
  bool streak_ = false;
  int rejected_in_a_row_ = 0;
  HostTime streak_start_{};
};

}  // namespace imuscope
