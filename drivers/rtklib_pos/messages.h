#pragma once

/// Lines of an RTKLIB solution (.pos file, or the stream of rtkrcv and str2str). Comments begin with '%'; the
/// one that names the columns says what follows: time system, kind of coordinates, separator.

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace imuscope::rtklib_pos {

inline constexpr std::int64_t kNsPerSecond = 1'000'000'000;

enum class TimeSystem : std::uint8_t { kGpst, kUtc, kJst };
enum class Layout : std::uint8_t {
  kLlh,     ///< latitude, longitude in degrees, height
  kLlhDms,  ///< the same, in degrees, minutes and seconds
  kXyz,     ///< ECEF
  kEnu,     ///< east, north, up from the base
};

/// How the lines that follow are to be read, as the comment that names the columns says.
struct Format {
  TimeSystem time_system = TimeSystem::kGpst;
  Layout layout = Layout::kLlh;
  char separator = ' ';          ///< ' ': any number of blanks
  bool geodetic_height = false;  ///< above the geoid instead of the ellipsoid
  bool has_velocity = false;     ///< columns of velocity and its sd follow the ratio
};

/// Place of the base, from the "ref pos" comment: deg, deg, m.
struct ReferencePosition {
  double lat_deg;
  double lon_deg;
  double height_m;
};

/// What a comment line changes. Other comments change nothing.
/// @param line  begins with '%'
/// @return true where the line names the columns
bool read_comment(std::string_view line, Format& format, std::optional<ReferencePosition>& base) noexcept;

/// One solution, in the order and units of its line.
struct Solution {
  std::int64_t time_ns;               ///< since 1970-01-01 in the line's time system (for GPST: GPS time)
  std::array<double, 3> coordinates;  ///< deg deg m, or m m m
  int q;                              ///< 1 fix, 2 float, 3 SBAS, 4 DGPS, 5 single, 6 PPP
  int ns;
  std::array<double, 3> variance;    ///< m^2; LLH: north east up; ENU: east north up; XYZ: x y z
  std::array<double, 3> covariance;  ///< m^2; LLH: ne eu un; ENU: en nu ue; XYZ: xy yz zx
  double age_s;
  double ratio;
  std::array<double, 3> velocity;     ///< m/s; axes as variance; only with Format::has_velocity
  std::array<double, 3> velocity_sd;  ///< m/s
};

/// Nothing where the line is not a solution of this format.
[[nodiscard]] std::optional<Solution> parse_solution(std::string_view line, const Format& format) noexcept;

/// Calls visit(std::string_view name, double value) for each field, named by its axes ("lat", "x", "e",
/// "var_n", "cov_ne", ...).
template <typename Visit>
void for_each_field(const Solution& solution, Layout layout, Visit&& visit) {
  using Names = std::array<std::string_view, 3>;
  struct Group {
    Names coordinates, variance, covariance;
  };
  constexpr Group kLlh{{"lat", "lon", "h"}, {"var_n", "var_e", "var_u"}, {"cov_ne", "cov_eu", "cov_un"}};
  constexpr Group kXyz{{"x", "y", "z"}, {"var_x", "var_y", "var_z"}, {"cov_xy", "cov_yz", "cov_zx"}};
  constexpr Group kEnu{{"e", "n", "u"}, {"var_e", "var_n", "var_u"}, {"cov_en", "cov_nu", "cov_ue"}};
  const Group& names = layout == Layout::kXyz ? kXyz : layout == Layout::kEnu ? kEnu : kLlh;
  for (std::size_t i = 0; i < 3; ++i) visit(names.coordinates[i], solution.coordinates[i]);
  visit("Q", static_cast<double>(solution.q));
  visit("ns", static_cast<double>(solution.ns));
  for (std::size_t i = 0; i < 3; ++i) visit(names.variance[i], solution.variance[i]);
  for (std::size_t i = 0; i < 3; ++i) visit(names.covariance[i], solution.covariance[i]);
  visit("age", solution.age_s);
  visit("ratio", solution.ratio);
}

}  // namespace imuscope::rtklib_pos
