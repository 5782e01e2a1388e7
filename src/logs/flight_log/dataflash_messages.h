#pragma once

/// What is taken of ArduPilot's records.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "logs/flight_log/message_queue.h"
#include "logs/flight_log/record_fields.h"

namespace imuscope::flight_log {

/// Samples of a record ISBD.
inline constexpr std::size_t kSamplesOfBatch = 32;

class ArdupilotMessages {
 public:
  /// IMU, IMU2, IMU3 and IMT likewise (rates and forces, increments), ACC and GYR (fast samples), ISBH and
  /// ISBD (batches of fast samples), GPS, GPS2, GPA, GPA2.
  [[nodiscard]] static bool is_taken(std::string_view name) noexcept;
  /// Puts what a record means into the queue. A position waits for its accuracy, which follows it.
  /// @return whether the record has what its kind has
  bool take(std::string_view name, const Fields& fields, MessageQueue& queue);
  /// At the end of a log.
  void finish(MessageQueue& queue);
  [[nodiscard]] bool heights_are_of_the_sea() const noexcept { return has_sea_height_; }

 private:
  struct Waiting {
    GnssFix fix;
    double stamp_us = 0.0;
    bool is_above_the_sea = true;
  };
  struct Batch {
    double number = -1.0;
    bool is_gyro = false;
    std::string topic;
    double first_us = 0.0;
    double rate_hz = 0.0;
    double multiplier = 0.0;
    std::size_t samples = 0;
  };
  bool take_position(int instance, const Fields& fields, MessageQueue& queue);
  bool take_accuracy(int instance, const Fields& fields, MessageQueue& queue);
  bool take_batch(const Fields& fields);
  bool take_batch_data(const Fields& fields, MessageQueue& queue) const;
  void give(int instance, MessageQueue& queue);

  std::map<int, Waiting> waiting_;
  Batch batch_;
  bool has_sea_height_ = false;
};

}  // namespace imuscope::flight_log
