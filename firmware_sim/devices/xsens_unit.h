#pragma once

/// What the firmware of every XSens unit on a serial line does, whatever the unit measures (MT0101P, MTi
/// low-level protocol): at power-on it sends WakeUp; without a WakeUpAck within 500 ms it sends its
/// Configuration and measures with its stored settings. In Measurement it hears GoToConfig and Reset, and
/// goes on sending data until it has acknowledged.

#include <cstdint>
#include <deque>
#include <span>
#include <utility>
#include <vector>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/sample_grid.h"
#include "firmware_sim/devices/xsens_command.h"
#include "firmware_sim/devices/xsens_encoder.h"

namespace imusim {

namespace xsens {

/// Codes of an Error message (MT0101P).
inline constexpr std::uint8_t kErrorPeriod = 0x03;
inline constexpr std::uint8_t kErrorMessage = 0x04;
inline constexpr std::uint8_t kErrorBaudrate = 0x20;
inline constexpr std::uint8_t kErrorParameter = 0x21;

/// A sampling period counts these (MT0101P).
inline constexpr double kPeriodTicksPerSecond = 115200.0;
inline constexpr std::uint16_t kPeriodFastest = 225;    ///< 512 Hz
inline constexpr std::uint16_t kPeriodSlowest = 11520;  ///< 10 Hz

/// Time that the firmware of a single device takes to answer a command.
inline constexpr double kAnswerDelay_s = 0.003;

}  // namespace xsens

class XsensUnit : public Device {
 public:
  enum class State { kOff, kWaking, kConfig, kMeasurement };

  void receive(std::span<const std::uint8_t> bytes, double t_s) final;
  void run_until(double t_s, std::vector<Emission>& out) final;
  void power_cycle(double t_s, double off_s) final;
  void add_skew(double ppm) override { grid_.set_skew(grid_.skew_ppm() + ppm, next_index_); }

  [[nodiscard]] State state() const { return state_; }

 protected:
  using Command = xsens::Command;

  /// Just powered on, at time power_on_s.
  /// @param answer_delay_s  that the firmware takes to answer a command
  XsensUnit(const SampleGrid& grid, double answer_delay_s, double power_on_s);

  /// From t_s on, with the first sample that lies ahead: the sampling clock never stopped.
  void enter_measurement(double t_s);
  /// The same as the answer to GoToMeasurement, heard at t_s.
  void enter_measurement_when_answered(double t_s) { enter_measurement(t_s + answer_delay_s_); }
  /// The same as if a host had just asked for it: of what was still to be sent nothing is, but for these.
  void start_measuring(double t_s, std::vector<Bytes> announcements);
  /// Measuring is over at once.
  void leave_measurement() { state_ = State::kConfig; }
  /// The answer to a command that was heard at t_s.
  void answer(Bytes message, double t_s);
  /// Sent as soon as it is ready, without a delay.
  void send(Emission emission) { replies_.push_back(std::move(emission)); }
  /// Whether a sample that is ready then still belongs to the measurement.
  [[nodiscard]] bool measures_at(double ready_s) const {
    return state_ == State::kMeasurement && ready_s < measurement_end_s_;
  }

  SampleGrid grid_;
  std::int64_t next_index_ = 0;

 private:
  /// Of a command that is not for this unit nothing is heard.
  [[nodiscard]] virtual bool is_addressed(const Command& command) const = 0;
  virtual void acknowledge(const Command& command, double t_s) = 0;
  /// Commands beyond Reset, GoToConfig and WakeUpAck that have a meaning while it measures; true: done with.
  virtual bool handle_measuring(const Command& /*command*/, double /*t_s*/) { return false; }
  virtual void handle_in_config(const Command& command, double t_s) = 0;
  /// A Reset, or power after a time without: the speed that was stored takes force.
  virtual void restart() {}
  /// It counts anew from next_index_ on.
  virtual void count_anew() = 0;
  virtual void emit_samples_until(double t_s, std::vector<Emission>& out) = 0;
  [[nodiscard]] virtual Bytes configuration() const = 0;

  void power_on(double t_s);
  void handle(const Command& command, double t_s);

  State state_ = State::kWaking;
  double answer_delay_s_;
  double wake_deadline_s_ = 0.0;
  double power_on_s_ = 0.0;  ///< when it wakes, while it is off
  /// Measurement ends when the ack of GoToConfig leaves; infinite when none is due.
  double measurement_end_s_;
  xsens::CommandScanner scanner_;
  std::deque<Emission> replies_;
};

}  // namespace imusim
