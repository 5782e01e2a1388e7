#pragma once

/// Of wv_covariance() and CovarianceTable alone: the cross-covariance of wavelet coefficients of a model as a
/// function of the lag.

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <vector>

#include "models/noise/model.h"

namespace imuscope::noise {

/// Weights of the summed signal S in W = (S_t - 2 S_{t-n} + S_{t-2n}) / 2n.
inline constexpr std::array<double, 3> kDifference{1.0, -2.0, 1.0};

/// First-order autoregressive part with variance `variance` (may be negative within an ARMA) and phi =
/// exp(-a).
struct Exponential {
  double a = 0.0;
  double variance = 0.0;
  double phi = 0.0;             ///< used for negative phi, where a has no meaning
  double gain = 0.0;            ///< phi / (1 - phi)^2
  double linear = 0.0;          ///< (1 + phi) / (2 (1 - phi))
  double rest = 0.0;            ///< a gain - linear, without cancellation
  bool is_approximate = false;  ///< one of those that stand for a power law
};

using Complex = std::complex<double>;

/// A resonance: the real part of an exponential whose rate and variance are complex (G-37).
struct Oscillation {
  Complex rate;         ///< a - i b
  Complex variance;     ///< sigma2 (1 - i a/b)
  Complex gain;         ///< of Exponential
  double linear = 0.0;  ///< Re(variance linear)
};

/// The model sorted by what its summed signal's generalized covariance G(m) looks like.
struct Parts {
  double white = 0.0;         ///< -white |m| / 2
  double walk = 0.0;          ///< walk (|m|^3 - |m|) / 12
  double quantization = 0.0;  ///< at m = 0 only
  double uniform = 0.0;       ///< of that, what is made of uniform numbers
  double ramp = 0.0;          ///< omega per sample
  std::vector<Exponential> exponentials;
  std::vector<Oscillation> oscillations;
  std::vector<Component> sinusoids;
};

/// Each lag counts up to this distance from a break point; what rings is summed lag by lag for longer.
inline constexpr double kExactNear = 5.0;
/// Lags until a product of two of a resonance's exponentials is below 1e-3.
double rings_for(const Oscillation& o);
/// n from which a resonance rings so many times within the support that it is white noise but for a few lags.
double white_from(const Oscillation& o);
/// Distances of the break points of a cross-covariance from its centre n_k - n_j, in order.
std::vector<double> breaks_of(double n_j, double n_k);

/// A first-order autoregressive part by its rate, phi = exp(-a).
Exponential exponential_of_rate(double a, double variance);

Parts parts_of(const Model& model);

/// exp(-z) - 1 + z - z^2/2 for z >= 0.
double exponential_remainder(double z);

/// The parts of exp(x) - 1 - x - x^2/2, even and odd in x. To the last digit for |x| <= 0.5.
struct ExponentialTail {
  double even = 0.0;  ///< cosh(x) - 1 - x^2/2
  double odd = 0.0;   ///< sinh(x) - x
};

inline ExponentialTail exponential_tail(double x) {
  const double y = x * x;
  const double even =
      y * y / 24.0 *
      (1.0 + y / 30.0 * (1.0 + y / 56.0 * (1.0 + y / 90.0 * (1.0 + y / 132.0 * (1.0 + y / 182.0)))));
  const double odd =
      x * y / 6.0 *
      (1.0 + y / 20.0 * (1.0 + y / 42.0 * (1.0 + y / 72.0 * (1.0 + y / 110.0 * (1.0 + y / 156.0)))));
  return {even, odd};
}

/// Cross-covariance of the coefficients of two levels as a function of the lag (G-9).
///
/// Its break points are the lags b n_k - a n_j. Between two neighbouring ones the signs of all nine arguments
/// of G are known, so that the sum collapses to a cubic and two exponentials a process; enter() prepares
/// that. Of a process that is slow beside both levels the exponentials nearly cancel with the cubic: it is
/// expanded about the break point instead, where what remains beyond the square is again two exponentials'
/// tails.
class CrossCovariance {
 public:
  CrossCovariance(const Parts& parts, double n_j, double n_k)
      : parts_(parts),
        n_j_(n_j),
        n_k_(n_k),
        scale_(1.0 / (4.0 * n_j * n_k)),
        terms_(parts.exponentials.size()),
        waves_(parts.oscillations.size()) {
    for (std::size_t i = 0; i < waves_.size(); ++i) {
      const Oscillation& o = parts.oscillations[i];
      const Complex pj = 1.0 - std::exp(-o.rate * n_j_);
      const Complex pk = 1.0 - std::exp(-o.rate * n_k_);
      waves_[i].tail = -o.variance * o.gain * pj * pj * pk * pk;
    }
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      const Exponential& e = parts.exponentials[i];
      const double pj = e.a > 0.0 ? -std::expm1(-e.a * n_j_) : 1.0 - std::pow(e.phi, n_j_);
      const double pk = e.a > 0.0 ? -std::expm1(-e.a * n_k_) : 1.0 - std::pow(e.phi, n_k_);
      terms_[i].tail = -e.variance * e.gain * pj * pj * pk * pk;
      terms_[i].form = e.a < 0.0                           ? Form::kAlternating
                       : e.a * std::max(n_j_, n_k_) >= 0.5 ? Form::kSplit
                                                           : Form::kRemainder;
    }
    std::size_t i = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b, ++i) {
        shift_[i] = static_cast<double>(a) * n_j_ - static_cast<double>(b) * n_k_;
        weight_[i] = kDifference[a] * kDifference[b];
      }
    }
  }

  /// Prepares for lags strictly between the neighbouring break points p < q; infinite ends are allowed.
  void enter(double p, double q) {
    tail_ = p >= 2.0 * n_k_ || q <= -2.0 * n_j_;
    if (tail_) return;
    origin_ = p;
    end_ = q;
    cubic_ = {};
    for (Term& t : terms_) t.left = t.right = t.ahead = t.behind = 0.0;
    for (Wave& w : waves_) w.left = w.right = 0.0;
    for (std::size_t i = 0; i < shift_.size(); ++i) {
      const double at = p + shift_[i];  // argument of G at p
      const double sign = at >= 0.0 ? 1.0 : -1.0;
      add_polynomial(at, sign * weight_[i]);
      add_exponentials(at, q + shift_[i], weight_[i]);
    }
    for (std::size_t k = 0; k < terms_.size(); ++k) {
      if (terms_[k].form == Form::kRemainder) expand(k, p);
    }
  }

  /// At a lag inside what was entered.
  [[nodiscard]] double inside(double h) const {
    if (tail_) return beyond(h > 0.0 ? h - 2.0 * n_k_ : -h - 2.0 * n_j_) * scale_;
    const double d = h - origin_;
    double sum = cubic_[0] + d * (cubic_[1] + d * (cubic_[2] + d * cubic_[3]));
    for (std::size_t i = 0; i < terms_.size(); ++i) {
      const Term& t = terms_[i];
      const Exponential& e = parts_.exponentials[i];
      if (t.form == Form::kSplit) {
        sum -= t.left * decayed(e.a * d) + t.right * decayed(e.a * (end_ - h));
      } else if (t.form == Form::kRemainder) {
        const ExponentialTail tail = exponential_tail(e.a * d);
        sum -= (t.ahead + t.behind) * tail.even + (t.behind - t.ahead) * tail.odd;
      } else {
        sum += e.variance * nonlinear_part(e, t.form, h);
      }
    }
    for (std::size_t i = 0; i < waves_.size(); ++i) {
      const Complex rate = parts_.oscillations[i].rate;
      sum -= (waves_[i].left * decayed(rate * d) + waves_[i].right * decayed(rate * (end_ - h))).real();
    }
    return sum * scale_;
  }

  /// At any lag, break points included.
  [[nodiscard]] double operator()(double h) const {
    if (h > 2.0 * n_k_) return beyond(h - 2.0 * n_k_) * scale_;
    if (h < -2.0 * n_j_) return beyond(-h - 2.0 * n_j_) * scale_;
    double sum = 0.0;
    for (std::size_t i = 0; i < shift_.size(); ++i) {
      const double m = std::abs(h + shift_[i]);
      double g = m * (parts_.walk * (m * m - 1.0) / 12.0 - 0.5 * parts_.white);
      for (std::size_t k = 0; k < terms_.size(); ++k) g += m * linear_coefficient(k);
      for (const Oscillation& o : parts_.oscillations)
        g -= m * o.linear + (o.variance * o.gain * decayed(o.rate * m)).real();
      if (m == 0.0) g += parts_.quantization;
      sum += weight_[i] * g;
    }
    for (std::size_t k = 0; k < terms_.size(); ++k) {
      sum += parts_.exponentials[k].variance * nonlinear_part(parts_.exponentials[k], terms_[k].form, h);
    }
    return sum * scale_;
  }

 private:
  enum class Form { kSplit, kRemainder, kAlternating };
  struct Term {
    Form form = Form::kSplit;
    double tail = 0.0;    ///< beyond the overlap of the supports
    double left = 0.0;    ///< of exp(-a (h - p)), split
    double right = 0.0;   ///< of exp(-a (q - h)), split
    double ahead = 0.0;   ///< of the tail of exp(-a (h - p)), remainder
    double behind = 0.0;  ///< of the tail of exp(a (h - p)), remainder
  };

  struct Wave {
    Complex tail;
    Complex left;
    Complex right;
  };

  static constexpr double kNothing = 60.0;
  /// exp(-z); nothing where it is lost beside the cubic.
  static double decayed(double z) { return z < kNothing ? std::exp(-z) : 0.0; }
  static Complex decayed(Complex z) { return z.real() < kNothing ? std::exp(-z) : 0.0; }

  /// Adds the remainder of process k about p: with R(z) = exp(-z) - 1 + z - z^2/2,
  ///   R(z + x) = R(z) + R'(z) x + R''(z) x^2/2 + exp(-z) T(-x),  T(x) = exp(x) - 1 - x - x^2/2.
  void expand(std::size_t k, double p) {
    const Exponential& e = parts_.exponentials[k];
    const double factor = e.variance * e.gain;
    for (std::size_t i = 0; i < shift_.size(); ++i) {
      const double at = p + shift_[i];
      const double sign = at >= 0.0 ? 1.0 : -1.0;
      const double z = e.a * std::abs(at);
      const double remainder = exponential_remainder(z);
      const double lost = std::expm1(-z);  // R''(z)
      const double weight = factor * weight_[i];
      cubic_[0] -= weight * remainder;
      cubic_[1] += weight * sign * e.a * (remainder + 0.5 * z * z);  // -R'(z)
      cubic_[2] -= weight * 0.5 * e.a * e.a * lost;
      (sign > 0.0 ? terms_[k].ahead : terms_[k].behind) += weight * (1.0 + lost);
    }
  }

  [[nodiscard]] double linear_coefficient(std::size_t k) const {
    const Exponential& e = parts_.exponentials[k];
    return e.variance * (terms_[k].form == Form::kRemainder ? e.rest : -e.linear);
  }

  /// Adds weight * ((at + d)^3 - (at + d)) walk / 12 and the linear parts to the cubic in d.
  void add_polynomial(double at, double weight) {
    double linear = -0.5 * parts_.white - parts_.walk / 12.0;
    for (std::size_t k = 0; k < terms_.size(); ++k) linear += linear_coefficient(k);
    for (const Oscillation& o : parts_.oscillations) linear -= o.linear;
    const double third = parts_.walk / 12.0;
    cubic_[0] += weight * at * (linear + third * at * at);
    cubic_[1] += weight * (linear + 3.0 * third * at * at);
    cubic_[2] += weight * 3.0 * third * at;
    cubic_[3] += weight * third;
  }

  void add_exponentials(double at_p, double at_q, double weight) {
    for (std::size_t k = 0; k < terms_.size(); ++k) {
      if (terms_[k].form != Form::kSplit) continue;
      const Exponential& e = parts_.exponentials[k];
      if (at_p >= 0.0) {
        terms_[k].left += weight * e.variance * e.gain * decayed(e.a * at_p);
      } else {
        terms_[k].right += weight * e.variance * e.gain * decayed(-e.a * at_q);
      }
    }
    for (std::size_t k = 0; k < waves_.size(); ++k) {
      const Oscillation& o = parts_.oscillations[k];
      if (at_p >= 0.0) {
        waves_[k].left += weight * o.variance * o.gain * decayed(o.rate * at_p);
      } else {
        waves_[k].right += weight * o.variance * o.gain * decayed(-o.rate * at_q);
      }
    }
  }

  /// Where the two supports do not overlap only the exponentials remain, and only as a product.
  [[nodiscard]] double beyond(double distance) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < terms_.size(); ++k) {
      const Exponential& e = parts_.exponentials[k];
      sum += terms_[k].tail * (e.a > 0.0 ? std::exp(-e.a * distance) : std::pow(e.phi, std::round(distance)));
    }
    for (std::size_t k = 0; k < waves_.size(); ++k)
      sum += (waves_[k].tail * std::exp(-parts_.oscillations[k].rate * distance)).real();
    return sum;
  }

  [[nodiscard]] double nonlinear_part(const Exponential& e, Form form, double h) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < shift_.size(); ++i) {
      const double m = std::abs(h + shift_[i]);
      switch (form) {
        case Form::kAlternating:
          sum -= weight_[i] * std::pow(e.phi, std::round(m));
          break;
        case Form::kSplit:
          sum -= weight_[i] * std::exp(-e.a * m);
          break;
        // Constant and quadratic terms drop out of a fourth difference: they are left out beforehand.
        case Form::kRemainder:
          sum -= weight_[i] * exponential_remainder(e.a * m);
          break;
      }
    }
    return sum * e.gain;
  }

  const Parts& parts_;
  double n_j_;
  double n_k_;
  double scale_;
  std::vector<Term> terms_;
  std::vector<Wave> waves_;
  std::array<double, 9> shift_{};
  std::array<double, 9> weight_{};
  std::array<double, 4> cubic_{};
  double origin_ = 0.0;
  double end_ = 0.0;
  bool tail_ = false;
};
}  // namespace imuscope::noise
