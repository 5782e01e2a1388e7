#include "study/dependence_study.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "base/units.h"
#include "estimation/regimes/motion_regimes.h"
#include "models/noise/dependence.h"
#include "models/noise/holm.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope {

namespace {

constexpr std::size_t kDrivers = 4;
constexpr std::size_t kSpeed = 2;
constexpr std::size_t kTemperature = 3;
constexpr std::array<const char*, kDrivers> kDriverNames{"rate", "vibration", "speed", "temperature"};
constexpr std::array<const char*, kDrivers> kDriverUnits{"deg/s", "m/s^2", "m/s", "degC"};
/// A sensor whose temperature stays within this says nothing of what follows it.
constexpr double kLeastWarming_degC = 1.0;
constexpr double kConfidence = 0.95;

using Drivers = std::array<std::optional<double>, kDrivers>;

/// Levels of the motion over one window; a driver that is not known throughout is absent.
Drivers drivers_of(const std::vector<MotionCell>& cells, const MotionLevels& levels, HostTime begin,
                   HostTime end) {
  std::array<double, kTemperature> sums{};
  std::array<int, kTemperature> counts{};
  const double offset_s = to_seconds(begin - levels.begin_of(0)) / MotionLevels::kCell_s;
  const double end_s = to_seconds(end - levels.begin_of(0)) / MotionLevels::kCell_s;
  const auto first = static_cast<std::size_t>(std::max(0.0, std::ceil(offset_s)));
  const auto last = std::min(cells.size(), static_cast<std::size_t>(std::max(0.0, end_s)));
  for (std::size_t i = first; i < last; ++i) {
    const MotionCell& cell = cells[i];
    if (cell.n == 0) continue;
    sums[0] += cell.rate_rms_radps * cell.rate_rms_radps;
    sums[1] += cell.vibration_mps2 * cell.vibration_mps2;
    ++counts[0];
    ++counts[1];
    if (!cell.speed_mps) continue;
    sums[kSpeed] += *cell.speed_mps;
    ++counts[kSpeed];
  }
  Drivers drivers;
  if (counts[0] == 0) return drivers;
  drivers[0] = kDegPerRad * std::sqrt(sums[0] / counts[0]);
  drivers[1] = std::sqrt(sums[1] / counts[1]);
  if (counts[kSpeed] == counts[0]) drivers[kSpeed] = sums[kSpeed] / counts[kSpeed];
  return drivers;
}

struct Window {
  noise::WaveletVariance wv;
  double middle_s = 0.0;
  Drivers drivers;
};

/// What windows are cut from and held against.
struct Run {
  const std::vector<MotionCell>& cells;
  const MotionLevels& levels;
  const RegimeTrack& motion;
  std::size_t regime;
  HostTime origin;
};

/// Windows inside one stretch of the regime, in which an eighth of the samples may be missing.
std::vector<Window> windows_of(const NoiseSeries& series, const TemperatureTrack& temperature,
                               std::size_t axis, std::size_t length, const Run& run) {
  std::vector<Window> windows;
  const auto mask = series.mask(axis);
  const auto& values = series.values(axis);
  std::size_t begin = 0;
  std::size_t missing = 0;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const bool outside = run.motion.at(series.time(i)) != run.regime;
    missing += mask[i] == 0 ? 1 : 0;
    if (outside || (mask[i] == 0 && begin == i) || missing > length - noise::least_valid(length)) {
      begin = i + 1;
      missing = 0;
      continue;
    }
    if (i + 1 - begin < length) continue;
    noise::WvOptions options;
    options.mask = {mask.data() + begin, length};
    auto wv = noise::haar_wavelet_variance({values.data() + begin, length}, options);
    if (wv) {
      const HostTime first = series.time(begin);
      const HostTime last = series.time(i);
      Drivers drivers = drivers_of(run.cells, run.levels, first, last);
      drivers[kTemperature] = temperature.mean(first, last);
      windows.push_back(
          {std::move(*wv), to_seconds(first - run.origin) + 0.5 * to_seconds(last - first), drivers});
    }
    begin = i + 1;
    missing = 0;
  }
  return windows;
}

const noise::FitResult* start_of(const NoiseStudy& models, const std::string& name, std::size_t axis) {
  const noise::FitResult* whole = nullptr;
  for (const auto& m : models.models) {
    if (m.name != name || m.axis != axis) continue;
    if (m.regime == kDynamicName) return &m.fit;
    if (m.regime == "all") whole = &m.fit;
  }
  return whole;
}

