#pragma once

/// A GNSS receiver that was set up by somebody else and only talks: NMEA 0183, UBX-NAV-PVT, or the text of
/// an RTKLIB solution. What it hears it ignores. Messages that can be left out: of NMEA "GGA", "GST", "RMC",
/// "ZDA"; of the others none.

#include <functional>
#include <string>
#include <vector>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/greis_encoder.h"
#include "firmware_sim/devices/sample_grid.h"
#include "firmware_sim/devices/utc.h"

namespace imusim {

/// From power to the first position, satellites and ambiguities included.
inline constexpr double kWarmStart_s = 20.0;

class GnssTalker : public Device {
 public:
  enum class Language { kNmea, kUbx, kRtklib };
  /// Everything but the date and time, of an epoch.
  using Solver = std::function<greis::Solution(double t_s)>;

  struct Options {
    Language language = Language::kNmea;
    Utc utc_begin{};  ///< UTC at the scenario's time 0
    double rate_hz = 10.0;
    double latency_s = 0.040;  ///< from the epoch to the first bit
    int baud = 115200;
  };

  GnssTalker(const Options& options, Solver solver);

  void receive(std::span<const std::uint8_t> /*bytes*/, double /*t_s*/) override {}
  void run_until(double t_s, std::vector<Emission>& out) override;
  void power_cycle(double t_s, double off_s) override;
  void jump_clock(double by_s) override { grid_.jump(by_s); }
  void add_skew(double ppm) override { grid_.set_skew(grid_.skew_ppm() + ppm, next_index_); }
  bool leave_out(const std::vector<std::string>& blocks) override;
  [[nodiscard]] int baud() const override { return options_.baud; }

  /// Sends nothing of the epochs before t_s.
  void skip_to(double t_s) { next_index_ = std::max(next_index_, grid_.first_from(t_s)); }

 private:
  [[nodiscard]] Bytes epoch(std::int64_t index) const;

  Options options_;
  Solver solver_;
  SampleGrid grid_;
  std::int64_t next_index_ = 0;
  bool header_is_due_;
  std::vector<std::string> left_out_;
};

/// The first epoch of a receiver whose epochs lie at the multiples of their interval in the time of day.
double first_epoch_s(Utc utc_begin, double rate_hz);

}  // namespace imusim
