#include "firmware_sim/devices/gnss_encoders.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace imusim {
namespace {

constexpr double kDegPerRad = 180.0 / std::numbers::pi;
constexpr double kMpsPerKnot = 1852.0 / 3600.0;
/// Of the geoid above the ellipsoid around the drives' start.
constexpr double kGeoidSeparation_m = 49.0;
constexpr int kSatellites = 14;
constexpr std::int64_t kNsPerMs = 1'000'000;

/// GREIS solution types 0 to 4, as other protocols number them.
constexpr std::array<int, 5> kNmeaQuality = {0, 1, 2, 5, 4};
constexpr std::array<int, 5> kRtklibQuality = {0, 5, 4, 2, 1};

std::size_t type_of(const greis::Solution& solution) {
  return std::min<std::size_t>(solution.type, kNmeaQuality.size() - 1);
}

struct TimeOfDay {
  int hour;
  int minute;
  double second;
};

TimeOfDay time_of(const CalendarTime& parts) {
  const double seconds = static_cast<double>(parts.time_of_day.count()) * 1e-9;
  // A leap second belongs to the day's last minute.
  constexpr int kMinutesPerDay = 24 * 60;
  const int whole_minutes = std::min(static_cast<int>(seconds / 60.0), kMinutesPerDay - 1);
  return {whole_minutes / 60, whole_minutes % 60, seconds - 60.0 * whole_minutes};
}

/// "4631.2000000,N"
std::string degrees_and_minutes(double angle_rad, int degree_digits, char positive, char negative) {
  const double degrees = std::abs(angle_rad) * kDegPerRad;
  const double whole = std::floor(degrees);
  return fmt::format("{:0{}.0f}{:010.7f},{}", whole, degree_digits, 60.0 * (degrees - whole),
                     angle_rad < 0.0 ? negative : positive);
}

void put_sentence(Bytes& bytes, const std::string& body) {
  unsigned sum = 0;
  for (const char letter : body) sum ^= static_cast<unsigned char>(letter);
  put_text(bytes, fmt::format("${}*{:02X}\r\n", body, sum));
}

double course_deg(const greis::Solution& solution) {
  const double course = std::atan2(solution.east_mps, solution.north_mps) * kDegPerRad;
  return course < 0.0 ? course + 360.0 : course;
}

/// Standard deviation of one horizontal axis.
double axis_sd(float plane_sd) { return plane_sd / std::numbers::sqrt2; }

struct GpsWeekTime {
  std::int64_t week;
  std::int64_t ns;
};

GpsWeekTime gps_time(Gps gps) {
  using namespace std::chrono;
  const nanoseconds since = gps - local_days(year(1980) / 1 / 6);
  const nanoseconds week = hours(24 * 7);
  return {since / week, (since % week).count()};
}

}  // namespace

Bytes encode_nmea(const greis::Solution& solution, Gps gps, const std::vector<std::string>& left_out) {
  const CalendarTime parts = utc_time(gps);
  const TimeOfDay time = time_of(parts);
  const std::string stamp = fmt::format("{:02}{:02}{:05.2f}", time.hour, time.minute, time.second);
  const std::string place = degrees_and_minutes(solution.latitude_rad, 2, 'N', 'S') + "," +
                            degrees_and_minutes(solution.longitude_rad, 3, 'E', 'W');
  const int quality = kNmeaQuality[type_of(solution)];
  const double speed_mps = std::hypot(solution.north_mps, solution.east_mps);
  // A receiver that stands gives no course.
  constexpr double kStands_mps = 0.1;
  const std::string course = speed_mps < kStands_mps ? "" : fmt::format("{:.2f}", course_deg(solution));
  const double sd_m = axis_sd(solution.horizontal_position_sd_m);
  Bytes bytes;
  const auto put = [&](const std::string& type, const std::string& fields) {
    if (std::find(left_out.begin(), left_out.end(), type) == left_out.end())
      put_sentence(bytes, "GN" + type + "," + fields);
  };
  put("GGA", fmt::format("{},{},{},{:02},0.7,{:.4f},M,{:.4f},M,{},{}", stamp, place, quality, kSatellites,
                         solution.height_m - kGeoidSeparation_m, kGeoidSeparation_m,
                         quality >= 2 ? "1.0" : "", quality >= 2 ? "0001" : ""));
  put("GST", fmt::format("{},{:.3f},{:.3f},{:.3f},0.0,{:.3f},{:.3f},{:.3f}", stamp, sd_m, sd_m, sd_m, sd_m,
                         sd_m, solution.vertical_position_sd_m));
  put("RMC", fmt::format("{},{},{},{:.3f},{},{:02}{:02}{:02},,,{}", stamp, quality == 0 ? 'V' : 'A', place,
                         speed_mps / kMpsPerKnot, course, parts.day, parts.month, parts.year % 100,
                         quality == 4   ? 'R'
                         : quality == 5 ? 'F'
                         : quality == 2 ? 'D'
                         : quality == 1 ? 'A'
                                        : 'N'));
  put("ZDA", fmt::format("{},{:02},{:02},{:04},00,00", stamp, parts.day, parts.month, parts.year));
  return bytes;
}

