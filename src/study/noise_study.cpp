#include "study/noise_study.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <mutex>

#include "models/noise/compare.h"
#include "models/noise/covariance_table.h"
#include "models/noise/holm.h"
#include "models/noise/json.h"
#include "models/noise/lines.h"
#include "models/noise/replicates.h"
#include "models/noise/tails.h"
#include "models/noise/wavelet_variance.h"
#include "service/run/models_file.h"

namespace imuscope {

namespace {

constexpr const char* kWholeRun = "all";

nlohmann::json or_null(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
}

/// What one S-IMU's series are fitted with, and where the results go.
struct AxisWork {
  const DeviceConfig& device;
  const std::vector<double>& values;  ///< of the axis, vibration lines taken out
  const noise::ModelSpec& spec;
  noise::CovarianceTables& covariances;
  NoiseStudy& study;
};

double seconds_of_level(std::size_t level, double rate_hz) {
  return static_cast<double>(std::uint64_t{1} << level) / rate_hz;
}

/// Says which levels the stretches of a regime are too short for, where the whole run has them.
void say_left_out(const AxisWork& work, std::size_t axis, const std::string& regime,
                  const noise::WaveletVariance& wv, std::size_t levels_of_whole) {
  if (regime == kWholeRun || wv.levels.size() >= levels_of_whole) return;
  std::size_t longest = 0;
  for (const auto& segment : wv.segments) longest = std::max(longest, segment.end - segment.begin);
  const double tau_s = seconds_of_level(wv.levels.size(), work.device.rate_hz);
  const std::string sentence = fmt::format(
      "{} {}, {}: scales above {:.4g} s are left out, as its longest stretch lasts {:.4g} s",
      work.device.name, axis_name(axis), regime, tau_s, static_cast<double>(longest) / work.device.rate_hz);
  work.study.left_out.push_back({{"name", work.device.name},
                                 {"axis", axis_name(axis)},
                                 {"regime", regime},
                                 {"above_level", wv.levels.size()},
                                 {"above_tau_s", tau_s},
                                 {"sentence", sentence}});
}

/// Parts of a regime, one after the other and with about as many samples each: enough to see whether they
/// differ, and long enough to tell the white noise.
constexpr std::size_t kParts = 8;
constexpr std::size_t kFewestParts = 3;
constexpr double kPart_s = 15.0;
/// Chance of parts that are alike being said to differ.
constexpr double kPartsDifferBelow = 0.01;

std::vector<noise::WaveletVariance> parts_of(const AxisWork& work, const std::vector<std::uint8_t>& mask) {
  const auto n = static_cast<std::size_t>(std::count(mask.begin(), mask.end(), std::uint8_t{1}));
  const auto parts =
      std::min(kParts, static_cast<std::size_t>(static_cast<double>(n) / (kPart_s * work.device.rate_hz)));
  std::vector<noise::WaveletVariance> out;
  if (parts < kFewestParts) return out;
  std::size_t begin = 0;
  std::size_t seen = 0;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    seen += mask[i] != 0 ? 1 : 0;
    if (seen * parts < (out.size() + 1) * n) continue;
    noise::WvOptions options;
    options.mask = {mask.data() + begin, i + 1 - begin};
    auto wv = noise::haar_wavelet_variance({work.values.data() + begin, i + 1 - begin}, options);
    if (!wv) return {};
    out.push_back(std::move(*wv));
    if (out.size() == parts) break;
    begin = i + 1;
  }
  return out;
}

/// Where the parts of a regime differ, its intervals contain that, and it is said by how much. Returns
/// whether they do.
bool look_at_parts(const AxisWork& work, const std::vector<std::uint8_t>& mask, noise::FitResult& fit) {
  const auto parts = parts_of(work, mask);
  if (parts.empty()) return false;
  const noise::Spread spread = noise::spread_of(fit, parts);
  if (!spread.homogeneity || spread.homogeneity->p_value >= kPartsDifferBelow) return false;
  noise::contain_spread(fit, spread);
  std::string by;
  for (std::size_t p = 0; p < fit.parameters.size(); ++p) {
    const auto& effects = spread.of_parameters[p];
    if (!effects || !(effects->spread_low > 0.0)) continue;
    by += fmt::format("{}{} {} by {:.3g} %", by.empty() ? ": " : ", ", fit.parameters[p].process,
                      fit.parameters[p].name, 100.0 * std::expm1(effects->spread));
  }
  fit.warnings.push_back(fmt::format(
      "its {} parts differ (p = {:.2g}){}; intervals are of the mean of such parts and contain that",
      parts.size(), spread.homogeneity->p_value, by));
  return true;
}

/// What of a series is fitted: a regime, or all of it.
struct Selection {
  std::string regime;
  std::vector<std::uint8_t> mask;
  std::vector<noise::Line> lines;  ///< that belong to its model
  noise::Remainders remainders;    ///< of all lines that were taken out of it
};

Selection selection_of(const AxisWork& work, const std::string& regime, std::vector<std::uint8_t> mask,
                       const std::vector<noise::Line>& taken_out) {
  Selection selection{
      regime, std::move(mask), regime == kWholeRun ? std::vector<noise::Line>{} : taken_out, {}};
  if (taken_out.empty()) return selection;
  noise::Spectra spectra(work.values, selection.mask);
  selection.remainders = noise::Remainders(spectra, taken_out, work.device.rate_hz);
  return selection;
}

/// Of a selection, without what the lines leave in it; none where it has no sample.
std::optional<Result<noise::WaveletVariance>> variance_of(const AxisWork& work, const Selection& selection) {
  if (std::none_of(selection.mask.begin(), selection.mask.end(), [](std::uint8_t m) { return m != 0; }))
    return std::nullopt;
  noise::WvOptions options;
  options.mask = selection.mask;
  auto wv = noise::haar_wavelet_variance(work.values, options);
  if (wv) selection.remainders.take_out_of(*wv, options.confidence);
  return wv;
}

std::size_t levels_of(const std::optional<Result<noise::WaveletVariance>>& wv) {
  return wv && *wv ? (*wv)->levels.size() : 0;
}

/// Fits one axis in one regime; what cannot be fitted becomes a remark.
/// @param wv  absent: the run does not have that regime, which is said once, not for every axis
void fit_axis(const AxisWork& work, std::size_t axis, const Selection& selection,
              const std::optional<Result<noise::WaveletVariance>>& wv, std::size_t levels_of_whole) {
  if (!wv) return;
  const std::string& regime = selection.regime;
  const auto remark = [&](const std::string& what) {
    work.study.remarks.push_back(
        fmt::format("{} {}, {}: {}", work.device.name, axis_name(axis), regime, what));
  };
  if (!*wv) return remark("no wavelet variance: " + wv->error().what);
  say_left_out(work, axis, regime, **wv, levels_of_whole);
  noise::FitOptions fit_options;
  fit_options.signal_unit = axis_unit(axis);
  fit_options.intervals = noise::Intervals::kInverted;
  fit_options.covariances = &work.covariances;
  auto fit = noise::fit(**wv, work.spec, work.device.rate_hz, fit_options);
  if (!fit) {
    return remark(fmt::format("no noise model: {}{}", fit.error().what,
                              levels_of(wv) < levels_of_whole ? "; its stretches are too short" : ""));
  }
  noise::WvOptions options;
  options.mask = selection.mask;
  // The whole run is a mixture of its regimes: nobody expects one Gaussian process of it.
  const auto spikes =
      regime == kWholeRun
          ? std::nullopt
          : noise::spike_warning(noise::test_tails(work.values, options, fit->model), work.device.rate_hz);
  const bool parts_differ = regime != kWholeRun && look_at_parts(work, selection.mask, *fit);
  if (spikes) fit->warnings.insert(fit->warnings.begin(), *spikes);
  work.study.models.push_back(
      {work.device.name, axis, regime, std::move(*fit), selection.lines, parts_differ});
}

/// Finds the lines of one regime, says them and takes them out of `values`.
std::vector<noise::Line> take_out_lines(const DeviceConfig& device, std::size_t axis,
                                        const std::string& regime, const std::vector<std::uint8_t>& mask,
                                        std::vector<double>& values, NoiseStudy& study) {
  noise::LineOptions options;
  options.rate_hz = device.rate_hz;
  auto lines = noise::find_lines(values, mask, options);
  for (const auto& line : lines) {
    study.lines.push_back({{"name", device.name},
                           {"axis", axis_name(axis)},
                           {"regime", regime},
                           {"frequency_hz", line.frequency_hz},
                           {"frequency_sd_hz", line.frequency_sd_hz},
                           {"amplitude", line.amplitude},
                           {"amplitude_sd", line.amplitude_sd},
                           {"amplitude_unit", axis_unit(axis)},
                           {"share_of_variance", line.share_of_variance},
                           {"p_value", line.p_value}});
    study.remarks.push_back(fmt::format(
        "{} {}, {}: {}; it is a sinusoid of the model, beside the noise that is fitted to what it leaves",
        device.name, axis_name(axis), regime, noise::in_words(line, axis_unit(axis))));
  }
  noise::remove_lines(values, mask, lines, device.rate_hz);
  return lines;
}

/// Three axes that leave out the same levels make one sentence.
void summarise_left_out(NoiseStudy& study) {
  for (const auto& entry : study.left_out) {
    const std::string of_imu =
        fmt::format("{}, {}: no stretch is long enough for scales above {:.4g} s, which are left out",
                    entry.at("name").get<std::string>(), entry.at("regime").get<std::string>(),
                    entry.at("above_tau_s").get<double>());
    if (std::find(study.remarks.begin(), study.remarks.end(), of_imu) == study.remarks.end())
      study.remarks.push_back(of_imu);
  }
}

const StudyModel* find(const NoiseStudy& study, const std::string& name, std::size_t axis,
                       const std::string& regime) {
  const auto found = std::find_if(study.models.begin(), study.models.end(), [&](const StudyModel& m) {
    return m.name == name && m.axis == axis && m.regime == regime;
  });
  return found == study.models.end() ? nullptr : &*found;
}

/// One axis in two regimes.
struct AxisComparison {
  const StudyModel* first;
  const StudyModel* second;
  noise::Comparison comparison;
};

/// The joint test takes each record for one process.
noise::Comparison compared(const StudyModel& first, const StudyModel& second) {
  noise::Comparison out = noise::compare(first.fit, second.fit);
  if (!first.parts_differ && !second.parts_differ) return out;
  out.test.reset();
  out.warnings.push_back(
      fmt::format("the parts of {} differ among themselves: no test of all parameters together",
                  first.parts_differ ? first.regime : second.regime));
  return out;
}

const noise::ParameterEstimate* parameter_of(const noise::FitResult& fit,
                                             const noise::ComparedParameter& like) {
  for (const auto& p : fit.parameters) {
    if (p.process == like.process && p.name == like.name) return &p;
  }
  return nullptr;
}

nlohmann::json parameter_json(const AxisComparison& of, const noise::ComparedParameter& p,
                              const std::optional<double>& p_holm) {
  nlohmann::json document{{"process", p.process},
                          {"name", p.name},
                          {"unit", p.unit},
                          {"first", or_null(p.first)},
                          {"second", or_null(p.second)},
                          {"ratio", or_null(p.ratio)},
                          {"ratio_ci_low", or_null(p.ratio_ci_low)},
                          {"ratio_ci_high", or_null(p.ratio_ci_high)},
                          {"p_value", or_null(p.p_value)},
                          {"p_holm", or_null(p_holm)}};
  const auto add_interval = [&](const char* key, const noise::FitResult& fit) {
    const auto* estimate = parameter_of(fit, p);
    document[std::string(key) + "_ci_low"] = estimate != nullptr ? or_null(estimate->ci_low) : nullptr;
    document[std::string(key) + "_ci_high"] = estimate != nullptr ? or_null(estimate->ci_high) : nullptr;
  };
  add_interval("first", of.first->fit);
  add_interval("second", of.second->fit);
  document["verdict"] = !p_holm                          ? "not determined"
                        : *p_holm < noise::kSignificance ? "differs"
                                                         : "no difference shown";
  return document;
}

/// The comparisons of one S-IMU, corrected together.
void append_comparisons(const std::vector<AxisComparison>& all, nlohmann::json& out) {
  std::vector<std::optional<double>> parameter_p;
  std::vector<std::optional<double>> joint_p;
  for (const auto& one : all) {
    for (const auto& p : one.comparison.parameters) parameter_p.push_back(p.p_value);
    joint_p.push_back(one.comparison.test ? std::optional(one.comparison.test->p_value) : std::nullopt);
  }
  const auto parameter_holm = noise::holm_adjusted(parameter_p);
  const auto joint_holm = noise::holm_adjusted(joint_p);
  std::size_t at = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& one = all[i];
    nlohmann::json entry{{"name", one.first->name},
                         {"axis", axis_name(one.first->axis)},
                         {"first", one.first->regime},
                         {"second", one.second->regime},
                         {"parameters", nlohmann::json::array()},
                         {"joint", nullptr},
                         {"remarks", one.comparison.warnings}};
    for (const auto& p : one.comparison.parameters)
      entry["parameters"].push_back(parameter_json(one, p, parameter_holm[at++]));
    if (one.comparison.test) {
      entry["joint"] = {{"statistic", one.comparison.test->statistic},
                        {"dof", one.comparison.test->dof},
                        {"p_value", one.comparison.test->p_value},
                        {"p_holm", or_null(joint_holm[i])}};
    }
    out.push_back(std::move(entry));
  }
}

