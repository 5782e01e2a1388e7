#pragma once

/// A device as it is seen through the faults of a script: what befalls it, and what becomes of its bytes on
/// the wire. The same random stream and the same script give the same bytes.

#include <memory>
#include <optional>
#include <vector>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/faults/fault.h"
#include "firmware_sim/io/serial_line.h"
#include "firmware_sim/random/random.h"

namespace imusim {

class FaultyDevice : public Device {
 public:
  /// How messages travel.
  enum class Wire {
    kBytes,   ///< a damaged message arrives damaged
    kFrames,  ///< CAN: a damaged frame fails its checksum in the host's controller and does not arrive
  };

  /// @param faults  of this device; those of other layers are passed over
  FaultyDevice(std::unique_ptr<Device> device, const std::vector<Fault>& faults, const Random& random,
               Wire wire = Wire::kBytes);

  void receive(std::span<const std::uint8_t> bytes, double t_s) override;
  void run_until(double t_s, std::vector<Emission>& out) override;
  void power_cycle(double t_s, double off_s) override { device_->power_cycle(t_s, off_s); }
  void jump_clock(double by_s) override { device_->jump_clock(by_s); }
  void add_skew(double ppm) override { device_->add_skew(ppm); }
  bool leave_out(const std::vector<std::string>& blocks) override { return device_->leave_out(blocks); }
  [[nodiscard]] int baud() const override { return device_->baud(); }

 private:
  /// A fault begins or ends.
  struct Turn {
    double t_s;
    const Fault* fault;
    bool begins;
  };
  void befall(const Turn& turn);
  void put_distorted(Emission&& emission, std::vector<Emission>& out);
  /// What one fault makes of a message, and of what follows it. Returns how many bytes it changed, took or
  /// added.
  std::size_t distort(const Fault& fault, Bytes& bytes, Bytes& behind);
  void note_silence(double ready_s);

  std::unique_ptr<Device> device_;
  std::vector<Fault> faults_;
  Random random_;
  Wire wire_;
  std::optional<double> last_ready_s_;
  const Fault* silenced_by_ = nullptr;  ///< the last restart
  std::optional<double> silent_since_s_;
  std::vector<Turn> turns_;  ///< by time
  std::size_t next_turn_ = 0;
  std::vector<Emission> pure_;
};

/// What the line's faults of a script mean for the line.
void add_line_faults(const std::vector<Fault>& faults, LineOptions& line);

}  // namespace imusim
