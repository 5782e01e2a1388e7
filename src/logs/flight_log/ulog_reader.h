#pragma once

/// Reads a ULog of PX4: the IMUs, receivers and their UTC as topics NAME/INSTANCE. Other instances, dropouts,
/// appended data, damage up to the next synchronisation and a cut at the end are followed; every length is
/// held against the file's.
///
/// Non-real-time: allocates. Thread: one.

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "logs/flight_log/message_queue.h"
#include "logs/flight_log/record_fields.h"
#include "logs/flight_log/window.h"

namespace imuscope::flight_log {

inline constexpr std::array<std::uint8_t, 7> kUlogMagic{'U', 'L', 'o', 'g', 0x01, 0x12, 0x35};

class UlogReader final : public mcap::MessageReader {
 public:
  /// Errors (kWork): a file that cannot be read, is no ULog, or is of a kind that cannot be read rightly.
  static Result<UlogReader> open(const std::filesystem::path& file);

  std::optional<mcap::Message> next() override;
  [[nodiscard]] std::vector<std::string> losses() const override;
  [[nodiscard]] std::uint64_t bytes_read() const noexcept override { return window_.position(); }
  [[nodiscard]] std::uint64_t bytes_total() const noexcept override { return window_.size(); }

 private:
  struct Format {
    std::string fields;  ///< "type name;type[n] name;"
  };
  /// One that is logged.
  struct Subscription {
    std::string topic;  ///< "vehicle_imu/1"
    std::string type;   ///< "vehicle_imu"; empty: of no interest here
    Layout layout;
  };
  struct Loss {
    std::uint64_t bytes = 0;
    std::uint64_t messages = 0;
    std::uint64_t dropouts = 0;
    double dropped_s = 0.0;
    bool cut_off = false;
  };
  UlogReader(Window window, std::string name) : window_(std::move(window)), name_(std::move(name)) {}
  bool read_message();
  bool find_synchronisation();
  [[nodiscard]] std::uint64_t next_appended() const;
  void take_format(mcap::Bytes content);
  void take_subscription(mcap::Bytes content);
  void take_data(mcap::Bytes content);
  bool add_fields(const std::string& format, const std::string& prefix, int depth, int& budget,
                  Layout& layout) const;

  Window window_;
  std::string name_;
  std::map<std::string, Format> formats_;
  std::map<std::uint16_t, Subscription> subscriptions_;
  std::vector<std::uint64_t> appended_;  ///< where data begins that a later part of the flight added; rising
  MessageQueue queue_;
  double accel_lag_s_ = 0.0;  ///< sum of how much later accelerometers of sensor_combined are than gyros
  std::uint64_t accel_lags_ = 0;
  Loss loss_;
};

}  // namespace imuscope::flight_log
