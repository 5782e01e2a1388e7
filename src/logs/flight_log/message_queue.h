#pragma once

/// Records of flight controllers as the messages of ROS that everything else reads: IMUs, positions,
/// velocities and UTC. Axes of IMUs stay forward-right-down, times are of the controller's clock.

#include <array>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "logs/mcap/message_reader.h"
#include "logs/mcap/ros_messages.h"

namespace imuscope::flight_log {

using Triad = std::array<double, 3>;

/// What a receiver told at once.
struct GnssFix {
  std::int64_t time_ns = 0;
  std::int8_t status = -1;  ///< of mcap::NavSatFix
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double height_m = 0.0;
  std::optional<Triad> v_n_mps;           ///< north, east, down
  std::optional<double> horizontal_sd_m;  ///< of the distance, not of an axis
  std::optional<double> vertical_sd_m;
  std::optional<double> speed_sd_mps;  ///< of all three axes together
  std::optional<std::int64_t> utc_ns;
  std::int64_t utc_time_ns = 0;  ///< when the controller's clock read at utc_ns
};

inline constexpr double kUs_s = 1e-6;
/// Microseconds of a clock in nanoseconds; nothing where that is no time.
[[nodiscard]] std::optional<std::int64_t> ns_of(std::optional<double> us);
/// sensor_msgs/NavSatStatus of what both controllers count alike: 3 3D, 4 differential, 5 float, 6 fixed.
[[nodiscard]] std::int8_t navsat_status_of(double fix_type);
/// Nothing where a value is no standard deviation.
[[nodiscard]] std::optional<double> positive(std::optional<double> value);

class MessageQueue {
 public:
  /// @param rate_radps, force_mps2  nothing where they were not measured
  void put_imu(const std::string& topic, std::int64_t time_ns, const std::optional<Triad>& rate_radps,
               const std::optional<Triad>& force_mps2);
  /// TOPIC/velocity, TOPIC and TOPIC/time.
  void put_fix(const std::string& topic, const GnssFix& fix);
  /// The oldest; valid until the next call.
  std::optional<mcap::Message> take();

 private:
  struct Waiting {
    const mcap::Topic* topic = nullptr;
    std::uint64_t time_ns = 0;
    std::string data;
  };
  template <typename Ros>
  void put(const std::string& topic, const char* type, const Ros& message);
  std::map<std::string, std::unique_ptr<mcap::Topic>> topics_;
  std::deque<Waiting> waiting_;
  std::string taken_;
  mcap::CdrWriter cdr_;
};

}  // namespace imuscope::flight_log
