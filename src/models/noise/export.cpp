#include "models/noise/export.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "base/units.h"
#include "models/noise/continuous_form.h"
#include "models/noise/felt_noise.h"
#include "models/noise/state_space.h"

namespace imuscope::noise {
namespace {

constexpr std::array<std::pair<ExportFormat, std::string_view>, 9> kFormats{
    {{ExportFormat::kKalibr, "kalibr"},
     {ExportFormat::kOpenVins, "openvins"},
     {ExportFormat::kVinsFusion, "vins-fusion"},
     {ExportFormat::kLioSam, "lio-sam"},
     {ExportFormat::kGtsam, "gtsam"},
     {ExportFormat::kRos, "ros"},
     {ExportFormat::kPx4, "px4"},
     {ExportFormat::kKfGins, "kf-gins"},
     {ExportFormat::kStateSpace, "state-space"}}};

/// Visual-inertial and multirotor filters see their biases afresh within a minute or two; a simulation and a
/// filter through GNSS outages live with theirs for a quarter of an hour.
constexpr FilterBand kWalkBand{kFastTau_s, 100.0};
constexpr FilterBand kBiasBand{kFastTau_s, 1000.0};

bool has_walk(ExportFormat format) {
  switch (format) {
    case ExportFormat::kRos:
    case ExportFormat::kKfGins:
    case ExportFormat::kStateSpace:
      return false;
    default:
      return true;
  }
}
FilterBand band_of(ExportFormat format) { return has_walk(format) ? kWalkBand : kBiasBand; }

/// A variance or density as it is written: SI.
struct Written {
  double value = 0.0;
  Knowledge knowledge = Knowledge::kFitted;
};

/// After a number in a comment.
std::string mark(const Written& written) {
  if (written.knowledge == Knowledge::kBound) return "; an upper bound, the record tells no more";
  return written.knowledge == Knowledge::kUnknown ? "; not known from this record" : "";
}

/// Chooses and joins what is written, and collects what speaks against writing it.
class Writer {
 public:
  Writer(const std::vector<AxisFit>& axes, ExportFormat format, const ExportOptions& options)
      : axes_(axes), format_(format), options_(options), band_(band_of(format)) {
    for (const AxisFit& axis : axes) {
      if (const auto missed = missed_level(axis.fit, band_); !missed.empty())
        against_.push_back(axis.axis + ": " + missed);
    }
  }

  [[nodiscard]] FilterBand band() const { return band_; }
  [[nodiscard]] const std::vector<AxisFit>& axes() const { return axes_; }
  /// What speaks against writing it.
  [[nodiscard]] const std::vector<std::string>& against() const { return against_; }
  [[nodiscard]] bool conservative() const { return options_.conservative; }

  /// @param what  for people: "random walk"
  Written take(const AxisFit& axis, const Felt& felt, const char* what) {
    const double square = si_factor(axis.unit) * si_factor(axis.unit);
    if (felt.knowledge == Knowledge::kUnknown)
      against_.push_back(fmt::format("{}: the record does not tell its {}", axis.axis, what));
    const double ratio = felt.value > 0.0 ? std::sqrt(felt.upper / felt.value) : 1.0;
    if (options_.conservative && ratio > kConservativeMost) {
      against_.push_back(
          fmt::format("{}: the conservative {} is {:.3g} times the fitted one", axis.axis, what, ratio));
    }
    return {square * (options_.conservative ? felt.upper : felt.value), felt.knowledge};
  }

  /// Axes of one triad as one: the mean variance; the largest where it has to be on the safe side.
  [[nodiscard]] Written joined(const std::vector<Written>& axes) const {
    Written all{0.0, Knowledge::kFitted};
    for (const Written& axis : axes) {
      all.value = options_.conservative ? std::max(all.value, axis.value)
                                        : all.value + axis.value / static_cast<double>(axes.size());
      all.knowledge = std::max(all.knowledge, axis.knowledge);
    }
    return all;
  }