/// A Gauss-Markov process whose correlation time is below a quarter of a sample is white noise: where a fit
/// has it in the place of white noise, it is studied as what it is.
noise::FitResult with_white_noise(noise::FitResult fit) {
  constexpr double kWhiteRate = 4.6;  // of a sample: phi below 0.01
  noise::Component* white = nullptr;
  for (noise::Component& component : fit.model.components) {
    if (component.kind == noise::ProcessKind::kWhiteNoise) white = &component;
  }
  if (white == nullptr) return fit;
  for (noise::Component& component : fit.model.components) {
    if (component.kind != noise::ProcessKind::kGaussMarkov || component.shape[0] < kWhiteRate) continue;
    white->amplitude += component.amplitude;
    component.amplitude = 0.0;
  }
  return fit;
}

/// Of one parameter on one driver: by itself, and beside the other drivers of the run.
struct Slope {
  std::size_t axis;
  std::size_t driver;
  std::size_t n_windows;
  std::size_t n_far;
  double mean_driver;
  noise::ParameterSlope slope;
  std::optional<noise::ParameterSlope> beside_others{};
};

double percent(double slope) { return 100.0 * std::expm1(slope); }

/// What the other drivers leave of a dependence.
std::string beside_others_words(const Slope& s, const std::optional<double>& p_holm) {
  if (!s.beside_others || !p_holm) return "";
  const auto& beside = *s.beside_others;
  if (*p_holm >= noise::kSignificance)
    return fmt::format("; beside the other drivers nothing is left of it (p = {:.2g})", *p_holm);
  return fmt::format("; beside the other drivers {:+.3g} % [{:+.3g}, {:+.3g}] (p = {:.2g})",
                     percent(beside.slope), percent(beside.ci_low), percent(beside.ci_high), *p_holm);
}

std::string sentence_of(const std::string& name, const Slope& s, double p_holm,
                        const std::optional<double>& p_holm_beside) {
  const char* unit = kDriverUnits[s.driver];
  if (p_holm >= noise::kSignificance) {
    return fmt::format("{} {}: {} {} shows no dependence on the {} (p = {:.2g}, corrected)", name,
                       axis_name(s.axis), s.slope.process, s.slope.name, kDriverNames[s.driver], p_holm);
  }
  return fmt::format(
      "{} {}: {} {} changes by {:+.3g} % per {} of {} [{:+.3g}, {:+.3g}], p = {:.2g} (corrected){}", name,
      axis_name(s.axis), s.slope.process, s.slope.name, percent(s.slope.slope), unit, kDriverNames[s.driver],
      percent(s.slope.ci_low), percent(s.slope.ci_high), p_holm, beside_others_words(s, p_holm_beside));
}

nlohmann::json beside_others_json(const Slope& s, const std::optional<double>& p_holm) {
  if (!s.beside_others) return nullptr;
  const auto& beside = *s.beside_others;
  return {{"slope", beside.slope},
          {"slope_sd", beside.sd},
          {"ci_low", beside.ci_low},
          {"ci_high", beside.ci_high},
          {"p_value", beside.p_value},
          {"p_holm", p_holm.value_or(1.0)},
          {"percent_per_unit", percent(beside.slope)}};
}

nlohmann::json slope_json(const std::string& name, const Slope& s, double p_holm,
                          const std::optional<double>& p_holm_beside) {
  return {{"name", name},
          {"axis", axis_name(s.axis)},
          {"driver", kDriverNames[s.driver]},
          {"driver_unit", kDriverUnits[s.driver]},
          {"process", s.slope.process},
          {"parameter", s.slope.name},
          {"unit", s.slope.unit},
          {"n_windows", s.n_windows},
          {"n_windows_far", s.n_far},
          {"mean_driver", s.mean_driver},
          {"at_mean_driver", s.slope.at_mean_driver},
          {"slope", s.slope.slope},
          {"slope_sd", s.slope.sd},
          {"ci_low", s.slope.ci_low},
          {"ci_high", s.slope.ci_high},
          {"p_value", s.slope.p_value},
          {"p_holm", p_holm},
          {"percent_per_unit", percent(s.slope.slope)},
          {"beside_others", beside_others_json(s, p_holm_beside)},
          {"sentence", sentence_of(name, s, p_holm, p_holm_beside)}};
}

DependenceStudy nothing_yet() {
  DependenceStudy study;
  for (const char* list : {"dependences", "points", "not_determined", "remarks"})
    study.document[list] = nlohmann::json::array();
  return study;
}