void append_part(NoiseStudy part, NoiseStudy& study) {
  std::move(part.models.begin(), part.models.end(), std::back_inserter(study.models));
  std::move(part.remarks.begin(), part.remarks.end(), std::back_inserter(study.remarks));
  for (auto& one : part.lines) study.lines.push_back(std::move(one));
  for (auto& one : part.left_out) study.left_out.push_back(std::move(one));
}

NoiseStudy study_axis(const DeviceConfig& device, const NoiseSeries& series, std::size_t axis,
                      const std::vector<std::string>& regimes, const noise::ModelSpec& spec,
                      noise::CovarianceTables& covariances) {
  NoiseStudy study;
  std::vector<double> values = series.values(axis);
  std::vector<std::vector<noise::Line>> lines;
  for (std::size_t regime = 0; regime < regimes.size(); ++regime)
    lines.push_back(take_out_lines(device, axis, regimes[regime], series.mask(axis, regime), values, study));
  std::vector<noise::Line> of_all;
  for (const auto& of_regime : lines) of_all.insert(of_all.end(), of_regime.begin(), of_regime.end());
  const AxisWork work{device, values, spec, covariances, study};
  const Selection whole = selection_of(work, kWholeRun, series.mask(axis), of_all);
  const auto wv_of_whole = variance_of(work, whole);
  // The whole run, then its regimes. An idle thread takes its share of them, so that the last axis is no long way for one
  // alone; a thread that waits here takes up no other axis, whose series would be memory beside this one's.
  std::vector<NoiseStudy> parts(1 + regimes.size());
  const auto fit_part = [&](std::size_t i) {
    const AxisWork of_part{device, values, spec, covariances, parts[i]};
    const std::size_t levels = levels_of(wv_of_whole);
    if (i == 0) return fit_axis(of_part, axis, whole, wv_of_whole, levels);
    const std::size_t r = i - 1;
    const Selection selection = selection_of(of_part, regimes[r], series.mask(axis, r), lines[r]);
    fit_axis(of_part, axis, selection, variance_of(of_part, selection), levels);
  };
  tbb::this_task_arena::isolate(
      [&] { tbb::parallel_for(std::size_t{0}, parts.size(), fit_part, tbb::simple_partitioner()); });
  for (NoiseStudy& part : parts) append_part(std::move(part), study);
  return study;
}

}  // namespace

