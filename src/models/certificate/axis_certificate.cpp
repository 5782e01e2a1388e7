#include "models/certificate/axis_certificate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <future>
#include <iterator>
#include <mutex>

#include "base/units.h"
#include "models/certificate/all_cores.h"
#include "models/certificate/candidate_models.h"
#include "models/certificate/record_checks.h"
#include "models/noise/covariance_table.h"
#include "models/noise/fixed_point.h"
#include "models/noise/homogeneity.h"

namespace imuscope::certificate {
namespace {

using noise::FitResult;
using noise::Intervals;

constexpr int kAllanPointsPerOctave = 4;
/// p below which the halves of a record are said to differ.
constexpr double kDiffer = 0.01;

/// A copy that may be written to, with room for one more.
Result<std::vector<double>> samples_of(const AxisRecord& record) {
  if (record.fetch) return record.fetch();
  std::vector<double> x;
  x.reserve(record.values.size() + 1);
  x.assign(record.values.begin(), record.values.end());
  return x;
}

/// Marks what is there.
std::vector<std::uint8_t> mask_of(const AxisRecord& record, std::span<const double> x) {
  std::vector<std::uint8_t> mask = record.mask;
  if (mask.empty()) mask.assign(x.size(), 1);
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (!std::isfinite(x[i])) mask[i] = 0;
  }
  return mask;
}

/// Mean and sd of what is there, numerically safe for a large mean.
void add_moments(AxisCertificate& out, std::span<const double> x, std::span<const std::uint8_t> mask) {
  double squares = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (mask[i] == 0) continue;
    const double before = x[i] - out.mean;
    out.mean += before / static_cast<double>(++out.n_samples);
    squares += before * (x[i] - out.mean);
  }
  out.n_missing = x.size() - out.n_samples;
  out.sd = out.n_samples > 1 ? std::sqrt(squares / static_cast<double>(out.n_samples - 1)) : 0.0;
}

Result<noise::GrownModel> model_of(const noise::WaveletVariance& wv, const AxisRecord& record,
                                   bool has_resonance, const AxisOptions& options,
                                   noise::CovarianceTables& covariances) {
  noise::FitOptions fit_options;
  fit_options.confidence = options.confidence;
  fit_options.signal_unit = noise::unit_name(record.unit);
  fit_options.intervals = Intervals::kInverted;
  fit_options.covariances = &covariances;
  if (!options.model.empty()) {
    const auto spec = noise::parse_model(options.model);
    if (!spec) return tl::unexpected(spec.error());
    auto fit = noise::fit(wv, *spec, record.rate_hz, fit_options);
    if (!fit) return tl::unexpected(fit.error());
    return noise::GrownModel{std::move(*fit), {}};
  }
  return select_model(wv, record.rate_hz, has_resonance, fit_options);
}

/// Wavelet variances of the halves of a record; empty where one has none.
/// @param x  used up
std::vector<noise::WaveletVariance> halves_of(std::span<double> x, std::span<const std::uint8_t> mask) {
  const std::size_t middle = x.size() / 2;
  const std::array parts{std::pair{std::size_t{0}, middle}, std::pair{middle, x.size()}};
  std::vector<noise::WaveletVariance> halves(parts.size());
  std::array<bool, parts.size()> is_there{};
  on_all_cores(parts.size(), [&](std::size_t i) {
    const auto [begin, end] = parts[i];
    noise::WvOptions options;
    options.mask = mask.subspan(begin, end - begin);
    auto half = noise::haar_wavelet_variance_in_place(x.subspan(begin, end - begin), options);
    is_there[i] = half.has_value();
    if (half) halves[i] = std::move(*half);
  });
  if (!std::ranges::all_of(is_there, std::identity{})) return {};
  return halves;
}

