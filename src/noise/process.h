#pragma once

/// The latent processes of a composite noise model and their theoretical Haar wavelet variance, with
/// derivatives, in forms that stay exact where the textbook forms cancel.
///
/// A process is one linear amplitude (it enters the wavelet variance linearly and is never negative) times a
/// unit curve that depends on at most two shape values. Everything here is in sample terms (no rate);
/// tau = 2^level, n = tau / 2:
///
/// - WN: amplitude sigma2; curve 1 / tau
/// - QN: amplitude q2; curve 6 / tau^2
/// - RW: amplitude gamma2; curve (tau^2 + 2) / (12 tau)
/// - DR: amplitude omega^2 (omega per sample); curve tau^2 / 16
/// - GM: amplitude variance of the process, shape a = beta / rate; curve see gauss_markov_wv()
/// - MA1: amplitude innovation variance, shape theta in (-1, 1); curve ((1+theta)^2 tau - 6 theta) / tau^2
/// - ARMA11: amplitude innovation variance, shape phi, theta in (-1, 1); curve see process.cpp
/// - SIN: amplitude alpha^2 (random phase), shape b in radians per sample;
///   curve sin^4(n b/2) / (2 n^2 sin^2(b/2))
///
/// QN with q2 is sqrt(12 q2) times the difference of uniform(0, 1) numbers: variance 2 q2.

#include <array>
#include <cstdint>
#include <string_view>

namespace imuscope::noise {

enum class ProcessKind : std::uint8_t {
  kQuantization,
  kWhiteNoise,
  kMa1,
  kArma11,
  kSinusoid,
  kGaussMarkov,
  kRandomWalk,
  kRamp,
};

/// Levels beyond this are refused: 2^32 samples are more than a year at 100 Hz.
inline constexpr int kMaxLevel = 32;

using Shape = std::array<double, 2>;

/// A curve's value at one level, and its derivatives with respect to the shape values.
struct CurvePoint {
  double value = 0.0;
  Shape derivative{};
};

/// "WN", "QN", "RW", "DR", "GM", "MA1", "ARMA11", "SIN".
std::string_view short_name(ProcessKind kind) noexcept;

/// Number of shape values of a kind: 0, 1 or 2.
int shape_count(ProcessKind kind) noexcept;

/// Whether the shape lies in the range given above: what is read from a file may not.
bool is_in_range(ProcessKind kind, const Shape& shape) noexcept;

/// Unit curve at `level` (1..kMaxLevel). `shape` must lie in the range given above.
CurvePoint unit_wv(ProcessKind kind, const Shape& shape, int level) noexcept;

/// Wavelet variance of a first-order Gauss-Markov process of variance 1, and d/da, a = beta / rate > 0:
///   [n (1-phi^2) - phi (1-phi^n)(3-phi^n)] / (2 n^2 (1-phi)^2),  phi = exp(-a), n = 2^(level-1),
/// evaluated without cancellation for every a (relative error a few 1e-16; the naive form is negative at
/// 1e-6).
CurvePoint gauss_markov_wv(double a, int level) noexcept;

}  // namespace imuscope::noise
