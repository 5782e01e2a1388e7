#pragma once

/// Numbers as people read them: as many digits as the uncertainty leaves meaning in.

#include <optional>
#include <string>

#include "results/report/page_parts.h"

namespace imuscope::report {

/// Shown where a number is unknown.
inline constexpr const char* kUnknown = "–";

/// `value` with `digits` significant digits, plain where that is short, else times a power of ten.
Html number(double value, int digits = 4);
Html number(std::optional<double> value, int digits = 4);

/// "0.8123 ± 0.0071": two digits of the sd decide. Without a usable sd: number(value).
Html with_sd(double value, std::optional<double> sd);

/// "5.055 [5.051, 5.059]", with a common power of ten where the value is far from one.
Html with_interval(double value, std::optional<double> low, std::optional<double> high);

/// Below this a p value says no more than that it is small.
inline constexpr double kSmallestP = 1e-6;
Html p_words(std::optional<double> p);

/// "12 min 30 s".
std::string duration_words(double seconds);

/// "1 234 567" with thin spaces.
Html count(std::optional<double> value);

/// "2.3 sd", the error in units of its published sd.
std::string in_sd(double error, std::optional<double> sd);

}  // namespace imuscope::report