std::optional<HalvesTest> compared(const std::vector<noise::WaveletVariance>& halves, const FitResult& fit) {
  if (halves.empty()) return std::nullopt;
  const std::array errors{fit.model_error, fit.model_error};
  const auto test = noise::test_homogeneity(halves, fit.model, errors).test;
  if (!test) return std::nullopt;
  const auto* first = &halves.front();
  const auto* second = &halves.back();
  HalvesTest out;
  out.p_value = test->p_value;
  double largest = 0.0;
  for (std::size_t i = 0; i < std::min(first->levels.size(), second->levels.size()); ++i) {
    const auto& a = first->levels[i];
    const auto& b = second->levels[i];
    if (!has_enough_coefficients(a, 1.0) || !has_enough_coefficients(b, 1.0)) break;
    const double distance = std::abs(std::log(b.value / a.value)) *
                            std::sqrt(static_cast<double>(a.n_coefficients) / a.tau_samples);
    if (distance <= largest) continue;
    largest = distance;
    out.level = a.level;
    out.ratio = b.value / a.value;
  }
  return out;
}

/// A length that is known to two digits and is no power of ten to a reader: 120, not 1.2e+02.
std::string rounded(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 1.0);
  return fmt::format("{:.10g}", std::round(value / unit) * unit);
}

void add_limits(AxisCertificate& out) {
  const double seconds = static_cast<double>(out.n_samples) / out.fit.rate_hz;
  const auto& bias = *std::find_if(out.terms.begin(), out.terms.end(),
                                   [](const auto& t) { return t.term == Term::kBiasInstability; });
  if (bias.knowledge == noise::Knowledge::kBound) {
    constexpr double kLonger = 4.0;
    out.limits.push_back(fmt::format(
        "bias instability: the Allan deviation still falls at {} s, the longest averaging time of "
        "this record of {} h; a record of {} h shows {} s",
        rounded(out.allan.back().tau_s), rounded(seconds / kSecondsPerHour),
        rounded(kLonger * seconds / kSecondsPerHour), rounded(kLonger * out.allan.back().tau_s)));
  }
  constexpr double kWide = 0.3;  // of the value, half an interval
  for (const TermValue& term : out.terms) {
    if (term.knowledge != noise::Knowledge::kFitted || !term.ci_low || !term.ci_high || !(term.value > 0.0))
      continue;
    const double half = 0.5 * (*term.ci_high - *term.ci_low) / term.value;
    if (half <= kWide) continue;
    constexpr double kWanted = 0.1;
    out.limits.push_back(
        fmt::format("{}: known within {:.0f} %; within 10 % takes a record of about {} h",
                    name_of(term.term, is_gyro(out.unit)), 100.0 * half,
                    rounded(seconds * (half / kWanted) * (half / kWanted) / kSecondsPerHour)));
  }
}

double largest_miss_of(const FitResult& fit) {
  double largest = 0.0;
  for (const noise::FittedLevel& level : fit.wv) {
    if (!(level.model_ci_low > 0.0) || !(level.fitted > 0.0)) continue;
    largest = std::max(
        {largest, level.fitted / level.model_ci_high - 1.0, level.model_ci_low / level.fitted - 1.0});
  }
  return largest;
}

Error named(const AxisRecord& record, Error error) {
  error.what = fmt::format("{}: {}", record.name, error.what);
  return error;
}

/// What has to be told before anything else.
Result<void> look_at(const AxisRecord& record, std::span<const double> x, std::span<const std::uint8_t> mask,
                     AxisCertificate& out) {
  add_moments(out, x, mask);
  if (out.n_samples < kFewestSamples) {
    return tl::unexpected(named(
        record,
        {ErrorKind::kWork, fmt::format("{} valid samples are too few", out.n_samples),
         fmt::format("a record needs {} at least, and some minutes to be worth reading", kFewestSamples)}));
  }
  if (!(out.sd > 0.0)) {
    return tl::unexpected(named(record, {ErrorKind::kWork, fmt::format("all values are {:.6g}", out.mean),
                                         "the axis is stuck, or the wrong column was chosen"}));
  }
  return {};
}

/// What the samples are asked for beside the certificate; the rest needs no samples.
struct Kept {
  noise::WaveletVariance wv;
  std::vector<noise::WaveletVariance> halves;
  noise::TailExcerpt tails;
};