Bytes encode_ubx_nav_pvt(const greis::Solution& solution, Gps gps) {
  constexpr std::uint16_t kLength = 92;
  constexpr std::uint8_t kAllValid = 0x07;
  const std::size_t type = type_of(solution);
  const auto mm = [](double metres) { return static_cast<std::int32_t>(std::llround(metres * 1e3)); };
  const auto sd_mm = [](double metres) { return static_cast<std::uint32_t>(std::llround(metres * 1e3)); };
  const auto e7 = [](double angle_rad) {
    return static_cast<std::int32_t>(std::llround(angle_rad * kDegPerRad * 1e7));
  };
  // UTC to the whole second, and the rest as a signed count of nanoseconds.
  const auto second = std::chrono::round<std::chrono::seconds>(gps);
  const CalendarTime parts = utc_time(Gps(second));
  const TimeOfDay time = time_of(parts);
  const bool has_fix = type != 0;
  const unsigned carrier = type == 4 ? 2U : type == 3 ? 1U : 0U;
  const unsigned flags = (has_fix ? 1U : 0U) | (type >= 2 ? 2U : 0U) | carrier << 6U;
  const double speed_mps = std::hypot(solution.north_mps, solution.east_mps);

  Bytes bytes = {0xB5, 0x62, 0x01, 0x07};
  put_le(bytes, kLength);
  put_le(bytes, static_cast<std::uint32_t>(gps_time(gps).ns / kNsPerMs));
  put_le(bytes, static_cast<std::uint16_t>(parts.year));
  put_bytes(bytes, Bytes{static_cast<std::uint8_t>(parts.month), static_cast<std::uint8_t>(parts.day),
                         static_cast<std::uint8_t>(time.hour), static_cast<std::uint8_t>(time.minute),
                         static_cast<std::uint8_t>(std::lround(time.second)), kAllValid});
  put_le(bytes, std::uint32_t{25});  // time accuracy, ns
  put_le(bytes, static_cast<std::int32_t>((gps - second).count()));
  put_bytes(bytes, Bytes{static_cast<std::uint8_t>(has_fix ? 3 : 0), static_cast<std::uint8_t>(flags), 0,
                         static_cast<std::uint8_t>(kSatellites)});
  put_le(bytes, e7(solution.longitude_rad));
  put_le(bytes, e7(solution.latitude_rad));
  put_le(bytes, mm(solution.height_m));
  put_le(bytes, mm(solution.height_m - kGeoidSeparation_m));
  put_le(bytes, sd_mm(solution.horizontal_position_sd_m));
  put_le(bytes, sd_mm(solution.vertical_position_sd_m));
  for (const double v : {solution.north_mps, solution.east_mps, -solution.up_mps}) put_le(bytes, mm(v));
  put_le(bytes, mm(speed_mps));
  put_le(bytes, static_cast<std::int32_t>(std::llround(course_deg(solution) * 1e5)));
  put_le(bytes, sd_mm(solution.velocity_sd_mps));
  put_le(bytes, std::uint32_t{100000});  // accuracy of the course, 1e-5 deg
  put_le(bytes, std::uint16_t{120});     // PDOP, 0.01
  constexpr std::size_t kHeader = 6;
  bytes.resize(kHeader + kLength, 0);
  std::uint8_t a = 0;
  std::uint8_t b = 0;
  for (std::size_t i = 2; i < bytes.size(); ++i) {
    a = static_cast<std::uint8_t>(a + bytes[i]);
    b = static_cast<std::uint8_t>(b + a);
  }
  put_bytes(bytes, Bytes{a, b});
  return bytes;
}

Bytes rtklib_header() {
  Bytes bytes;
  put_text(bytes,
           "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of "
           "satellites)\n"
           "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   "
           "sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio    vn(m/s)    ve(m/s)    vu(m/s)      sdvn     "
           "sdve     sdvu    sdvne    sdveu    sdvun\n");
  return bytes;
}

Bytes encode_rtklib(const greis::Solution& solution, Gps gps) {
  Bytes bytes;
  const int quality = kRtklibQuality[type_of(solution)];
  if (quality == 0) return bytes;  // no solution, no line
  const CalendarTime parts = calendar_time(gps);
  const TimeOfDay time = time_of(parts);
  const double sd_m = axis_sd(solution.horizontal_position_sd_m);
  const double sd_mps = axis_sd(solution.horizontal_velocity_sd_mps);
  put_text(bytes,
           fmt::format("{:04}/{:02}/{:02} {:02}:{:02}:{:06.3f}  {:14.9f} {:14.9f} {:10.4f} {:3} {:3} {:8.4f} "
                       "{:8.4f} {:8.4f} {:8.4f} {:8.4f} {:8.4f} {:6.2f} {:6.1f} {:10.5f} {:10.5f} {:10.5f} "
                       "{:9.5f} {:8.5f} {:8.5f} {:8.5f} {:8.5f} {:8.5f}\n",
                       parts.year, parts.month, parts.day, time.hour, time.minute, time.second,
                       solution.latitude_rad * kDegPerRad, solution.longitude_rad * kDegPerRad,
                       solution.height_m, quality, kSatellites, sd_m, sd_m, solution.vertical_position_sd_m,
                       0.0, 0.0, 0.0, 0.0, quality == 1 ? 50.0 : 1.5, solution.north_mps, solution.east_mps,
                       solution.up_mps, sd_mps, sd_mps, solution.vertical_velocity_sd_mps, 0.0, 0.0, 0.0));
  return bytes;
}

}  // namespace imusim