void append(DependenceStudy&& part, DependenceStudy& study) {
  for (auto& [list, entries] : part.document.items()) {
    for (auto& entry : entries) study.document[list].push_back(std::move(entry));
  }
  std::move(part.remarks.begin(), part.remarks.end(), std::back_inserter(study.remarks));
}

/// One S-IMU on its way, or some of its axes.
class ImuStudy {
 public:
  explicit ImuStudy(std::string name) : name_(std::move(name)), out_(nothing_yet()) {}

  void axis(std::size_t axis, const std::vector<Window>& windows, const noise::FitResult& start) {
    std::vector<std::size_t> of_use;
    const std::size_t first_slope = slopes_.size();
    for (std::size_t driver = 0; driver < kDrivers; ++driver) {
      const auto driven = driven_windows(windows, {driver});
      if (driven.empty() && driver == kSpeed) continue;  // said with the regimes
      if (driver == kTemperature && (windows.empty() || !warms_up(driven))) continue;
      const auto found = noise::fit_dependence(driven, start);
      if (!found) {
        remark(fmt::format("{} {}: no dependence on the {}: {}", name_, axis_name(axis), kDriverNames[driver],
                           found.error().what));
        continue;
      }
      for (const auto& slope : found->slopes)
        slopes_.push_back({axis, driver, found->n_windows, found->n_far, found->mean_drivers.front(), slope});
      for (const auto& u : found->undetermined) {
        out_.document["not_determined"].push_back({{"name", name_},
                                                   {"axis", axis_name(axis)},
                                                   {"driver", kDriverNames[driver]},
                                                   {"process", u.process},
                                                   {"parameter", u.name},
                                                   {"why", u.why}});
      }
      of_use.push_back(driver);
    }
    if (of_use.size() > 1) together(windows, of_use, start, first_slope);
    points(axis, windows, start);
  }

  /// What other axes told.
  void add(ImuStudy&& part) {
    std::move(part.slopes_.begin(), part.slopes_.end(), std::back_inserter(slopes_));
    // What is of the sensor is said once.
    const std::vector<std::string> sentences = std::exchange(part.out_.remarks, {});
    part.out_.document.erase("remarks");
    append(std::move(part.out_), out_);
    for (const std::string& sentence : sentences) say(sentence);
  }

  DependenceStudy finish() && {
    std::vector<std::optional<double>> p;
    for (const auto& s : slopes_) p.emplace_back(s.slope.p_value);
    std::vector<std::optional<double>> p_beside;
    for (const auto& s : slopes_)
      p_beside.push_back(s.beside_others ? std::optional(s.beside_others->p_value) : std::nullopt);
    const auto holm = noise::holm_adjusted(p);
    const auto holm_beside = noise::holm_adjusted(p_beside);
    for (std::size_t i = 0; i < slopes_.size(); ++i)
      out_.document["dependences"].push_back(
          slope_json(name_, slopes_[i], holm[i].value_or(1.0), holm_beside[i]));
    say_what_lies_far();
    return std::move(out_);
  }

  /// Once for the sensor.
  void say(const std::string& sentence) {
    if (std::find(out_.remarks.begin(), out_.remarks.end(), sentence) == out_.remarks.end()) remark(sentence);
  }

 private:
  /// The windows in which all of these drivers are known.
  static std::vector<noise::DrivenWindow> driven_windows(const std::vector<Window>& windows,
                                                         const std::vector<std::size_t>& drivers) {
    std::vector<noise::DrivenWindow> driven;
    for (const auto& w : windows) {
      noise::DrivenWindow window{w.wv, {}};
      for (const std::size_t driver : drivers) {
        if (w.drivers[driver]) window.drivers.push_back(*w.drivers[driver]);
      }
      if (window.drivers.size() == drivers.size()) driven.push_back(std::move(window));
    }
    return driven;
  }

  /// All drivers at once: which of them it is on, where they go together. Without enough windows nothing is
  /// said of it.
  void together(const std::vector<Window>& windows, const std::vector<std::size_t>& drivers,
                const noise::FitResult& start, std::size_t first_slope) {
    const auto found = noise::fit_dependence(driven_windows(windows, drivers), start);
    if (!found) return;
    for (const noise::ParameterSlope& beside : found->slopes) {
      for (Slope& s : std::span(slopes_).subspan(first_slope)) {
        if (s.driver == drivers[beside.driver] && s.slope.process == beside.process &&
            s.slope.name == beside.name)
          s.beside_others = beside;
      }
    }
  }