/// What spectra tell, and beside them what is wrong with the record; takes the lines out of `x`.
/// @return of the lines
noise::Remainders look_at_spectra(const AxisRecord& record, std::span<double> x,
                                  std::span<const std::uint8_t> mask, double confidence,
                                  AxisCertificate& out) {
  noise::LineOptions line_options;
  line_options.rate_hz = record.rate_hz;
  noise::Spectra spectra(x, mask);
  std::vector<std::size_t> lengths = segments_of_lines(spectra, line_options);
  std::ranges::copy(segments_of_density(spectra), std::back_inserter(lengths));
  spectra.make(lengths, [&](std::size_t n, const std::function<void(std::size_t)>& make) {
    on_all_cores(n + 1, [&](std::size_t i) {
      if (i < n) return make(i);
      out.resolution = resolution_of(x, mask);
      out.warnings = record_warnings(record, x, mask, out);
    });
  });
  out.lines = find_lines(spectra, line_options);
  out.density = density_of(spectra, record.rate_hz, confidence);  // with the lines
  if (!out.lines.empty()) {
    noise::remove_lines(x, mask, out.lines, record.rate_hz);
    spectra = noise::Spectra(x, mask);
  }
  out.resonances = find_resonances(spectra, record.rate_hz);
  out.low_pass_hz = low_pass_hz(spectra, record.rate_hz);
  return noise::Remainders(spectra, out.lines, record.rate_hz);
}

/// All that the samples are needed for before there is a model.
struct Reduced {
  AxisCertificate certificate;  ///< without what the model tells
  Kept kept;
};

/// The samples once more, without lines. Of a day they are all that the memory has room for: what was made of
/// them goes first.
Result<void> fetch_again(const AxisRecord& record, std::span<const std::uint8_t> mask,
                         const std::vector<noise::Line>& lines, std::vector<double>& x) {
  x = std::vector<double>();  // assigning {} would keep its memory
  auto samples = samples_of(record);
  if (!samples) return tl::unexpected(named(record, samples.error()));
  x = std::move(*samples);
  noise::remove_lines(x, mask, lines, record.rate_hz);
  return {};
}

Result<Reduced> reduced(const AxisRecord& record, double confidence) {
  Reduced out;
  AxisCertificate& axis = out.certificate;
  axis.name = record.name;
  axis.unit = record.unit;
  auto samples = samples_of(record);
  if (!samples) return tl::unexpected(named(record, samples.error()));
  std::vector<double> x = std::move(*samples);
  const std::vector<std::uint8_t> mask = mask_of(record, x);
  if (auto looked = look_at(record, x, mask, axis); !looked) return tl::unexpected(looked.error());
  const noise::Remainders remainders = look_at_spectra(record, x, mask, confidence, axis);
  out.kept.tails = noise::tail_excerpt(x, mask);
  out.kept.halves = halves_of(x, mask);
  for (noise::WaveletVariance& half : out.kept.halves) remainders.take_out_of(half, confidence);
  if (auto again = fetch_again(record, mask, axis.lines, x); !again) return tl::unexpected(again.error());
  noise::WvOptions wv_options;
  wv_options.mask = mask;
  wv_options.confidence = confidence;
  auto wv = noise::haar_wavelet_variance_in_place(x, wv_options);
  if (!wv) return tl::unexpected(named(record, wv.error()));
  out.kept.wv = std::move(*wv);
  remainders.take_out_of(out.kept.wv, confidence);
  if (auto again = fetch_again(record, mask, axis.lines, x); !again) return tl::unexpected(again.error());
  axis.allan =
      noise::allan_deviation(std::move(x), out.kept.wv, record.rate_hz, kAllanPointsPerOctave, remainders);
  return out;
}

