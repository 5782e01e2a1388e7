#pragma once

/// How a mean of few runs is held against what is asked.

namespace imuscope {

/// It misses a band where it lies beyond it by more than so many of its own sd: less is chance, once in a
/// thousand.
inline constexpr double kOwnSd = 3.3;

}  // namespace imuscope
