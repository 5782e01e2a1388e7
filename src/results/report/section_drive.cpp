#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "results/report/people.h"
#include "results/report/sections.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::text_at;

constexpr int kColour = 2;
constexpr double kMetresPerKm = 1e3;

double largest_of(const BinnedSignals& signals, std::size_t signal) {
  double largest = 0.0;
  for (std::size_t i = 0; i < signals.size(); ++i)
    largest = std::max(largest, signals.bin(signal, i).largest);
  return largest;
}

/// Times at rest, from the first S-IMU that has errors: all of them share the vehicle.
std::vector<Stretch> standstills(const RunFiles& run) {
  for (const SImuFiles& study : run.studies) {
    if (study.errors) return study.static_stretches;
  }
  return {};
}

/// What the wheels taught, and what became of their speeds.
Html odometry_part(const RunFiles& run, FigureSheet& figures) {
  const BinnedSignals& odometry = *run.odometry;
  const std::size_t last = odometry.size() - 1;
  Html part = element("h3", text("Odometry"));
  part += paragraph(
      fmt::format("The wheels show {:+.2f} % (sd {:.2f} %) of the speed too much. They stood for {}; for {} "
                  "of it the R-IMU was quiet, too, and rest was used as zero velocity.",
                  odometry.bin(kScale_percent, last).last, odometry.bin(kSdScale_percent, last).last,
                  duration_words(run.wheels_stood_s), duration_words(run.zero_velocity_s)));
  const auto& wheels = field(run.run, "odometry");
  const auto row = [&](const char* what, const char* used, const char* rejected) {
    return fmt::format("{}: {} used, {} refused by the gate", what, text_at(wheels, used),
                       text_at(wheels, rejected));
  };
  if (wheels.is_object()) {
    part += paragraph(
        fmt::format("{}; {}; {}.", row("Speeds", "speed_used", "speed_rejected"),
                    row("no slip sideways and upwards", "non_holonomic_used", "non_holonomic_rejected"),
                    row("zero velocity", "zero_velocity_used", "zero_velocity_rejected")));
  }
  Figure speed;
  speed.id = "wheel_speed";
  speed.group = "profile";
  speed.y_label = "m/s";
  speed.shaded = standstills(run);
  part += figures.range_figure(speed, odometry, kWheelSpeed_mps, kColour,
                               text("Speed as the wheels show it; standstill on a darker ground"));
  Figure scale = speed;
  scale.id = "wheel_scale";
  scale.y_label = "%";
  scale.window = settled_window(odometry, kScale_percent, kSdScale_percent, 1.0, std::nullopt);
  return part + figures.estimate_figure(scale, odometry, kScale_percent, kSdScale_percent, 1.0, kColour,
                                        text("Error of the wheel scale, with its sd"));
}

}  // namespace

Html drive_section(const RunFiles& run, FigureSheet& figures) {
  Html section = heading("drive", "The drive");
  if (!run.navigation) {
    return section +
           paragraph(
               "No navigation in this run: either no GNSS was used (the calibration does not need it), or "
               "the filter had not aligned itself. There is no map and no profile.");
  }
  const BinnedSignals& navigation = *run.navigation;
  constexpr double kKmhPerMps = 3.6;
  section +=
      paragraph(fmt::format("{:.2f} km in {}, at most {:.0f} km/h. The map's origin is at latitude {:.5f} "
                            "deg, longitude {:.5f} deg. "
                            "Largest sd of the position: {:.2f} m north, {:.2f} m east, {:.2f} m down.",
                            run.distance_m / kMetresPerKm,
                            duration_words(navigation.time_s(navigation.size() - 1) - navigation.time_s(0)),
                            kKmhPerMps * largest_of(navigation, kSpeed_mps), run.origin_deg[0],
                            run.origin_deg[1], largest_of(navigation, kSdNorth_m),
                            largest_of(navigation, kSdEast_m), largest_of(navigation, kSdDown_m)));
  section += figures.map_figure(
      "map", navigation, text("The way driven, in metres north and east of its start, coloured by speed"));
  Figure speed;
  speed.id = "speed";
  speed.group = "profile";
  speed.y_label = "m/s";
  speed.shaded = standstills(run);
  section += figures.range_figure(speed, navigation, kSpeed_mps, kColour,
                                  text("Speed over ground; standstill on a darker ground"));
  Figure height = speed;
  height.id = "height";
  height.y_label = "m";
  section += fold("Height", figures.estimate_figure(height, navigation, kHeight_m, kSdDown_m, 1.0, kColour,
                                                    text("Height above the ellipsoid, with its sd")));
  if (run.odometry) section += odometry_part(run, figures);
  return section;
}

}  // namespace imuscope::report
