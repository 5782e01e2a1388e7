#include "models/certificate/data_sheet_terms.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>

#include "base/units.h"
#include "models/certificate/models_interval.h"

namespace imuscope::certificate {
namespace {

using noise::FitResult;
using noise::Knowledge;
using noise::ProcessKind;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
/// sqrt(2 ln 2 / pi): Allan deviation of flicker noise of unit bias instability (IEEE Std 952, annex C).
constexpr double kFlickerAllanDeviation = 0.664;

/// Factors from the signal's unit to that of the data sheet, and how it is written.
struct SheetUnit {
  double factor = 1.0;
  const char* name = "";
};

SheetUnit sheet_unit(Term term, noise::SignalUnit unit) {
  const bool gyro = noise::is_gyro(unit);
  const double root_hour = std::sqrt(kSecondsPerHour);
  const double si = noise::si_factor(unit);
  const double deg = si * kDegPerRad;
  switch (term) {
    case Term::kRandomWalk:
      return gyro ? SheetUnit{deg * root_hour, "deg/sqrt(h)"} : SheetUnit{si * root_hour, "m/s/sqrt(h)"};
    case Term::kBiasInstability:
      return gyro ? SheetUnit{deg * kSecondsPerHour, "deg/h"} : SheetUnit{si / kMps2PerMicroG, "micro-g"};
    case Term::kRateRandomWalk:  // per root of an hour
      return gyro ? SheetUnit{deg * kSecondsPerHour * root_hour, "deg/h/sqrt(h)"}
                  : SheetUnit{si / kMps2PerMicroG * root_hour, "micro-g/sqrt(h)"};
    case Term::kRamp:
      return gyro ? SheetUnit{deg * kSecondsPerHour * kSecondsPerHour, "deg/h/h"}
                  : SheetUnit{si / kMps2PerMicroG * kSecondsPerHour, "micro-g/h"};
    case Term::kQuantization:
      return gyro ? SheetUnit{deg * kSecondsPerHour, "arcsec"} : SheetUnit{si, "m/s"};
  }
  return {};
}

TermValue as_root(Term term, noise::SignalUnit unit, const noise::Felt& felt, double factor) {
  const SheetUnit sheet = sheet_unit(term, unit);
  const auto shown = [&](double square) { return sheet.factor * std::sqrt(square * factor); };
  TermValue out;
  out.term = term;
  out.unit = sheet.name;
  out.knowledge = felt.knowledge;
  out.value = felt.knowledge == Knowledge::kUnknown ? kNan : shown(felt.value);
  if (felt.knowledge == Knowledge::kFitted) {
    out.ci_low = shown(felt.lower);
    out.ci_high = shown(felt.upper);
  } else if (felt.knowledge == Knowledge::kBound) {
    out.ci_high = out.value;
  }
  return out;
}

/// The model's own amplitude of a kind, or the most that the levels allow of one.
noise::Felt amplitude_of(const FitResult& fit, ProcessKind kind) {
  const auto& components = fit.model.components;
  const auto at =
      std::find_if(components.begin(), components.end(), [&](const auto& c) { return c.kind == kind; });
  if (at != components.end()) return felt_amplitude(fit, static_cast<std::size_t>(at - components.begin()));
  FitResult with = fit;
  with.model.components.push_back({kind, 0.0, {}});
  return felt_amplitude(with, with.model.components.size() - 1);
}

/// T-1: where the Allan deviation of the model is lowest over the averaging times of the record.
struct Lowest {
  std::size_t at = 0;
  double deviation = 0.0;
};

Lowest lowest_of(const noise::Model& model, std::span<const noise::AllanPoint> allan) {
  Lowest lowest{0, std::numeric_limits<double>::infinity()};
  for (std::size_t i = 0; i < allan.size(); ++i) {
    const double deviation = model_allan_deviation(model, static_cast<double>(allan[i].n));
    if (deviation < lowest.deviation) lowest = {i, deviation};
  }
  return lowest;
}

/// Whether the record shows that the curve rises after its lowest point: some later interval lies above the
/// lowest point's.
bool rises_after(std::span<const noise::AllanPoint> allan, std::size_t lowest) {
  return std::any_of(allan.begin() + static_cast<std::ptrdiff_t>(lowest), allan.end(),
                     [&](const auto& point) { return point.ci_low > allan[lowest].deviation; });
}

/// T-1: B.
TermValue bias_instability(const FitResult& fit, std::span<const noise::AllanPoint> allan,
                           noise::SignalUnit unit) {
  const SheetUnit sheet = sheet_unit(Term::kBiasInstability, unit);
  TermValue out;
  out.term = Term::kBiasInstability;
  out.unit = sheet.name;
  out.value = kNan;
  if (allan.empty()) return out;
  const Lowest lowest = lowest_of(fit.model, allan);
  const auto& place = allan[lowest.at];
  const auto shown = [&](double deviation) { return sheet.factor * deviation / kFlickerAllanDeviation; };
  if (!rises_after(allan, lowest.at)) {
    out.knowledge = Knowledge::kBound;
    out.value = shown(place.ci_high);
    out.ci_high = out.value;
    out.note = fmt::format(
        "not reached within this record: the Allan deviation still falls at "
        "{:.3g} s, the longest averaging time",
        allan.back().tau_s);
    return out;
  }
  out.knowledge = Knowledge::kFitted;
  out.value = shown(lowest.deviation);
  const double z = boost::math::quantile(boost::math::normal(), 0.5 * (1.0 + fit.confidence));
  // What the record tells of the curve, whether or not it tells each parameter; else what it tells of the
  // observed deviation at this averaging time.
  const auto log_sd = noise::told_log_sd(fit, [&](const noise::Model& model) {
    return model_allan_deviation(model, static_cast<double>(place.n));
  });
  out.ci_low = log_sd ? out.value * std::exp(-z * *log_sd) : shown(place.ci_low);
  out.ci_high = log_sd ? out.value * std::exp(z * *log_sd) : shown(place.ci_high);
  out.note = fmt::format("at {:.3g} s", place.tau_s);
  return out;
}

/// T-1: N, B, K, R, Q.
std::vector<TermValue> terms_of(const FitResult& fit, std::span<const noise::AllanPoint> allan,
                                noise::SignalUnit unit) {
  const double f = fit.rate_hz;
  std::vector<TermValue> terms;
  terms.push_back(as_root(Term::kRandomWalk, unit, felt_white_density(fit, {}), 1.0));
  terms.push_back(bias_instability(fit, allan, unit));
  terms.push_back(as_root(Term::kRateRandomWalk, unit, amplitude_of(fit, ProcessKind::kRandomWalk), f));
  terms.push_back(as_root(Term::kRamp, unit, amplitude_of(fit, ProcessKind::kRamp), f * f));
  terms.push_back(
      as_root(Term::kQuantization, unit, amplitude_of(fit, ProcessKind::kQuantization), 1.0 / (f * f)));
  return terms;
}

bool has_interval(const TermValue& term) {
  return term.knowledge == Knowledge::kFitted && term.ci_low && term.ci_high;
}

/// T-4: D + p of a model, with its own interval of the term.
ModelsValue as_told_by(const FitResult& fit, const TermValue& term) {
  const auto parameters = static_cast<double>(fit.spec.parameter_count());
  const double price = std::log(static_cast<double>(fit.wv.size()));  // of a parameter, in the criterion
  return {fit.criterion + (1.0 - price) * parameters, term.value, *term.ci_low, *term.ci_high};
}

}  // namespace

const char* symbol_of(Term term) noexcept {
  constexpr const char* kSymbols[] = {"N", "B", "K", "R", "Q"};
  return kSymbols[static_cast<std::size_t>(term)];
}

const char* name_of(Term term, bool gyro) noexcept {
  constexpr const char* kGyro[] = {"angle random walk", "bias instability", "rate random walk", "rate ramp",
                                   "angle quantization"};
  constexpr const char* kAccelerometer[] = {"velocity random walk", "bias instability",
                                            "acceleration random walk", "acceleration ramp",
                                            "velocity quantization"};
  return (gyro ? kGyro : kAccelerometer)[static_cast<std::size_t>(term)];
}

std::vector<TermValue> data_sheet_terms(const FitResult& fit, std::span<const FitResult> rivals,
                                        std::span<const noise::AllanPoint> allan, noise::SignalUnit unit) {
  std::vector<TermValue> terms = terms_of(fit, allan, unit);
  std::vector<std::vector<ModelsValue>> told(terms.size());
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (has_interval(terms[i])) told[i].push_back(as_told_by(fit, terms[i]));
  }
  for (const FitResult& rival : rivals) {
    const std::vector<TermValue> others = terms_of(rival, allan, unit);
    for (std::size_t i = 0; i < terms.size(); ++i) {
      if (!told[i].empty() && has_interval(others[i])) told[i].push_back(as_told_by(rival, others[i]));
    }
  }
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (told[i].empty()) continue;
    const Interval interval = models_interval(told[i], fit.confidence);
    terms[i].ci_low = interval.low;
    terms[i].ci_high = interval.high;
  }
  for (TermValue& term : terms) {
    if (term.term != Term::kBiasInstability && term.knowledge == Knowledge::kBound)
      term.note = "below this: the record does not show it";
  }
  return terms;
}

}  // namespace imuscope::certificate
