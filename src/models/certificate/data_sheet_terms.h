#pragma once

/// The numbers of a data sheet from one axis' record, named as IEEE Std 952 (gyroscopes) and 1293
/// (accelerometers) name them, each with an interval or a bound.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "models/noise/allan.h"
#include "models/noise/felt_noise.h"
#include "models/noise/quantities.h"

namespace imuscope::certificate {

enum class Term : std::uint8_t { kRandomWalk, kBiasInstability, kRateRandomWalk, kRamp, kQuantization };

/// One row of a data sheet.
struct TermValue {
  Term term = Term::kRandomWalk;
  std::string unit;    ///< "deg/sqrt(h)", "deg/h", "micro-g", ...
  double value = 0.0;  ///< of a bound the bound; NaN where nothing is known
  std::optional<double> ci_low;
  std::optional<double> ci_high;
  noise::Knowledge knowledge = noise::Knowledge::kUnknown;
  std::string note;  ///< what limits it, for people; may be empty
};

/// "N", "B", "K", "R", "Q".
const char* symbol_of(Term term) noexcept;
/// "angle random walk" or "velocity random walk", "bias instability", "rate random walk", ...
const char* name_of(Term term, bool gyro) noexcept;

/// N: root of the density of all that is white to a filter that integrates for a second (G-28). B: lowest
/// point of the Allan deviation over 0.664, where it is a minimum and not the end of the record (T-1). K, R,
/// Q: of the model's own RW, DR and QN; without the term the most that the record allows (G-32).
/// What a filter feels depends little on the model, but more than its interval says: intervals are those of
/// the models together that the record does not tell apart, as far as each of them has the term (T-4).
/// @param fit    fitted to the axis, quick or inverted intervals
/// @param allan  of the same record, its intervals by that fit
/// @param unit   not kNone
std::vector<TermValue> data_sheet_terms(const noise::FitResult& fit, std::span<const noise::FitResult> rivals,
                                        std::span<const noise::AllanPoint> allan, noise::SignalUnit unit);

}  // namespace imuscope::certificate
