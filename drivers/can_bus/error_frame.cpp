#include "drivers/can_bus/error_frame.h"

#include <fmt/format.h>

#include <array>
#include <string_view>

namespace imuscope {
namespace {

// <linux/can/error.h>: classes, in the identifier.
constexpr std::uint32_t kTransmitTimeout = 0x001;
constexpr std::uint32_t kLostArbitration = 0x002;
constexpr std::uint32_t kController = 0x004;
constexpr std::uint32_t kProtocol = 0x008;
constexpr std::uint32_t kTransceiver = 0x010;
constexpr std::uint32_t kNoAck = 0x020;
constexpr std::uint32_t kBusOff = 0x040;
constexpr std::uint32_t kBusError = 0x080;
constexpr std::uint32_t kRestarted = 0x100;
constexpr std::uint32_t kCounts = 0x200;

// Status of the controller, data[1].
constexpr std::size_t kStatusAt = 1;
constexpr std::uint8_t kReceiveOverflow = 0x01;
constexpr std::uint8_t kTransmitOverflow = 0x02;
constexpr std::uint8_t kReceiveWarning = 0x04;
constexpr std::uint8_t kTransmitWarning = 0x08;
constexpr std::uint8_t kReceivePassive = 0x10;
constexpr std::uint8_t kTransmitPassive = 0x20;
constexpr std::uint8_t kActiveAgain = 0x40;

constexpr std::size_t kTransmitErrorsAt = 6;
constexpr std::size_t kReceiveErrorsAt = 7;

struct Named {
  std::uint32_t bit;
  std::string_view text;
};
constexpr std::array<Named, 9> kClasses{{{kTransmitTimeout, "transmit time-out"},
                                         {kLostArbitration, "lost arbitration"},
                                         {kController, "controller"},
                                         {kProtocol, "protocol violation"},
                                         {kTransceiver, "transceiver"},
                                         {kNoAck, "not acknowledged"},
                                         {kBusOff, "bus-off"},
                                         {kBusError, "bus error"},
                                         {kRestarted, "restarted"}}};
constexpr std::array<Named, 7> kStatuses{{{kReceiveOverflow, "receive overflow"},
                                          {kTransmitOverflow, "transmit overflow"},
                                          {kReceiveWarning, "receive warning"},
                                          {kTransmitWarning, "transmit warning"},
                                          {kReceivePassive, "receive passive"},
                                          {kTransmitPassive, "transmit passive"},
                                          {kActiveAgain, "active again"}}};

template <std::size_t N>
std::string names_in(std::uint32_t bits, const std::array<Named, N>& names) {
  std::string text;
  for (const auto& [bit, name] : names) {
    if ((bits & bit) == 0) continue;
    if (!text.empty()) text += ", ";
    text += name;
  }
  return text;
}

}  // namespace

CanErrorReport read_can_error(const CanFrame& frame) noexcept {
  CanErrorReport report;
  const auto status = (frame.id & kController) != 0 ? frame.data[kStatusAt] : std::uint8_t{0};
  report.receive_overflow = (status & kReceiveOverflow) != 0;
  report.transmit_overflow = (status & kTransmitOverflow) != 0;
  if ((status & kActiveAgain) != 0) report.state = CanBusState::kActive;
  if ((status & (kReceiveWarning | kTransmitWarning)) != 0) report.state = CanBusState::kWarning;
  if ((status & (kReceivePassive | kTransmitPassive)) != 0) report.state = CanBusState::kPassive;
  report.restarted = (frame.id & kRestarted) != 0;
  if (report.restarted) report.state = CanBusState::kActive;
  if ((frame.id & kBusOff) != 0) report.state = CanBusState::kOff;
  report.not_acknowledged = (frame.id & kNoAck) != 0;
  report.bus_error = (frame.id & (kBusError | kProtocol)) != 0;
  report.has_counts = (frame.id & kCounts) != 0;
  if (report.has_counts) {
    report.transmit_errors = frame.data[kTransmitErrorsAt];
    report.receive_errors = frame.data[kReceiveErrorsAt];
  }
  return report;
}

std::string describe_can_error(const CanFrame& frame) {
  std::string text = names_in(frame.id, kClasses);
  if ((frame.id & kController) != 0 && frame.data[kStatusAt] != 0) {
    text += ": " + names_in(frame.data[kStatusAt], kStatuses);
  }
  if ((frame.id & kCounts) != 0) {
    text += fmt::format("{}errors: transmit {}, receive {}", text.empty() ? "" : "; ",
                        frame.data[kTransmitErrorsAt], frame.data[kReceiveErrorsAt]);
  }
  return text.empty() ? fmt::format("class {:08X}", frame.id) : text;
}

}  // namespace imuscope
