#include "noise/export.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/json_text.h"
#include "base/units.h"
#include "noise/conservative.h"
#include "noise/continuous_form.h"
#include "noise/filter_form.h"
#include "noise/state_space.h"

namespace imuscope::noise {
namespace {

constexpr std::array<std::pair<ExportFormat, std::string_view>, 5> kFormats{
    {{ExportFormat::kKalibr, "kalibr"},
     {ExportFormat::kRos, "ros"},
     {ExportFormat::kPx4, "px4"},
     {ExportFormat::kKfGins, "kf-gins"},
     {ExportFormat::kStateSpace, "state-space"}}};

const ModelSpec kWalkForm{{ProcessKind::kWhiteNoise, ProcessKind::kRandomWalk}};
const ModelSpec kBiasForm{{ProcessKind::kWhiteNoise, ProcessKind::kGaussMarkov}};

/// Gyroscopes or accelerometers cut down to one form.
struct Triad {
  bool given = false;
  FilterTerms terms;
  std::string origin;
};

struct Sensors {
  Triad gyro;
  Triad accel;
  double rate_hz = 0.0;
};

FitResult chosen(const FitResult& fit, bool conservative) { return conservative ? over_bounding(fit) : fit; }

std::vector<FormSource> sources_of(const std::vector<AxisFit>& axes, bool gyro) {
  std::vector<FormSource> out;
  for (const AxisFit& axis : axes) {
    if (is_gyro(axis.unit) == gyro) out.push_back({axis.unit, &axis.fit});
  }
  return out;
}

Result<Triad> triad_of(const std::vector<AxisFit>& axes, bool gyro, const ModelSpec& form,
                       bool conservative) {
  const auto sources = sources_of(axes, gyro);
  Triad triad;
  if (sources.empty()) return triad;
  auto fitted = fit_of_form(sources, form);
  if (!fitted) return tl::unexpected(fitted.error());
  triad.given = true;
  triad.terms = filter_terms(chosen(fitted->fit, conservative));
  triad.origin = fitted->origin + (conservative ? ", over-bounding" : "");
  return triad;
}

Result<Sensors> sensors_of(const std::vector<AxisFit>& axes, const ModelSpec& form, bool conservative) {
  auto gyro = triad_of(axes, true, form, conservative);
  if (!gyro) return tl::unexpected(gyro.error());
  auto accel = triad_of(axes, false, form, conservative);
  if (!accel) return tl::unexpected(accel.error());
  return Sensors{std::move(*gyro), std::move(*accel), axes.front().fit.rate_hz};
}

std::string header(const Sensors& sensors, std::string_view tool) {
  std::string text = fmt::format("# Noise parameters for {}, written by imuscope export\n", tool);
  const auto origin = [](const char* name, const Triad& triad) {
    return fmt::format("# {}: {}\n", name, triad.given ? triad.origin : "not given; its keys are left out");
  };
  return text + origin("gyroscope", sensors.gyro) + origin("accelerometer", sensors.accel);
}

std::string kalibr_keys(const char* name, const char* unit, const Triad& triad) {
  if (!triad.given) return {};
  std::string text = fmt::format("{}_noise_density: {:.9e}  # {}/sqrt(Hz)\n", name,
                                 std::sqrt(triad.terms.white_density()), unit);
  text += fmt::format("{}_random_walk: {:.9e}  # {}/s/sqrt(Hz)\n", name, std::sqrt(triad.terms.walk_density),
                      unit);
  if (triad.terms.walk_density <= 0.0 || triad.terms.white_density() <= 0.0) {
    text += "# the data support no such term where 0 stands; kalibr refuses it: record for longer\n";
  }
  return text;
}

std::string kalibr(const Sensors& sensors) {
  return header(sensors, "kalibr (imu.yaml)") + kalibr_keys("accelerometer", "m/s^2", sensors.accel) +
         kalibr_keys("gyroscope", "rad/s", sensors.gyro) +
         fmt::format("rostopic: /imu0\nupdate_rate: {}\n", sensors.rate_hz);
}

/// PX4 EKF2 adds sq(NOISE) * dt^2 to a delta angle and sq(B_NOISE * dt) to a bias at each of its updates.
std::string px4(const Sensors& sensors) {
  constexpr double kFilterUpdate_s = 0.01;  // EKF2_PREDICT_US, default
  constexpr int kRealType = 9;              // MAV_PARAM_TYPE_REAL32
  std::string text = header(sensors, "PX4 EKF2 (parameter file)") +
                     fmt::format("# for a filter update of {} s (EKF2_PREDICT_US)\n", kFilterUpdate_s) +
                     "# Vehicle-Id Component-Id Name Value Type\n";
  const auto add = [&](const char* name, double density) {
    text += fmt::format("1\t1\t{}\t{:.9e}\t{}\n", name, std::sqrt(density / kFilterUpdate_s), kRealType);
  };
  if (sensors.accel.given) {
    add("EKF2_ACC_B_NOISE", sensors.accel.terms.walk_density);
    add("EKF2_ACC_NOISE", sensors.accel.terms.white_density());
  }
  if (sensors.gyro.given) {
    add("EKF2_GYR_B_NOISE", sensors.gyro.terms.walk_density);
    add("EKF2_GYR_NOISE", sensors.gyro.terms.white_density());
  }
  return text;
}

std::string ros_keys(const char* name, const char* field, const char* unit, const Triad& triad,
                     double rate_hz) {
  // sensor_msgs/Imu: -1 in the first element says that there is no such measurement.
  if (!triad.given)
    return fmt::format("    {}_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n", field);
  const FilterTerms& t = triad.terms;
  const std::string v = fmt::format("{:.9e}", t.white_density() * rate_hz);
  std::string text = fmt::format("    {}_covariance: [{}, 0.0, 0.0, 0.0, {}, 0.0, 0.0, 0.0, {}]  # ({})^2\n",
                                 field, v, v, v, unit);
  text +=
      fmt::format("    {}_noise_density: {:.9e}  # {}/sqrt(Hz)\n", name, std::sqrt(t.white_density()), unit);
  text += fmt::format("    {}_random_walk: {:.9e}  # {}/s/sqrt(Hz), drives the bias\n", name,
                      std::sqrt(2.0 * t.bias().rate_per_s * t.bias().variance), unit);
  if (t.bias().rate_per_s > 0.0)
    text += fmt::format("    {}_bias_correlation_time: {:.9e}  # s\n", name, 1.0 / t.bias().rate_per_s);
  return text;
}

std::string ros(const Sensors& sensors) {
  return header(sensors, "a ROS 2 node") + "/**:\n  ros__parameters:\n" +
         fmt::format("    update_rate: {:.9e}  # Hz\n", sensors.rate_hz) +
         ros_keys("gyroscope", "angular_velocity", "rad/s", sensors.gyro, sensors.rate_hz) +
         ros_keys("accelerometer", "linear_acceleration", "m/s^2", sensors.accel, sensors.rate_hz);
}

/// KF-GINS has one correlation time for all axes: the mean of their logarithms, weighted by information.
class CorrelationTime {
 public:
  void add(const FitResult& fit) {
    for (std::size_t i = 0; i + 1 < fit.parameters.size(); ++i) {
      // beta stands directly before its sigma2; without a variance it means nothing.
      const ParameterEstimate& p = fit.parameters[i];
      if (p.name != "beta" || !(fit.parameters[i + 1].value > 0.0)) continue;
      const bool known = p.log_sd.has_value();
      const double weight = known ? 1.0 / (*p.log_sd * *p.log_sd) : 1e-6;
      sum_ -= weight * std::log(p.value);
      weight_ += weight;
      shortest_s_ = std::min(shortest_s_, 1.0 / p.value);
      longest_s_ = std::max(longest_s_, 1.0 / p.value);
    }
  }
  [[nodiscard]] double mean_s() const { return weight_ > 0.0 ? std::exp(sum_ / weight_) : kDefault_s; }
  [[nodiscard]] std::string comment() const {
    if (weight_ <= 0.0) return "# no axis shows a bias; corrtime is the tool's own default\n";
    return fmt::format("# corrtime of the axes: {:.4g} to {:.4g} h; the tool has one for all\n",
                       shortest_s_ / kSecondsPerHour, longest_s_ / kSecondsPerHour);
  }