/// The model and what it tells: without samples, so that those of another axis may be in memory meanwhile.
Result<AxisCertificate> modelled(Reduced&& axis, const AxisRecord& record, const AxisOptions& options,
                                 noise::CovarianceTables& covariances) {
  AxisCertificate& out = axis.certificate;
  const Kept& kept = axis.kept;
  auto grown = model_of(kept.wv, record, !out.resonances.empty(), options, covariances);
  if (!grown) return tl::unexpected(named(record, grown.error()));
  out.fit = std::move(grown->best);
  out.largest_miss = largest_miss_of(out.fit);
  for (const FitResult& rival : grown->rivals) out.rivals.push_back(rival.spec.name());
  noise::set_allan_intervals(out.allan, &out.fit, options.confidence,
                             covariances.of(kept.wv, out.fit.wv.size()).get());
  out.terms = data_sheet_terms(out.fit, grown->rivals, out.allan, record.unit);
  out.halves = compared(kept.halves, out.fit);
  if (out.halves && out.halves->p_value < kDiffer) {
    out.warnings.push_back(fmt::format(
        "the halves of the record differ (p = {:.2g}): at averaging times around {:.3g} s the second has "
        "{:.2f} times the variance of the first; the numbers are a mean of both",
        out.halves->p_value, std::ldexp(0.5, out.halves->level) / record.rate_hz, out.halves->ratio));
  }
  noise::WvOptions of_excerpt;
  of_excerpt.confidence = options.confidence;
  out.tails = noise::test_tails(kept.tails, of_excerpt, out.fit.model);
  if (const auto spikes = noise::spike_warning(out.tails, record.rate_hz)) out.warnings.push_back(*spikes);
  add_limits(out);
  return std::move(out);
}

/// What only the samples and the model together tell.
Result<AxisCertificate> with_temperature(Result<AxisCertificate>&& axis, const AxisRecord& record) {
  if (!axis || (record.temperature_c == nullptr && !record.read_with_temperature)) return std::move(axis);
  if (!record.read_with_temperature) {
    const auto x = samples_of(record);
    if (!x) return tl::unexpected(named(record, x.error()));
    axis->temperature = temperature_of(*x, record.mask, *record.temperature_c, axis->fit);
    return std::move(axis);
  }
  auto temperature = temperature_of(record.read_with_temperature, axis->fit);
  if (!temperature) return tl::unexpected(named(record, temperature.error()));
  axis->temperature = *temperature;
  return std::move(axis);
}

Result<AxisCertificate> characterize(const AxisRecord& record, const AxisOptions& options,
                                     noise::CovarianceTables& covariances) {
  auto axis = reduced(record, options.confidence);
  if (!axis) return tl::unexpected(axis.error());
  return with_temperature(modelled(std::move(*axis), record, options, covariances), record);
}

/// One record's samples after the other, while models of those before are looked for.
void characterize_fetched(std::span<const AxisRecord> records, const AxisOptions& options,
                          noise::CovarianceTables& covariances, std::vector<Result<AxisCertificate>>& out,
                          const AxisDone& told) {
  std::vector<std::future<Result<AxisCertificate>>> models;
  for (const AxisRecord& record : records) {
    models.push_back(std::async(
        std::launch::async,
        [&](Result<Reduced>&& axis) -> Result<AxisCertificate> {
          if (!axis) return tl::unexpected(axis.error());
          return with_temperature(modelled(std::move(*axis), record, options, covariances), record);
        },
        reduced(record, options.confidence)));
  }
  for (std::size_t i = 0; i < records.size(); ++i) {
    out[i] = models[i].get();
    if (told) told(i + 1);
  }
}

}  // namespace

Result<AxisCertificate> characterize_axis(const AxisRecord& record, const AxisOptions& options) {
  noise::CovarianceTables own;
  return characterize(record, options, options.covariances != nullptr ? *options.covariances : own);
}

std::vector<Result<AxisCertificate>> characterize_axes(std::span<const AxisRecord> records,
                                                       const AxisOptions& options, const AxisDone& told) {
  std::vector<Result<AxisCertificate>> out(records.size(), work_error("not looked at"));
  noise::CovarianceTables own;
  AxisOptions shared = options;
  if (shared.covariances == nullptr) shared.covariances = &own;
  if (std::ranges::any_of(records, [](const AxisRecord& r) { return static_cast<bool>(r.fetch); })) {
    characterize_fetched(records, shared, *shared.covariances, out, told);
    return out;
  }
  std::mutex telling;
  std::size_t done = 0;
  on_all_cores(records.size(), [&](std::size_t i) {
    out[i] = characterize_axis(records[i], shared);
    if (!told) return;
    const std::scoped_lock lock(telling);
    told(++done);
  });
  return out;
}

}  // namespace imuscope::certificate
