#pragma once

/// A run as an MCAP file of profile "ros2": samples, navigation and mountings as messages of ROS, our own
/// messages as JSON. docs/doors.md lists topics, types and frames. A message's log and publish time are its
/// time of validity.
///
/// Non-real-time: allocates. Thread: one.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "logs/bag/frames.h"
#include "logs/mcap/writer.h"
#include "sample/sample.h"

namespace imuscope::bag {

/// What takes an S-IMU's samples to the vehicle's axes.
struct Correction {
  Rotation C_b_s{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 gyro_bias_radps{};
  Vector3 accel_bias_mps2{};
  Vector3 gyro_scale{};  ///< errors, fractions
  Vector3 accel_scale{};
  double t_d_s = 0.0;  ///< added to the sample's time
};

/// White noise of a triad pair, per sample: x y z of gyro and accelerometer, in s. Zero: not known.
struct WhiteVariance {
  Vector3 gyro{};
  Vector3 accel{};
};

/// Where an S-IMU sits, and how well that is known.
struct Mounting {
  std::string name;
  Rotation C_b_s{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 r_bs_b_m{};
  double t_d_s = 0.0;
  Vector3 sd_boresight_rad{};
  Vector3 sd_r_bs_b_m{};
  double sd_t_d_s = 0.0;
  std::string status;  ///< for people
  bool is_usable = false;
};

/// The navigation solution of b.
struct Navigation {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double height_m = 0.0;
  Vector3 v_n_mps{};
  Vector3 rpy_rad{};
  Vector3 sd_position_m{};  ///< north, east, down
  Vector3 sd_velocity_mps{};
  Vector3 sd_rpy_rad{};
};

class BagWriter {
 public:
  /// @param devices  names, by DeviceIndex
  BagWriter(mcap::WriterOptions options, mcap::Writer::Sink sink, std::vector<std::string> devices);

  /// A sample as its device sent it, whatever its kind is.
  /// @param utc_ns    its time of validity
  /// @param variance  of an IMU; zero where nobody says it
  void add_sample(const Sample& sample, std::int64_t utc_ns, const WhiteVariance& variance = {});
  /// An S-IMU's sample in the vehicle's axes.
  /// @param utc_ns  as of the raw one; the time offset is added here
  void add_corrected(const Sample& sample, std::int64_t utc_ns, const Correction& correction,
                     const WhiteVariance& variance);
  void add_navigation(const Navigation& navigation, std::int64_t utc_ns);
  /// Static transforms of the reference and of these, and their sd as diagnostics.
  void add_mountings(const std::vector<Mounting>& mountings, const std::string& reference,
                     std::int64_t utc_ns);
  /// One of our own messages (message_json.h).
  /// @param topic  "/imuscope/navigation"
  void add_message(const std::string& topic, const std::string& type, std::string_view json,
                   std::int64_t utc_ns);
  void attach(const std::string& name, const std::string& media_type, std::int64_t utc_ns,
              std::string_view data);
  void add_metadata(const std::string& name, const mcap::Texts& texts) { writer_.add_metadata(name, texts); }
  /// What has come so far can be read, whatever happens.
  void end_chunk() { writer_.end_chunk(); }
  void finish() { writer_.finish(); }
  [[nodiscard]] std::uint64_t messages() const noexcept { return writer_.messages(); }

 private:
  mcap::ChannelId channel(const std::string& topic, const char* type);
  void write(mcap::ChannelId channel, std::int64_t utc_ns);
  void add_imu(const Sample& sample, std::int64_t utc_ns, const WhiteVariance& variance);
  void add_gnss(const GnssData& gnss, const std::string& name, std::int64_t utc_ns);

  mcap::Writer writer_;
  std::vector<std::string> devices_;
  std::map<std::string, mcap::SchemaId> schemas_;
  std::map<std::string, mcap::ChannelId> channels_;
  std::vector<mcap::ChannelId> raw_;        ///< by device; 0: none yet
  std::vector<mcap::ChannelId> corrected_;  ///< by device
  mcap::CdrWriter cdr_;
  mcap::Imu imu_;
  std::optional<Navigation> origin_;
};

}  // namespace imuscope::bag