 private:
  static constexpr double kDefault_s = 4.0 * kSecondsPerHour;
  double sum_ = 0.0;
  double weight_ = 0.0;
  double shortest_s_ = std::numeric_limits<double>::infinity();
  double longest_s_ = 0.0;
};

struct KfGinsAxis {
  double random_walk = 0.0;  ///< deg/sqrt(h) or m/s/sqrt(h)
  double bias_sd = 0.0;      ///< deg/h or mGal
};

std::string list_of_three(const std::vector<KfGinsAxis>& axes, double KfGinsAxis::*member) {
  std::vector<std::string> values;
  for (std::size_t i = 0; i < 3; ++i) {
    values.push_back(fmt::format("{:.9e}", axes[std::min(i, axes.size() - 1)].*member));
  }
  return fmt::format("[{}]", fmt::join(values, ", "));
}

Result<std::string> kf_gins(const std::vector<AxisFit>& axes, bool conservative) {
  constexpr double kMGalPerMps2 = 1e5;
  const double root_hour = std::sqrt(kSecondsPerHour);
  std::array<std::vector<KfGinsAxis>, 2> triads;
  CorrelationTime correlation;
  std::string text =
      "# Noise parameters for KF-GINS (imunoise of kf-gins.yaml), written by imuscope export\n";
  for (const AxisFit& axis : axes) {
    const auto fitted = fit_of_form({{axis.unit, &axis.fit}}, kBiasForm);
    if (!fitted) return tl::unexpected(fitted.error());
    correlation.add(fitted->fit);
    const FilterTerms t = filter_terms(chosen(fitted->fit, conservative));
    const bool gyro = is_gyro(axis.unit);
    const double sheet = gyro ? kDegPerRad : 1.0;
    triads[gyro ? 0 : 1].push_back(
        {std::sqrt(t.white_density()) * sheet * root_hour,
         std::sqrt(t.bias().variance) * (gyro ? kDegPerRad * kSecondsPerHour : kMGalPerMps2)});
    text += fmt::format("# {}: {}{}\n", axis.axis, fitted->origin, conservative ? ", over-bounding" : "");
  }
  text += correlation.comment() +
          "# gsstd and asstd (scale factors) are not noise: set them yourself\nimunoise:\n";
  if (!triads[0].empty()) {
    text += fmt::format("  arw: {}  # deg/sqrt(hr)\n", list_of_three(triads[0], &KfGinsAxis::random_walk));
    text += fmt::format("  gbstd: {}  # deg/hr\n", list_of_three(triads[0], &KfGinsAxis::bias_sd));
  }
  if (!triads[1].empty()) {
    text += fmt::format("  vrw: {}  # m/s/sqrt(hr)\n", list_of_three(triads[1], &KfGinsAxis::random_walk));
    text += fmt::format("  abstd: {}  # mGal\n", list_of_three(triads[1], &KfGinsAxis::bias_sd));
  }
  return text + fmt::format("  corrtime: {:.9e}  # hr\n", correlation.mean_s() / kSecondsPerHour);
}

nlohmann::json rows_of(const Eigen::MatrixXd& m) {
  auto rows = nlohmann::json::array();
  for (Eigen::Index r = 0; r < m.rows(); ++r) {
    auto row = nlohmann::json::array();
    for (Eigen::Index c = 0; c < m.cols(); ++c) row.push_back(m(r, c));
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string state_space_json(const std::vector<AxisFit>& axes, bool conservative) {
  nlohmann::json out{{"schema", "imuscope/state-space 1"},
                     {"equations",
                      "x[k+1] = F x[k] + w, Cov(w) = Q; z[k] = H x[k] + v, Var(v) = R; x[0] = x0 "
                      "with covariance P0; continuous: dx/dt = A x + u of density Qc"},
                     {"axes", nlohmann::json::array()}};
  for (const AxisFit& axis : axes) {
    const Model model = chosen(axis.fit, conservative).model;
    const StateSpace s = state_space(model);
    nlohmann::json entry{{"axis", axis.axis},
                         {"unit", unit_name(axis.unit)},
                         {"rate_hz", axis.fit.rate_hz},
                         {"model", axis.fit.spec.name()},
                         {"conservative", conservative},
                         {"states", state_names(model)},
                         {"F", rows_of(s.F)},
                         {"Q", rows_of(s.Q)},
                         {"H", std::vector<double>(s.H.data(), s.H.data() + s.H.size())},
                         {"R", s.R},
                         {"P0", rows_of(s.P0)},
                         {"diffuse", s.diffuse},
                         {"continuous", nullptr}};
    if (const auto continuous = continuous_form(model, axis.fit.rate_hz)) {
      entry["continuous"] = {{"A", rows_of(continuous->a)}, {"Qc", rows_of(continuous->qc)}};
    }
    out["axes"].push_back(std::move(entry));
  }
  return json_text(out) + "\n";
}

}  // namespace

Result<ExportFormat> parse_export_format(std::string_view text) {
  for (const auto& [format, name] : kFormats) {
    if (name == text) return format;
  }
  return usage_error(fmt::format("there is no format '{}'", text),
                     "formats are kalibr, ros, px4, kf-gins and state-space");
}

Result<std::string> export_models(const std::vector<AxisFit>& axes, ExportFormat format, bool conservative) {
  if (axes.empty()) return usage_error("there is no model to export");
  if (format == ExportFormat::kStateSpace) return state_space_json(axes, conservative);
  for (const AxisFit& axis : axes) {
    if (axis.unit != SignalUnit::kNone) continue;
    return usage_error(
        fmt::format("{} has no unit, and without one nobody knows whether it is a gyroscope", axis.axis),
        "give --unit rad/s, deg/s, m/s^2 or g");
  }
  if (format == ExportFormat::kKfGins) return kf_gins(axes, conservative);
  const auto sensors = sensors_of(axes, format == ExportFormat::kRos ? kBiasForm : kWalkForm, conservative);
  if (!sensors) return tl::unexpected(sensors.error());
  if (format == ExportFormat::kRos) return ros(*sensors);
  return format == ExportFormat::kPx4 ? px4(*sensors) : kalibr(*sensors);
}

}  // namespace imuscope::noise