std::string coverage_remark(const std::string& name, const NoiseSeries& series, double rate_hz, double run_s,
                            HostTime origin) {
  if (series.size() == 0)
    return fmt::format("{}: has no sample in this run's error process; nothing is said of it", name);
  const double has_s = static_cast<double>(series.size() - series.missing()) / rate_hz;
  if (has_s >= kWholeRunShare * run_s) return {};
  return fmt::format(
      "{}: has samples for {:.0f} s of the run's {:.0f} s, between {:.0f} s and {:.0f} s; its models and "
      "regressions are of that part alone",
      name, has_s, run_s, to_seconds(series.time(0) - origin),
      to_seconds(series.time(series.size() - 1) - origin));
}

NoiseStudy study_noise(const Configuration& configuration, const std::vector<NoiseSeries>& series,
                       const std::vector<std::string>& regimes, const noise::ModelSpec& spec,
                       const std::function<void(double)>& progress, std::vector<Job> longer) {
  const auto indices = configuration.study_indices();
  const std::size_t total = series.size() * kAxisCount;
  // Each axis of each S-IMU by itself, on any thread; what came of them stands in their order.
  std::vector<NoiseStudy> parts(total);
  noise::CovarianceTables covariances;
  std::mutex told;
  std::size_t done = 0;
  const auto study_one = [&](std::size_t job) {
    const std::size_t i = job / kAxisCount;
    if (series[i].size() == 0) return;
    parts[job] = study_axis(configuration.devices[indices[i]], series[i], job % kAxisCount, regimes, spec,
                            covariances);
    if (!progress) return;
    const std::lock_guard lock(told);
    progress(static_cast<double>(++done) / static_cast<double>(total));
  };
  std::vector<Job> jobs = std::move(longer);
  for (std::size_t job = 0; job < total; ++job) jobs.emplace_back([&study_one, job] { study_one(job); });
  work_off(jobs);
  NoiseStudy study;
  for (NoiseStudy& part : parts) append_part(std::move(part), study);
  summarise_left_out(study);
  return study;
}