  /// Says where it all comes from.
  [[nodiscard]] std::string header(std::string_view tool) const {
    std::string text = fmt::format("# Noise parameters for {}, written by imuscope export\n", tool);
    for (const AxisFit& axis : axes_) {
      text += fmt::format("# {}: {}, {}{}\n", axis.axis, axis.fit.spec.name(),
                          axis.source.empty()
                              ? fmt::format("{:.6g} s", static_cast<double>(axis.fit.n) / axis.fit.rate_hz)
                              : axis.source,
                          slow_part(axis.fit));
    }
    text +=
        fmt::format("# white noise: the density of all that is white at {:g} s and longer\n", band_.from_s);
    if (options_.conservative) {
      text += "# conservative: the upper ends of the intervals; of several axes the highest\n";
    }
    for (const char* gyro : {"gyroscope", "accelerometer"}) {
      const bool wanted = std::string_view(gyro) == "gyroscope";
      const bool given = std::any_of(axes_.begin(), axes_.end(),
                                     [&](const AxisFit& axis) { return is_gyro(axis.unit) == wanted; });
      if (!given) text += fmt::format("# {}: not given; its keys are left out\n", gyro);
    }
    for (const std::string& reason : against_) text += "# FORCED although " + reason + "\n";
    return text;
  }

  /// The text, or why it must not be had.
  [[nodiscard]] Result<std::string> finished(std::string text) const {
    if (against_.empty() || options_.force) return text;
    return work_error(
        fmt::format("{}", fmt::join(against_, "; ")),
        "fit a model that holds (fit --select), record for longer, or take it as it is with --force");
  }

 private:
  [[nodiscard]] std::string slow_part(const FitResult& fit) const {
    const SlowTerms terms = slow_terms(fit, band_);
    if (terms.kinds.empty()) return "; it has no slow term";
    if (format_ == ExportFormat::kStateSpace ||
        (has_walk(format_) && terms.are_just(ProcessKind::kRandomWalk)))
      return "";
    if (!has_walk(format_) && terms.are_just(ProcessKind::kGaussMarkov)) return "";
    return fmt::format("; in place of {} a {} that grows alike over {:g} s to {:g} s", terms.names,
                       has_walk(format_) ? "random walk" : "Gauss-Markov process", band_.from_s, band_.to_s);
  }

