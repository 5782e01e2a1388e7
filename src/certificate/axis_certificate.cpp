#include "certificate/axis_certificate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <execution>
#include <mutex>
#include <numeric>

#include "base/units.h"
#include "certificate/candidate_models.h"
#include "certificate/record_checks.h"
#include "noise/covariance_table.h"
#include "noise/fixed_point.h"
#include "noise/homogeneity.h"

namespace imuscope::certificate {
namespace {

using noise::FitResult;
using noise::Intervals;

/// p below which the halves of a record are said to differ.
constexpr double kDiffer = 0.01;

/// Marks what is there.
std::vector<std::uint8_t> mask_of(const AxisRecord& record) {
  std::vector<std::uint8_t> mask = record.mask;
  if (mask.empty()) mask.assign(record.values.size(), 1);
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (!std::isfinite(record.values[i])) mask[i] = 0;
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

std::optional<HalvesTest> halves_of(std::span<const double> x, std::span<const std::uint8_t> mask,
                                    const FitResult& fit) {
  const std::size_t middle = x.size() / 2;
  const auto half = [&](std::size_t begin, std::size_t end) {
    noise::WvOptions options;
    options.mask = mask.subspan(begin, end - begin);
    return noise::haar_wavelet_variance(x.subspan(begin, end - begin), options);
  };
  const auto first = half(0, middle);
  const auto second = half(middle, x.size());
  if (!first || !second) return std::nullopt;
  const std::array records{*first, *second};
  const std::array errors{fit.model_error, fit.model_error};
  const auto test = noise::test_homogeneity(records, fit.model, errors).test;
  if (!test) return std::nullopt;
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

Result<AxisCertificate> characterize(const AxisRecord& record, const AxisOptions& options,
                                     noise::CovarianceTables& covariances) {
  const std::vector<std::uint8_t> mask = mask_of(record);
  AxisCertificate out;
  out.name = record.name;
  out.unit = record.unit;
  add_moments(out, record.values, mask);
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
  out.resolution = resolution_of(record.values, mask);
  out.warnings = record_warnings(record, mask, out);

  std::vector<double> x = record.values;
  noise::LineOptions line_options;
  line_options.rate_hz = record.rate_hz;
  out.lines = noise::find_lines(x, mask, line_options);
  noise::remove_lines(x, mask, out.lines, record.rate_hz);
  out.resonances = noise::find_resonances(x, mask, record.rate_hz);
  out.low_pass_hz = noise::low_pass_hz(x, mask, record.rate_hz);

  noise::WvOptions wv_options;
  wv_options.mask = mask;
  wv_options.confidence = options.confidence;
  const auto wv = noise::haar_wavelet_variance(x, wv_options);
  if (!wv) return tl::unexpected(named(record, wv.error()));
  auto grown = model_of(*wv, record, !out.resonances.empty(), options, covariances);
  if (!grown) return tl::unexpected(named(record, grown.error()));
  out.fit = std::move(grown->best);
  out.largest_miss = largest_miss_of(out.fit);
  for (const FitResult& rival : grown->rivals) out.rivals.push_back(rival.spec.name());

  out.allan = noise::allan_deviation(x, *wv, record.rate_hz);
  noise::set_allan_intervals(out.allan, &out.fit, options.confidence);
  // The spectrum shows the lines, too.
  out.density = noise::density_of(record.values, noise::Present(record.values, mask), record.rate_hz,
                                  options.confidence);
  out.terms = data_sheet_terms(out.fit, grown->rivals, out.allan, record.unit);
  out.halves = halves_of(x, mask, out.fit);
  if (out.halves && out.halves->p_value < kDiffer) {
    out.warnings.push_back(fmt::format(
        "the halves of the record differ (p = {:.2g}): at averaging times around {:.3g} s the second has "
        "{:.2f} times the "
        "variance of the first; the numbers are a mean of both",
        out.halves->p_value, std::ldexp(0.5, out.halves->level) / record.rate_hz, out.halves->ratio));
  }
  out.tails = noise::test_tails(x, wv_options, out.fit.model);
  if (const auto spikes = noise::spike_warning(out.tails, record.rate_hz)) out.warnings.push_back(*spikes);
  out.temperature = temperature_of(record.values, mask, record.temperature_c, out.fit);
  add_limits(out);
  return out;
}

}  // namespace

Result<AxisCertificate> characterize_axis(const AxisRecord& record, const AxisOptions& options) {
  noise::CovarianceTables covariances;
  return characterize(record, options, covariances);
}

std::vector<Result<AxisCertificate>> characterize_axes(std::span<const AxisRecord> records,
                                                       const AxisOptions& options, const AxisDone& told) {
  std::vector<Result<AxisCertificate>> out(records.size(), work_error("not looked at"));
  std::vector<std::size_t> index(records.size());
  std::iota(index.begin(), index.end(), std::size_t{0});
  noise::CovarianceTables covariances;
  std::mutex telling;
  std::size_t done = 0;
  std::for_each(std::execution::par, index.begin(), index.end(), [&](std::size_t i) {
    out[i] = characterize(records[i], options, covariances);
    if (!told) return;
    const std::scoped_lock lock(telling);
    told(++done);
  });
  return out;
}

}  // namespace imuscope::certificate