  /// Whether its temperature changed enough to be held against; says why where it did not.
  bool warms_up(const std::vector<noise::DrivenWindow>& windows) {
    if (windows.empty()) {
      say(fmt::format("{}: no temperature in this record: noise parameters are not held against it", name_));
      return false;
    }
    const auto [coldest, warmest] =
        std::minmax_element(windows.begin(), windows.end(),
                            [](const auto& a, const auto& b) { return a.drivers[0] < b.drivers[0]; });
    const double change_degC = warmest->drivers[0] - coldest->drivers[0];
    if (change_degC >= kLeastWarming_degC) return true;
    say(
        fmt::format("{}: its temperature changed by {:.1f} degC over the drive, too little to hold "
                    "its noise parameters against it",
                    name_, change_degC));
    return false;
  }

  /// A word on the axis with the most windows that hardly count.
  void say_what_lies_far() {
    const auto most = std::max_element(slopes_.begin(), slopes_.end(),
                                       [](const Slope& a, const Slope& b) { return a.n_far < b.n_far; });
    if (most == slopes_.end() || most->n_far == 0) return;
    remark(
        fmt::format("{} {}: windows far from what the others say of the noise (a blow, a fault) count less "
                    "than half: {} of {}; no axis has more",
                    name_, axis_name(most->axis), most->n_far, most->n_windows));
  }

  void remark(const std::string& sentence) {
    out_.remarks.push_back(sentence);
    out_.document["remarks"].push_back(sentence);
  }

  void points(std::size_t axis, const std::vector<Window>& windows, const noise::FitResult& start) {
    for (const auto& w : windows) {
      const auto white = noise::white_noise_of(w.wv, start.model, kConfidence);
      if (!white) continue;
      nlohmann::json driver;
      for (std::size_t k = 0; k < kDrivers; ++k)
        driver[kDriverNames[k]] = w.drivers[k] ? nlohmann::json(*w.drivers[k]) : nlohmann::json(nullptr);
      out_.document["points"].push_back({{"name", name_},
                                         {"axis", axis_name(axis)},
                                         {"process", "WN"},
                                         {"driver", driver},
                                         {"time_s", w.middle_s},
                                         {"value", white->value},
                                         {"ci_low", white->ci_low},
                                         {"ci_high", white->ci_high}});
    }
  }

  std::string name_;
  DependenceStudy out_;
  std::vector<Slope> slopes_;
};

}  // namespace

DependenceStudy study_dependence(const Configuration& configuration, const std::vector<NoiseSeries>& series,
                                 const std::vector<TemperatureTrack>& temperatures,
                                 const MotionLevels& levels, const RegimeTrack& motion,
                                 const NoiseStudy& models, HostTime origin) {
  DependenceStudy out = nothing_yet();
  const double window_s = configuration.regimes.window_s;
  out.document["schema"] = "imuscope.dependence/1";
  out.document["window_s"] = window_s;
  const auto dynamic = motion.index_of(kDynamicName);
  if (!dynamic || motion.total_s(*dynamic) <= 0.0) {
    out.remarks.emplace_back("no parameter is held against the dynamics: there is no dynamic part");
    out.document["remarks"] = out.remarks;
    return out;
  }
  const auto cells = levels.cells();
  const Run run{cells, levels, motion, *dynamic, origin};
  const auto indices = configuration.study_indices();
  // Each axis by itself, on any thread; what came of them stands in their order.
  std::vector<std::optional<ImuStudy>> parts(series.size() * kAxisCount);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t job) {
    const std::size_t i = job / kAxisCount;
    const std::size_t axis = job % kAxisCount;
    if (series[i].size() == 0) return;
    const auto& device = configuration.devices[indices[i]];
    const auto* start = start_of(models, device.name, axis);
    if (start == nullptr) return;  // why there is no model is said where it was to be made
    const auto length = static_cast<std::size_t>(std::lround(window_s * device.rate_hz));
    parts[job]
        .emplace(device.name)
        .axis(axis, windows_of(series[i], temperatures[i], axis, length, run), with_white_noise(*start));
  });
  for (std::size_t i = 0; i < series.size(); ++i) {
    ImuStudy imu(configuration.devices[indices[i]].name);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      if (auto& part = parts[i * kAxisCount + axis]) imu.add(std::move(*part));
    }
    append(std::move(imu).finish(), out);
  }
  return out;
}

}  // namespace imuscope
