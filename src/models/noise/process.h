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
/// - RES: resonance, x'' + 2 a x' + (a^2 + b^2) x = white noise, sampled; amplitude variance of x, shape a
///   (damping) and b (ringing) in radians per sample; curve see resonance_wv()
/// - FN: flicker noise, two-sided spectrum B^2 / |2 sin(pi f)| over the frequency f in cycles per sample:
///   amplitude B^2, B the bias instability of IEEE 952; curve see power_law_wv()
/// - PL: power law, spectrum s2 |2 sin(pi f)|^-alpha; amplitude s2, shape alpha in (0, 2); FN has alpha 1
///
/// QN with q2 is sqrt(12 q2) times the difference of uniform(0, 1) numbers: variance 2 q2.

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace imuscope::noise {

enum class ProcessKind : std::uint8_t {
  kQuantization,
  kWhiteNoise,
  kMa1,
  kArma11,
  kSinusoid,
  kResonance,
  kGaussMarkov,
  kFlicker,
  kPowerLaw,
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

/// "WN", "QN", "RW", "DR", "GM", "MA1", "ARMA11", "SIN", "RES", "FN", "PL".
std::string_view short_name(ProcessKind kind) noexcept;

/// Number of shape values of a kind: 0, 1 or 2.
int shape_count(ProcessKind kind) noexcept;

/// Whether the shape lies in the range given above: what is read from a file may not.
bool is_in_range(ProcessKind kind, const Shape& shape) noexcept;

/// Unit curve at `level` (1..kMaxLevel). `shape` must lie in the range given above.
CurvePoint unit_wv(ProcessKind kind, const Shape& shape, int level) noexcept;

/// unit_wv() at levels 1, 2, 3...: one exponential serves all levels of a Gauss-Markov process or a
/// resonance.
/// @param out  at most kMaxLevel
void unit_curve(ProcessKind kind, const Shape& shape, std::span<CurvePoint> out) noexcept;

/// Wavelet variance of a sinusoid of amplitude 1 and random phase for neighbouring means of n samples, which need be
/// no power of two.
/// @param omega_rad  a sample, above 0, pi at most
double sinusoid_wv(double omega_rad, double n) noexcept;

/// Wavelet variance of a first-order Gauss-Markov process of variance 1, and d/da, a = beta / rate > 0:
///   [n (1-phi^2) - phi (1-phi^n)(3-phi^n)] / (2 n^2 (1-phi)^2),  phi = exp(-a), n = 2^(level-1),
/// evaluated without cancellation for every a (relative error a few 1e-16; the naive form is negative at
/// 1e-6).
CurvePoint gauss_markov_wv(double a, int level) noexcept;

/// Wavelet variance of a resonance of variance 1, autocovariance Re[(1 - i a/b) z^k] with z = exp(-a + i b):
/// the formula of the Gauss-Markov process for the complex z (G-37), and its derivatives by a and b.
CurvePoint resonance_wv(double a, double b, int level) noexcept;

/// Generalized covariance of the summed power-law noise at lag m >= 0, up to constants and squares of m,
/// which fall out of every wavelet covariance (G-38).
double power_law_sum_covariance(double alpha, double m) noexcept;

/// Wavelet variance of power-law noise of amplitude 1, and d/dalpha.
CurvePoint power_law_wv(double alpha, int level) noexcept;

}  // namespace imuscope::noise