  const std::vector<AxisFit>& axes_;
  ExportFormat format_;
  ExportOptions options_;
  FilterBand band_;
  std::vector<std::string> against_;
};

/// Gyroscopes or accelerometers of a tool that has one number for three axes.
struct Triad {
  bool given = false;
  Written white;     ///< density
  Written slow;      ///< density that drives the walk, or the bias' variance
  double tau_s = 0;  ///< of the bias
};

std::vector<AxisFit> of_triad(const std::vector<AxisFit>& axes, bool gyro) {
  std::vector<AxisFit> out;
  std::copy_if(axes.begin(), axes.end(), std::back_inserter(out),
               [&](const AxisFit& axis) { return is_gyro(axis.unit) == gyro; });
  return out;
}

Triad walk_triad(Writer& writer, bool gyro) {
  std::vector<Written> white;
  std::vector<Written> walk;
  for (const AxisFit& axis : of_triad(writer.axes(), gyro)) {
    const FeltWithWalk felt = felt_with_walk(axis.fit, writer.band());
    white.push_back(writer.take(axis, felt.white_density, "white noise"));
    walk.push_back(writer.take(axis, felt.walk_density, "random walk"));
  }
  return {!white.empty(), writer.joined(white), writer.joined(walk), 0.0};
}

/// One correlation time for several axes: the mean of the logarithms of those that the data tell, weighted by
/// their information; without any, that of what stands in their place.
struct CommonTime {
  double tau_s = 0.0;
  std::string comment;
};

CommonTime common_time(const std::vector<AxisFit>& axes, const FilterBand& band) {
  double sum = 0.0;
  double weights = 0.0;
  double other_sum = 0.0;
  std::vector<double> told_s;
  for (const AxisFit& axis : axes) {
    const BiasTime time = felt_bias_time(axis.fit, band);
    other_sum += std::log(time.tau_s);
    if (!time.tau_log_sd) continue;
    const double weight = 1.0 / (*time.tau_log_sd * *time.tau_log_sd);
    sum += weight * std::log(time.tau_s);
    weights += weight;
    told_s.push_back(time.tau_s);
  }
  if (told_s.empty()) {
    return {std::exp(other_sum / static_cast<double>(axes.size())),
            "# correlation time: not known from this record; it is one with which the bias grows like the "
            "model\n"};
  }
  const auto [shortest, longest] = std::minmax_element(told_s.begin(), told_s.end());
  return {std::exp(sum / weights),
          fmt::format(
              "# correlation time: known of {} of {} axes, {:.4g} s to {:.4g} s; the tool has one for all\n",
              told_s.size(), axes.size(), *shortest, *longest)};
}

Triad bias_triad(Writer& writer, bool gyro, std::string& comment) {
  const auto axes = of_triad(writer.axes(), gyro);
  if (axes.empty()) return {};
  const CommonTime time = common_time(axes, writer.band());
  std::vector<Written> white;
  std::vector<Written> variance;
  for (const AxisFit& axis : axes) {
    const FeltWithBias felt = felt_with_bias(axis.fit, writer.band(), time.tau_s);
    white.push_back(writer.take(axis, felt.white_density, "white noise"));
    variance.push_back(writer.take(axis, felt.bias.variance, "bias"));
  }
  comment += time.comment;
  return {true, writer.joined(white), writer.joined(variance), time.tau_s};
}

double root(const Written& written) { return std::sqrt(written.value); }

std::string kalibr_keys(const char* name, const char* unit, const Triad& triad) {
  if (!triad.given) return {};
  return fmt::format("{}_noise_density: {:.9e}  # {}/sqrt(Hz){}\n", name, root(triad.white), unit,
                     mark(triad.white)) +
         fmt::format("{}_random_walk: {:.9e}  # {}/s/sqrt(Hz){}\n", name, root(triad.slow), unit,
                     mark(triad.slow));
}

std::string kalibr(Writer& writer) {
  const Triad accel = walk_triad(writer, false);
  const Triad gyro = walk_triad(writer, true);
  return writer.header("kalibr (imu.yaml)") + kalibr_keys("accelerometer", "m/s^2", accel) +
         kalibr_keys("gyroscope", "rad/s", gyro) +
         fmt::format("rostopic: /imu0\nupdate_rate: {}\n", writer.axes().front().fit.rate_hz);
}

/// OpenVINS propagates with the densities as kalibr writes them (Qc = sigma^2 / dt), in a file of its own
/// shape.
std::string openvins(Writer& writer) {
  const Triad accel = walk_triad(writer, false);
  const Triad gyro = walk_triad(writer, true);
  std::string text = writer.header("OpenVINS (kalibr_imu_chain.yaml)") + "imu0:\n";
  std::string keys = kalibr_keys("accelerometer", "m/s^2", accel) + kalibr_keys("gyroscope", "rad/s", gyro);
  for (std::size_t at = 0; at < keys.size(); at = keys.find('\n', at) + 1) {
    keys.insert(at, "  ");
    at += 2;
  }
  return text + keys + fmt::format("  update_rate: {}\n", writer.axes().front().fit.rate_hz);
}

/// A tool that has one number for each of these, under names of its own.
struct FourNames {
  const char* accel_white;
  const char* accel_walk;
  const char* gyro_white;
  const char* gyro_walk;
};

/// @param white_factor, walk_factor  of the densities' roots
std::string four_keys(const FourNames& names, const Triad& accel, const Triad& gyro, double white_factor,
                      double walk_factor) {
  std::string text;
  const auto add = [&](const char* name, const Written& density, double factor) {
    text += fmt::format("{}: {:.9e}{}\n", name, factor * root(density),
                        density.knowledge == Knowledge::kFitted ? "" : "  # " + mark(density).substr(2));
  };
  if (accel.given) {
    add(names.accel_white, accel.white, white_factor);
    add(names.accel_walk, accel.slow, walk_factor);
  }
  if (gyro.given) {
    add(names.gyro_white, gyro.white, white_factor);
    add(names.gyro_walk, gyro.slow, walk_factor);
  }
  return text;
}

/// VINS-Mono and VINS-Fusion take the noise of a sample: a step adds (dt/2)^2 of each of its two samples to a
/// velocity, which is half of what one sample of density / dt adds, and (dt w)^2 to a bias
/// (integration_base.h, midPointIntegration).
std::string vins_fusion(Writer& writer) {
  const double rate_hz = writer.axes().front().fit.rate_hz;
  const Triad accel = walk_triad(writer, false);
  const Triad gyro = walk_triad(writer, true);
  return writer.header("VINS-Fusion (config.yaml)") +
         fmt::format(
             "# of a sample at {:g} Hz: acc_n, gyr_n = sqrt(2 density rate), acc_w, gyr_w = sqrt(walk "
             "density rate)\n",
             rate_hz) +
         four_keys({"acc_n", "acc_w", "gyr_n", "gyr_w"}, accel, gyro, std::sqrt(2.0 * rate_hz),
                   std::sqrt(rate_hz));
}

/// LIO-SAM hands the squares to GTSAM's PreintegrationParams, densities in continuous time, and drives the
/// biases by sqrt(dt) imu...BiasN between key frames.
std::string lio_sam(Writer& writer) {
  const Triad accel = walk_triad(writer, false);
  const Triad gyro = walk_triad(writer, true);
  return writer.header("LIO-SAM (params.yaml)") + "# roots of densities in continuous time\n" +
         four_keys({"imuAccNoise", "imuAccBiasN", "imuGyrNoise", "imuGyrBiasN"}, accel, gyro, 1.0, 1.0);
}

std::string gtsam(Writer& writer) {
  const Triad accel = walk_triad(writer, false);
  const Triad gyro = walk_triad(writer, true);
  std::string text = writer.header("GTSAM (C++)");
  for (std::size_t at = 0; at < text.size(); at = text.find('\n', at) + 1) text.replace(at, 1, "//");
  text +=
      "// densities in continuous time; integrationCovariance is an error of the integration, not of the "
      "sensor\n"
      "auto params = gtsam::PreintegrationCombinedParams::MakeSharedU();\n";
  const auto add = [&](const char* setter, const Written& density) {
    text += fmt::format("params->{}({:.9e} * gtsam::I_3x3);{}\n", setter, density.value,
                        density.knowledge == Knowledge::kFitted ? "" : "  // " + mark(density).substr(2));
  };
  if (accel.given) {
    add("setAccelerometerCovariance", accel.white);
    add("setBiasAccCovariance", accel.slow);
  }
  if (gyro.given) {
    add("setGyroscopeCovariance", gyro.white);
    add("setBiasOmegaCovariance", gyro.slow);
  }
  return text;
}

/// G-26. PX4 EKF2 adds sq(NOISE) * dt^2 to a delta angle and sq(B_NOISE * dt) to a bias at each of its
/// updates.
std::string px4(Writer& writer) {
  constexpr double kFilterUpdate_s = 0.01;  // EKF2_PREDICT_US, default
  constexpr int kRealType = 9;              // MAV_PARAM_TYPE_REAL32
  const Triad accel = walk_triad(writer, false);
  const Triad gyro = walk_triad(writer, true);
  std::string text = writer.header("PX4 EKF2 (parameter file)") +
                     fmt::format("# for a filter update of {} s (EKF2_PREDICT_US)\n", kFilterUpdate_s) +
                     "# Vehicle-Id Component-Id Name Value Type\n";
  const auto add = [&](const char* name, const Written& density) {
    if (density.knowledge != Knowledge::kFitted) text += fmt::format("# {}{}\n", name, mark(density));
    text +=
        fmt::format("1\t1\t{}\t{:.9e}\t{}\n", name, std::sqrt(density.value / kFilterUpdate_s), kRealType);
  };
  if (accel.given) {
    add("EKF2_ACC_B_NOISE", accel.slow);
    add("EKF2_ACC_NOISE", accel.white);
  }
  if (gyro.given) {
    add("EKF2_GYR_B_NOISE", gyro.slow);
    add("EKF2_GYR_NOISE", gyro.white);
  }
  return text;
}

std::string ros_keys(const char* name, const char* field, const char* unit, const Triad& triad,
                     double rate_hz) {
  // sensor_msgs/Imu: -1 in the first element says that there is no such measurement.
  if (!triad.given)
    return fmt::format("    {}_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n", field);
  const std::string v = fmt::format("{:.9e}", triad.white.value * rate_hz);
  return fmt::format("    {}_covariance: [{}, 0.0, 0.0, 0.0, {}, 0.0, 0.0, 0.0, {}]  # ({})^2\n", field, v, v,
                     v, unit) +
         fmt::format("    {}_noise_density: {:.9e}  # {}/sqrt(Hz){}\n", name, root(triad.white), unit,
                     mark(triad.white)) +
         fmt::format("    {}_random_walk: {:.9e}  # {}/s/sqrt(Hz), drives the bias{}\n", name,
                     std::sqrt(2.0 * triad.slow.value / triad.tau_s), unit, mark(triad.slow)) +
         fmt::format("    {}_bias_correlation_time: {:.9e}  # s\n", name, triad.tau_s);
}

std::string ros(Writer& writer) {
  const double rate_hz = writer.axes().front().fit.rate_hz;
  std::string times;
  const Triad gyro = bias_triad(writer, true, times);
  const Triad accel = bias_triad(writer, false, times);
  return writer.header("a ROS 2 node") + times + "/**:\n  ros__parameters:\n" +
         fmt::format("    update_rate: {:.9e}  # Hz\n", rate_hz) +
         ros_keys("gyroscope", "angular_velocity", "rad/s", gyro, rate_hz) +
         ros_keys("accelerometer", "linear_acceleration", "m/s^2", accel, rate_hz);
}

/// "[x, y, z]" and a comment of what is not an estimate; a single axis stands for all three.
std::string list_of_three(const std::vector<Written>& axes, double factor, const char* unit) {
  std::vector<std::string> values;
  std::string marks;
  for (std::size_t i = 0; i < 3; ++i) {
    const Written& axis = axes[std::min(i, axes.size() - 1)];
    values.push_back(fmt::format("{:.9e}", factor * root(axis)));
    if (i < axes.size() && axis.knowledge != Knowledge::kFitted)
      marks += fmt::format(" ({}{})", "xyz"[i], mark(axis));
  }
  return fmt::format("[{}]  # {}{}\n", fmt::join(values, ", "), unit, marks);
}

/// One correlation time for all axes, of both triads.
std::string kf_gins(Writer& writer) {
  constexpr double kMGalPerMps2 = 1e5;
  const double root_hour = std::sqrt(kSecondsPerHour);
  std::array<std::vector<Written>, 2> white;
  std::array<std::vector<Written>, 2> bias;
  const CommonTime time = common_time(writer.axes(), writer.band());
  for (const AxisFit& axis : writer.axes()) {
    const FeltWithBias felt = felt_with_bias(axis.fit, writer.band(), time.tau_s);
    const std::size_t triad = is_gyro(axis.unit) ? 0 : 1;
    white[triad].push_back(writer.take(axis, felt.white_density, "white noise"));
    bias[triad].push_back(writer.take(axis, felt.bias.variance, "bias"));
  }
  std::string text =
      writer.header("KF-GINS (imunoise of kf-gins.yaml)") + time.comment +
      "# gsstd and asstd (scale factors) are not noise, and initbgstd and initbastd (turn-on biases) "
      "are not seen in a record: set them yourself\nimunoise:\n";
  if (!white[0].empty()) {
    text += "  arw: " + list_of_three(white[0], kDegPerRad * root_hour, "deg/sqrt(hr)");
    text += "  gbstd: " + list_of_three(bias[0], kDegPerRad * kSecondsPerHour, "deg/hr");
  }
  if (!white[1].empty()) {
    text += "  vrw: " + list_of_three(white[1], root_hour, "m/s/sqrt(hr)");
    text += "  abstd: " + list_of_three(bias[1], kMGalPerMps2, "mGal");
  }
  return text + fmt::format("  corrtime: {:.9e}  # hr\n", time.tau_s / kSecondsPerHour);
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

/// The model as it is written: a term that the data only bound at its bound, all at their upper ends where
/// that is asked for. Terms of amplitude zero stay out of the matrices; `terms` has their bounds.
Model written_model(Writer& writer, const AxisFit& axis, nlohmann::json& terms) {
  Model model = axis.fit.model;
  const std::vector<std::string> names = component_names(model);
  for (std::size_t i = 0; i < model.components.size(); ++i) {
    Component& c = model.components[i];
    const Felt felt = felt_amplitude(axis.fit, i);
    const bool is_bound = felt.knowledge == Knowledge::kBound;
    terms.push_back(
        {{"process", names[i]},
         {"known", knowledge_name(felt.knowledge)},
         {"variance_upper", is_bound || felt.upper > felt.value ? nlohmann::json(felt.upper) : nullptr}});
    if (c.amplitude <= 0.0) continue;
    if (felt.knowledge == Knowledge::kFitted)
      writer.take(axis, felt, terms.back()["process"].get<std::string>().c_str());
    c.amplitude = writer.conservative() ? felt.upper : felt.value;
  }
  return model;
}

std::string state_space_json(Writer& writer) {
  nlohmann::json out{{"schema", "imuscope/state-space 1"},
                     {"equations",
                      "x[k+1] = F x[k] + w, Cov(w) = Q; z[k] = H x[k] + v, Var(v) = R; x[0] = x0 "
                      "with covariance P0; continuous: dx/dt = A x + u of density Qc"},
                     {"axes", nlohmann::json::array()}};
  for (const AxisFit& axis : writer.axes()) {
    auto terms = nlohmann::json::array();
    const Model model = written_model(writer, axis, terms);
    const StateSpace s = state_space(model);
    nlohmann::json entry{{"axis", axis.axis},
                         {"unit", unit_name(axis.unit)},
                         {"rate_hz", axis.fit.rate_hz},
                         {"model", axis.fit.spec.name()},
                         {"source", axis.source},
                         {"terms", std::move(terms)},
                         {"conservative", writer.conservative()},
                         {"forced_although", nullptr},
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
  for (auto& entry : out["axes"]) entry["forced_although"] = writer.against();
  return json_text(out) + "\n";
}

Result<void> check_axes(const std::vector<AxisFit>& axes) {
  for (const AxisFit& axis : axes) {
    if (axis.unit == SignalUnit::kNone) {
      return usage_error(
          fmt::format("{} has no unit, and without one nobody knows whether it is a gyroscope", axis.axis),
          "give --unit rad/s, deg/s, m/s^2 or g");
    }
    if (axis.fit.rate_hz != axes.front().fit.rate_hz) {
      return usage_error(fmt::format("the axes have different rates ({} and {} Hz)", axes.front().fit.rate_hz,
                                     axis.fit.rate_hz),
                         "export them one by one");
    }
  }
  return {};
}

}  // namespace

Result<ExportFormat> parse_export_format(std::string_view text) {
  for (const auto& [format, name] : kFormats) {
    if (name == text) return format;
  }
  return usage_error(
      fmt::format("there is no format '{}'", text),
      "formats are kalibr, openvins, vins-fusion, lio-sam, gtsam, ros, px4, kf-gins and state-space");
}

Result<std::string> export_models(const std::vector<AxisFit>& axes, ExportFormat format,
                                  const ExportOptions& options) {
  if (axes.empty()) return usage_error("there is no model to export");
  if (format != ExportFormat::kStateSpace) {
    if (auto checked = check_axes(axes); !checked) return tl::unexpected(checked.error());
  }
  Writer writer(axes, format, options);
  switch (format) {
    case ExportFormat::kKalibr:
      return writer.finished(kalibr(writer));
    case ExportFormat::kOpenVins:
      return writer.finished(openvins(writer));
    case ExportFormat::kVinsFusion:
      return writer.finished(vins_fusion(writer));
    case ExportFormat::kLioSam:
      return writer.finished(lio_sam(writer));
    case ExportFormat::kGtsam:
      return writer.finished(gtsam(writer));
    case ExportFormat::kRos:
      return writer.finished(ros(writer));
    case ExportFormat::kPx4:
      return writer.finished(px4(writer));
    case ExportFormat::kKfGins:
      return writer.finished(kf_gins(writer));
    case ExportFormat::kStateSpace:
      break;
  }
  return writer.finished(state_space_json(writer));
}

double white_variance_of_sample(const FitResult& fit) {
  return felt_white_beside_bias(fit, kBiasBand).value * fit.rate_hz;
}

}  // namespace imuscope::noise
