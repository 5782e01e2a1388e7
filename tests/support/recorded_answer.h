#pragma once

/// Answers that are written out once and held from then on: whole outputs of which no single number is worth a sentence,
/// but of which none may change unseen. What is right about them, other tests prove.

#include <string>
#include <string_view>

namespace imuscope::test {

/// What another processor's or another build's rounding may change of a number, as a share of it.
inline constexpr double kShareOfNumber = 1e-6;

/// Where `text` first differs from `recorded`, as a sentence; empty where it does not. Line by line: words as they are,
/// numbers within `share` of the larger of the two, or `nothing` apart.
std::string first_difference(std::string_view recorded, std::string_view text, double share = kShareOfNumber,
                             double nothing = 1e-12);

/// Fails where `text` is not what stands in tests/recorded/`name`. With IMUSCOPE_RECORD_ANSWERS=1 in the environment it
/// writes that file and skips the test: look at the difference, and say in the commit why the answer moved.
void expect_recorded(std::string_view name, std::string_view text, double share = kShareOfNumber,
                     double nothing = 1e-12);

}  // namespace imuscope::test
