#pragma once

/// Numbers for people.

#include <string>

namespace imuscope {

/// A number beside what is wanted of it: two significant digits without a power of ten, more where two would
/// read as what is wanted. "0.104" beside 0.1, "0.25" beside 0.1, "500" beside 10.
[[nodiscard]] std::string digits_beside(double value, double wanted);

}  // namespace imuscope
