#pragma once

/// The newest R-IMU samples, and the reference's motion at any instant among them.
///
/// S samples are never resampled; the reference is evaluated at their times instead: a polynomial of order 4
/// through (5 points) or fitted to (7, 9 or 11 points, Savitzky-Golay) the samples around the sample nearest
/// to the instant, from their actual time stamps (A-1 to A-4 in EQUATIONS.md), gives value and derivatives.
/// Five points keep the amplitude of the derivative to 0.5 % at 10 Hz and suit a fibre-optic reference at 100
/// Hz; seven to eleven points trade bandwidth for noise, for a MEMS reference.
///
/// Core: fixed memory, no allocation, noexcept. Thread: owner only.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/time.h"
#include "sample/sample.h"

namespace imuscope {

/// The reference's motion at one instant, resolved in b, not bias-compensated (derivatives do not care).
struct ReferenceKinematics {
  Eigen::Vector3d omega_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega_dot_radps2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega_ddot_radps3 = Eigen::Vector3d::Zero();
  Eigen::Vector3d f_mps2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d f_dot_mps3 = Eigen::Vector3d::Zero();
  /// sd of the value / of the first derivative for white noise of sd 1 on each sample: what the reference's
  /// noise adds to R. The noise of omega' stays correlated over as many epochs as the window has points.
  double value_noise_gain = 1.0;
  double derivative_noise_gain_per_s = 0.0;       ///< of omega' from differentiated omega
  bool angular_acceleration_is_measured = false;  ///< omega' is the device's own, interpolated
};

enum class ReferenceResult : std::uint8_t {
  kOk,
  kTooNew,  ///< wait: the samples after the instant have not arrived
  kTooOld,  ///< the ring no longer holds the samples before the instant
  kGap,     ///< samples are missing around the instant
};

/// Width of the polynomial's window and spacing of the samples; fixed for the life of the window.
struct ReferenceWindowOptions {
  int points = 5;          ///< 5, 7, 9 or 11
  double period_s = 0.01;  ///< nominal sample period; a spacing above 1.5 periods is a gap
};

class ReferenceWindow {
 public:
  /// Allocates reference_window_capacity() of the nominal rate (base/limits.h).
  explicit ReferenceWindow(const ReferenceWindowOptions& options);

  /// Adds an R-IMU sample. Rates flagged kIsIncrement are means over the interval before the stamp; they are
  /// placed half a period earlier, and the averaging's loss of amplitude is undone from the fit.
  /// Samples that are not newer than the last one, or not finite, are refused: returns false.
  bool push(const Sample& sample) noexcept;

  /// The motion at an instant. `out` is written only with kOk.
  [[nodiscard]] ReferenceResult evaluate(HostTime time, ReferenceKinematics& out) const noexcept;

  /// Of the newest sample; HostTime::min() before the first.
  [[nodiscard]] HostTime newest_sample() const noexcept {
    return size_ > 0 ? at(size_ - 1).time : HostTime::min();
  }

  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  struct Entry {
    HostTime time;
    std::array<double, 9> values;  ///< omega, f, omega' (0 where the device sends none)
    bool has_angular_acceleration;
    bool is_mean;
  };
  [[nodiscard]] const Entry& at(std::size_t index) const noexcept;  ///< 0 = oldest
  [[nodiscard]] std::size_t nearest(HostTime time) const noexcept;

  ReferenceWindowOptions options_;
  std::vector<Entry> ring_;
  std::size_t head_ = 0;  ///< where the next sample goes
  std::size_t size_ = 0;
};

}  // namespace imuscope
