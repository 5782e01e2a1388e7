#pragma once

/// How a mounting changes from drive to drive: every drive against the first of its mounting campaign, so
/// that what is never the same on two vehicles can be looked at together.

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace imuscope::fleet {

class MountingChange {
 public:
  /// Whose drive it is, by the numbers that the caller has for them.
  struct Place {
    std::uint32_t unit = 0;
    std::uint32_t capture = 0;
    std::uint32_t device = 0;
  };
  /// Is given the angles about b's axes, degrees, and the lever arm, mm, each with its sd.
  using Measure = std::function<void(const std::string& name, const std::string& axis,
                                     const char* unit_of_value, const Place& place, double value, double sd)>;

  /// Takes the mounting of one device in one drive, if it has one.
  /// @param mounting  what was not touched between drives: vehicle, campaign and device
  /// @param day       NaN where nobody tells; such drives come last
  /// @param imu       an entry of "imus" of a study's result
  void take(const std::string& mounting, const Place& place, double day, const nlohmann::json& imu);

  /// Tells all drives, by mounting and time.
  void add_to(const Measure& measure) const;

 private:
  struct Drive {
    Place place;
    double day = 0.0;
    std::array<double, 9> C_b_s{};
    std::array<double, 3> psi_sd_deg{};
    std::array<double, 3> r_bs_b_m{};
    std::array<double, 3> r_sd_m{};
  };
  std::map<std::string, std::vector<Drive>> drives_;
};

}  // namespace imuscope::fleet