nlohmann::json models_json(const NoiseStudy& study) {
  // What a filter feels of each, with its interval, is what takes time.
  std::vector<nlohmann::json> models(study.models.size());
  tbb::parallel_for(std::size_t{0}, models.size(), [&](std::size_t i) {
    const auto& m = study.models[i];
    models[i] = model_json(m.fit, m.name, m.axis, m.regime);
    if (!m.lines.empty())
      models[i]["sinusoids"] = noise::sinusoids_to_json(m.lines, m.fit, axis_unit(m.axis));
  });
  return models;
}

nlohmann::json comparison_json(const NoiseStudy& study, const std::vector<std::string>& regimes) {
  nlohmann::json document{{"schema", "imuscope.comparison/1"},
                          {"correction", "Holm"},
                          {"level", noise::kSignificance},
                          {"comparisons", nlohmann::json::array()}};
  std::vector<std::string> names;
  for (const auto& m : study.models) {
    if (std::find(names.begin(), names.end(), m.name) == names.end()) names.push_back(m.name);
  }
  for (const auto& name : names) {
    std::vector<AxisComparison> all;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      for (std::size_t a = 0; a < regimes.size(); ++a) {
        for (std::size_t b = a + 1; b < regimes.size(); ++b) {
          const auto* first = find(study, name, axis, regimes[a]);
          const auto* second = find(study, name, axis, regimes[b]);
          if (first != nullptr && second != nullptr) all.push_back({first, second, {}});
        }
      }
    }
    tbb::parallel_for(std::size_t{0}, all.size(),
                      [&](std::size_t i) { all[i].comparison = compared(*all[i].first, *all[i].second); });
    append_comparisons(all, document["comparisons"]);
  }
  return document;
}

}  // namespace imuscope
