#include "configuration/config_vehicle.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <charconv>

#include "base/units.h"
#include "configuration/toml_reader.h"
#include "drivers/dbc/parser.h"
#include "estimation/calibration/estimator_config.h"

namespace imuscope {

namespace {

constexpr std::size_t kStandardIdDigits = 3;
constexpr std::size_t kExtendedIdDigits = 8;

/// Three hexadecimal digits are an identifier of 11 bits, eight one of 29, as candump writes them.
bool parse_id(const std::string& text, CanId& id) {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, 16);
  const bool extended = text.size() == kExtendedIdDigits;
  if (error != std::errc{} || end != text.data() + text.size()) return false;
  if (!extended && text.size() != kStandardIdDigits) return false;
  if (number > (extended ? kCanExtendedIdMax : kCanStandardIdMax)) return false;
  id = {number, extended};
  return true;
}

void read_filter_keys(TomlReader& in, OdometryOptions& options) {
  const OdometryConfig defaults;
  options.axle_lever_arm_b_m = defaults.prior_r_bv_b_m;
  options.axle_lever_arm_sd_m = defaults.prior_r_bv_b_sd_m[0];
  options.mounting_sd_rad = defaults.prior_mount_sd_rad;
  options.scale_sd = defaults.prior_scale_sd;
  options.speed_sd_mps = defaults.speed_sd_mps;
  options.sideways_sd_mps = defaults.sideways_sd_mps;
  options.upwards_sd_mps = defaults.upwards_sd_mps;
  options.zero_velocity_sd_mps = defaults.zero_velocity_sd_mps;
  options.dead_band_mps = defaults.dead_band_mps;
  in.boolean("speed", options.use_speed);
  in.boolean("non_holonomic", options.use_non_holonomic);
  in.boolean("zero_velocity", options.use_zero_velocity);
  in.vector("axle_lever_arm_b_m", options.axle_lever_arm_b_m, 1.0);
  in.number("axle_lever_arm_sd_m", options.axle_lever_arm_sd_m, 1.0, 1e-4, 10.0);
  in.number("mounting_sd_deg", options.mounting_sd_rad, kRadPerDeg, 1e-3, 20.0);
  in.number("scale_sd_percent", options.scale_sd, 0.01, 1e-3, 50.0);
  in.number("speed_sd_mps", options.speed_sd_mps, 1.0, 1e-3, 10.0);
  in.number("sideways_sd_mps", options.sideways_sd_mps, 1.0, 1e-3, 10.0);
  in.number("upwards_sd_mps", options.upwards_sd_mps, 1.0, 1e-3, 10.0);
  in.number("zero_velocity_sd_mps", options.zero_velocity_sd_mps, 1.0, 1e-4, 1.0);
  in.number("dead_band_mps", options.dead_band_mps, 1.0, 0.0, 5.0);
}

void read_choice(TomlReader& in, can_odometry::Choice& choice) {
  in.texts("speed_signals", choice.speed_signals);
  in.require("speed_signals",
             "name the wheel speeds of the DBC file, such as [\"WHEELS.RL\", \"WHEELS.RR\"]");
  constexpr std::array kUnits{can_odometry::SpeedUnit::kMps, can_odometry::SpeedUnit::kKmph,
                              can_odometry::SpeedUnit::kMph, can_odometry::SpeedUnit::kRadps};
  const auto unit = in.choice("speed_unit", {"m/s", "km/h", "mph", "rad/s"}, 0);
  if (in.has("speed_unit")) choice.unit = kUnits[unit];
  in.number("wheel_radius_m", choice.wheel_radius_m, 1.0, 0.01, 5.0);
  in.boolean("speed_has_no_sign", choice.has_no_sign);
  in.text("direction_signal", choice.direction_signal);
  in.texts("backward_values", choice.backward_values);
  in.texts("fault_signals", choice.fault_signals);
  in.numbers("invalid_raw", choice.invalid_raw);
  in.text("counter_signal", choice.counter_signal);
}

Result<std::string> text_of(const std::string& name, AttachedFiles& files) {
  if (const auto known = files.texts.find(name); known != files.texts.end()) return known->second;
  if (!files.folder) {
    return usage_error(fmt::format("{} is not attached to this configuration, which may read no file", name),
                       "give the configuration itself with --config FILE.toml");
  }
  auto text = dbc::read_text(*files.folder / name);
  if (text) files.texts[name] = *text;
  return text;
}

}  // namespace

void read_odometry(TomlReader in, AttachedFiles& files, OdometryOptions& options) {
  if (!in.present()) {
    in.fail("dbc", "is missing", "give the vehicle's DBC file and its speed_signals in [device.odometry]");
    return;
  }
  std::string name;
  in.text("dbc", name);
  in.require("dbc", "give the vehicle's DBC file");
  read_choice(in, options.choice);
  const can_odometry::DecoderConfig decoder_defaults;
  options.max_speed_mps = decoder_defaults.max_speed_mps;
  options.max_acceleration_mps2 = decoder_defaults.max_acceleration_mps2;
  in.number("latency_ms", options.latency_s, 1e-3, 0.0, 1e3);
  in.number("max_speed_mps", options.max_speed_mps, 1.0, 1.0, 500.0);
  in.number("max_acceleration_mps2", options.max_acceleration_mps2, 1.0, 1.0, 1000.0);
  read_filter_keys(in, options);
  in.finish();
  if (in.failed() || name.empty()) return;

  const auto text = text_of(name, files);
  if (!text) {
    in.fail("dbc", fmt::format("cannot be used: {}", text.error().what), text.error().remedy);
    return;
  }
  auto database = dbc::parse(*text, name);
  if (!database) {
    in.fail("dbc", fmt::format("cannot be used: {}", database.error().what), database.error().remedy);
    return;
  }
  // Made once here, so that a wrong name is told with the configuration's line.
  if (const auto made = can_odometry::Decoder::make(*database, options.choice, {}); !made) {
    in.fail("speed_signals", fmt::format("and what belongs to them: {}", made.error().what),
            made.error().remedy);
    return;
  }
  options.database = std::make_shared<const dbc::Database>(std::move(*database));
}

void read_odometry_filter(TomlReader in, OdometryOptions& options) {
  read_filter_keys(in, options);
  in.finish();
}

void read_xsens_can(TomlReader in, xsens_can::ItemIds& ids) {
  TomlReader table = in.table("ids");
  for (std::size_t i = 0; i < xsens_can::kItemCount; ++i) {
    std::string text;
    const auto key = xsens_can::kItemKinds[i].name;
    table.text(key, text);
    if (table.has(key) && !parse_id(text, ids[i]))
      table.fail(key, fmt::format("'{}' is no identifier", text),
                 "write 3 hexadecimal digits for 11 bits, 8 for 29, as candump does");
  }
  table.finish();
  in.finish();
}

}  // namespace imuscope
