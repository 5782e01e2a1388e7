#pragma once

/// What a vehicle's DBC file says of its frames: messages, their signals, which of them share bits
/// (multiplexing), names of values. The file belongs to the vehicle; it is read at start (parser.h).

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "drivers/dbc/signal_layout.h"

namespace imuscope::dbc {

/// A number in a frame that has a name ("reverse", "not available").
struct NamedValue {
  std::int64_t number;  ///< raw, signed where the signal is
  std::string name;
};

/// Values of a multiplexing switch, as they stand in the frame, for which a signal is present (`m<k>`
/// or SG_MUL_VAL_).
struct RawRange {
  std::uint64_t low;
  std::uint64_t high;  ///< included
};

/// One SG_ line of the file, with the names that VAL_ gives to its values.
struct Signal {
  std::string name;
  SignalLayout layout;
  double minimum = 0.0;  ///< as the file says; often nonsense, never a clamp
  double maximum = 0.0;
  std::string unit;
  bool is_switch = false;  ///< its value says which other signals are in the frame
  /// Index of the signal that switches this one, and the values of it for which this one is in the frame.
  std::optional<std::size_t> switched_by;
  std::vector<RawRange> present_for;
  std::vector<NamedValue> names;
};

/// One BO_ line of the file: a CAN frame and the signals in it.
struct Message {
  std::string name;
  std::uint32_t id = 0;      ///< identifier alone
  bool is_extended = false;  ///< 29 bits
  std::size_t length = 0;    ///< bytes
  std::vector<Signal> signals;
  std::size_t line = 0;  ///< of the file

  [[nodiscard]] const Signal* find(std::string_view signal) const;
};

/// Number of the signal in this frame. Nothing where the frame is too short for it, or where a switch says
/// that another signal has its place. Core: no allocation.
[[nodiscard]] std::optional<std::uint64_t> raw_in_frame(const Message& message, std::size_t signal,
                                                        std::span<const std::uint8_t> data) noexcept;

/// Name of a number, empty where it has none.
[[nodiscard]] std::string_view name_of(const Signal& signal, std::uint64_t raw) noexcept;

/// A signal that was chosen by name.
struct SignalChoice {
  std::size_t message = 0;  ///< index in Database::messages
  std::size_t signal = 0;   ///< index in Message::signals
};

struct Database {
  std::string file;  ///< for messages to people
  std::vector<Message> messages;

  [[nodiscard]] const Message* find(std::uint32_t id, bool is_extended) const noexcept;

  /// Finds "MESSAGE.SIGNAL", or "SIGNAL" where one message alone has a signal of that name.
  /// An unknown name is a usage error that suggests the nearest one.
  [[nodiscard]] Result<SignalChoice> choose(std::string_view name) const;
};

}  // namespace imuscope::dbc
