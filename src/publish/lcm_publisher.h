#pragma once

/// Publishes reports over LCM. lcm_publisher.cpp is the only place that knows the LCM library.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"
#include "publish/channel_name.h"
#include "publish/lcm_url.h"
#include "publish/reports.h"

namespace imuscope {

/// Messages stay within one UDP datagram: a larger one is lost whole when any of its fragments is.
inline constexpr std::size_t kMaxMessageBytes = 65'000;

/// What became of the messages since the publisher was opened.
struct PublishCounters {
  std::uint64_t published = 0;
  std::uint64_t failed = 0;     ///< the library would not send
  std::uint64_t too_large = 0;  ///< above kMaxMessageBytes; not sent
};

/// Thread: one, of the soft world (publishing allocates and makes system calls). A message that cannot be
/// sent is counted and given up: what is live is not worth waiting for.
class LcmPublisher {
 public:
  /// Opens the bus.
  /// @param url     udpm://ADDRESS:PORT?ttl=N, or file://PATH?mode=w to write messages into a fresh LCM log
  /// @param prefix  of every channel, without the underscore
  /// @return the errors of check_lcm_url()
  static Result<LcmPublisher> open(std::string_view url = kDefaultLcmUrl,
                                   std::string_view prefix = kDefaultChannelPrefix);

  LcmPublisher(LcmPublisher&&) noexcept;
  LcmPublisher& operator=(LcmPublisher&&) noexcept;
  ~LcmPublisher();

  void publish(const StatusReport& report);      ///< PREFIX_STATUS
  void publish(const NavigationReport& report);  ///< PREFIX_NAVIGATION
  void publish(const OdometryReport& report);    ///< PREFIX_ODOMETRY
  /// @param name of the S-IMU that report.device stands for
  void publish(const CalibrationReport& report, const std::string& name);  ///< PREFIX_CALIBRATION_NAME
  void publish(const ErrorReport& report, const std::string& name);        ///< PREFIX_ERROR_NAME
  void publish(const WaveletVarianceReport& report);                       ///< PREFIX_WV_NAME
  void publish(const NoiseModelReport& report);                            ///< PREFIX_NOISE_MODEL_NAME
  void publish(const DynamicsReport& report);                              ///< PREFIX_DYNAMICS_NAME
  void publish(const PersonEvent& event);                                  ///< PREFIX_EVENT
  void publish(const BridgeReport& report);                                ///< PREFIX_POSE and PREFIX_INS

  /// Gives every message that is sent to `tap`, too: channel, utime and encoded bytes. For the recorder.
  using Tap = std::function<void(std::string_view, std::int64_t, std::span<const std::uint8_t>)>;
  void set_tap(Tap tap);

  [[nodiscard]] const PublishCounters& counters() const noexcept;

 private:
  struct Impl;
  explicit LcmPublisher(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace imuscope
