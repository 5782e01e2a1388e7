#pragma once

/// Reads a DataFlash log of ArduPilot (.bin): the IMUs, their batches of fast samples, receivers and their
/// UTC as topics NAME/INSTANCE. What begins no record is passed over to the next that does; every length is
/// held against the file's.
///
/// Non-real-time: allocates. Thread: one.

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "logs/flight_log/dataflash_messages.h"
#include "logs/flight_log/window.h"

namespace imuscope::flight_log {

/// How every record begins, and the kind that describes kinds.
inline constexpr std::array<std::uint8_t, 2> kDataflashMark{0xA3, 0x95};
inline constexpr std::uint8_t kDataflashFormat = 128;

class DataflashReader final : public mcap::MessageReader {
 public:
  /// Errors (kWork): a file that cannot be read or is no DataFlash log.
  static Result<DataflashReader> open(const std::filesystem::path& file);

  std::optional<mcap::Message> next() override;
  [[nodiscard]] std::vector<std::string> losses() const override;
  [[nodiscard]] std::uint64_t bytes_read() const noexcept override { return window_.position(); }
  [[nodiscard]] std::uint64_t bytes_total() const noexcept override { return window_.size(); }

 private:
  /// One kind of record.
  struct Kind {
    std::size_t size = 0;  ///< with its head; 0: not described yet
    std::string name;      ///< empty: of no interest here
    Layout layout;
  };
  DataflashReader(Window window, std::string name);
  bool read_record();
  void take_format(mcap::Bytes content);

  Window window_;
  std::string name_;
  std::array<Kind, 256> kinds_;
  MessageQueue queue_;
  ArdupilotMessages messages_;
  std::uint64_t damaged_ = 0;  ///< records
  std::uint64_t bytes_passed_ = 0;
  bool cut_off_ = false;
  bool at_end_ = false;
};

}  // namespace imuscope::flight_log
