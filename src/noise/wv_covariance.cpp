#include "noise/wv_covariance.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <utility>

#include "noise/power_law.h"
#include "noise/robust_scale.h"

namespace imuscope::noise {
namespace {

/// Weights of the summed signal S in W = (S_t - 2 S_{t-n} + S_{t-2n}) / 2n.
constexpr std::array<double, 3> kDifference{1.0, -2.0, 1.0};

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

Oscillation oscillation_of(const Component& c) {
  const Complex rate(c.shape[0], -c.shape[1]);
  const Complex variance = c.amplitude * Complex(1.0, -c.shape[0] / c.shape[1]);
  const Complex sh = std::sinh(0.5 * rate);
  return {rate, variance, 0.25 / (sh * sh), (variance * 0.5 / std::tanh(0.5 * rate)).real()};
}

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

Exponential exponential_of_rate(double a, double variance) {
  Exponential e;
  e.a = a;
  e.variance = variance;
  e.phi = std::exp(-a);
  const double sh = std::sinh(0.5 * a);
  e.gain = 0.25 / (sh * sh);
  e.linear = 0.5 / std::tanh(0.5 * a);
  constexpr double kSeriesBelow = 0.05;
  e.rest = a < kSeriesBelow ? -a / 6.0 * (1.0 - a * a / 60.0) : a * e.gain - e.linear;
  return e;
}

Exponential exponential_of_phi(double phi, double variance) {
  if (phi > 0.0) return exponential_of_rate(-std::log(phi), variance);
  Exponential e;
  e.a = -1.0;
  e.variance = variance;
  e.phi = phi;
  e.gain = phi / ((1.0 - phi) * (1.0 - phi));
  e.linear = 0.5 * (1.0 + phi) / (1.0 - phi);
  return e;
}

Parts parts_of(const Model& model) {
  Parts parts;
  for (const Component& c : model.components) {
    if (c.amplitude <= 0.0) continue;
    const double theta = c.shape[0];
    switch (c.kind) {
      case ProcessKind::kWhiteNoise:
        parts.white += c.amplitude;
        break;
      case ProcessKind::kQuantization:
        parts.quantization += c.amplitude;
        parts.uniform += c.amplitude;
        break;
      case ProcessKind::kRandomWalk:
        parts.walk += c.amplitude;
        break;
      case ProcessKind::kRamp:
        parts.ramp += std::sqrt(c.amplitude);
        break;
      case ProcessKind::kGaussMarkov:
        parts.exponentials.push_back(exponential_of_rate(c.shape[0], c.amplitude));
        break;
      case ProcessKind::kMa1:  // white plus a quantization-like part, of either sign
        parts.white += c.amplitude * (1.0 + theta) * (1.0 + theta);
        parts.quantization -= c.amplitude * theta;
        break;
      case ProcessKind::kArma11: {
        const double phi = c.shape[0];
        const double ma = c.shape[1];
        constexpr double kNoMemory = 1e-6;
        if (std::abs(phi) < kNoMemory) {
          parts.white += c.amplitude * (1.0 + ma) * (1.0 + ma);
          parts.quantization -= c.amplitude * ma;
          break;
        }
        const double share = (ma + phi) * (1.0 + ma * phi) / (phi * (1.0 - phi * phi));
        parts.exponentials.push_back(exponential_of_phi(phi, c.amplitude * share));
        parts.white -= c.amplitude * ma / phi;
        break;
      }
      case ProcessKind::kSinusoid:
        parts.sinusoids.push_back(c);
        break;
      case ProcessKind::kResonance:
        parts.oscillations.push_back(oscillation_of(c));
        break;
      case ProcessKind::kFlicker:
      case ProcessKind::kPowerLaw:
        for (const Component& term : power_law_sum(c)) {
          if (term.kind == ProcessKind::kWhiteNoise) parts.white += term.amplitude;
          if (term.kind == ProcessKind::kRandomWalk) parts.walk += term.amplitude;
          if (term.kind != ProcessKind::kGaussMarkov) continue;
          parts.exponentials.push_back(exponential_of_rate(term.shape[0], term.amplitude));
          parts.exponentials.back().is_approximate = true;
        }
        break;
    }
  }
  return parts;
}

/// exp(-z) - 1 + z - z^2/2 for z >= 0.
double exponential_remainder(double z) {
  constexpr double kSeriesBelow = 0.7;
  if (z >= kSeriesBelow) return std::expm1(-z) + z - 0.5 * z * z;
  double term = -z * z * z / 6.0;
  double sum = term;
  for (int k = 4; k < 18; ++k) {
    term *= -z / k;
    sum += term;
    if (std::abs(term) < 1e-17 * std::abs(sum)) break;
  }
  return sum;
}

/// The parts of exp(x) - 1 - x - x^2/2, even and odd in x. To the last digit for |x| <= 0.5.
struct ExponentialTail {
  double even = 0.0;  ///< cosh(x) - 1 - x^2/2
  double odd = 0.0;   ///< sinh(x) - x
};

ExponentialTail exponential_tail(double x) {
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

/// Where a level has coefficients: stretches of their newest samples, and the share of these that it keeps.
struct LevelPlaces {
  std::vector<Segment> places;  ///< empty: one stretch, that ends at the newest sample
  double kept = 1.0;
  double width = 0.0;        ///< 2^j
  bool bears_holes = false;  ///< single missing samples; where not, what it loses depends on the overlap
};

LevelPlaces places_of(const WaveletVariance& wv, const WvLevel& level) {
  LevelPlaces out;
  out.width = level.tau_samples;
  const auto n = static_cast<std::size_t>(0.5 * level.tau_samples);
  out.bears_holes = least_valid(n) < n;
  out.places = level.places;
  if (out.places.empty() && wv.segments.size() > 1) {
    for (const Segment& s : wv.segments) {
      if (s.end - s.begin >= 2 * n) out.places.push_back({s.begin + 2 * n - 1, s.end});
    }
  }
  double positions = 0.0;
  for (const Segment& s : out.places) positions += static_cast<double>(s.end - s.begin);
  if (positions > 0.0) out.kept = std::min(1.0, static_cast<double>(level.n_coefficients) / positions);
  return out;
}

/// N_jk(h) of G-8: pairs of coefficients at a lag. In runs joined over missing samples a share of the
/// positions is kept (G-34).
class PairCounts {
 public:
  PairCounts(const WvLevel& j, const WvLevel& k, const LevelPlaces& at_j, const LevelPlaces& at_k)
      : j_(at_j),
        k_(at_k),
        m_j_(static_cast<double>(j.n_coefficients)),
        m_k_(static_cast<double>(k.n_coefficients)) {}

  [[nodiscard]] double operator()(double h) const {
    if (j_.places.empty() || k_.places.empty()) {
      // Both runs end at the newest sample.
      return std::max(0.0, std::min(0.0, -h) - std::max(-m_j_, -m_k_ - h));
    }
    return kept_together(h) * positions(h);
  }

  /// Lags within `reach` of `centre` at which the number of pairs changes its slope. None where they are
  /// many: then each of them matters little.
  [[nodiscard]] std::vector<double> kinks(double centre, double reach) const {
    constexpr std::size_t kMostKinks = 64;
    std::vector<double> out;
    auto first = k_.places.begin();
    for (const Segment& run : j_.places) {
      const double low = static_cast<double>(run.begin) + centre - reach;
      const double high = static_cast<double>(run.end) + centre + reach;
      while (first != k_.places.end() && static_cast<double>(first->end) < low) ++first;
      for (auto other = first; other != k_.places.end() && static_cast<double>(other->begin) <= high;
           ++other) {
        for (const std::size_t to : {other->begin, other->end}) {
          for (const std::size_t from : {run.begin, run.end}) {
            const double lag = static_cast<double>(to) - static_cast<double>(from);
            if (std::abs(lag - centre) <= reach) out.push_back(lag);
          }
        }
        if (out.size() > kMostKinks) return {};
      }
    }
    return out;
  }

  /// Lags beyond these have no pairs.
  [[nodiscard]] double lowest() const { return -extent(); }
  [[nodiscard]] double highest() const { return extent(); }

 private:
  [[nodiscard]] double positions(double h) const {
    double sum = 0.0;
    std::size_t first = 0;
    for (const Segment& s : j_.places) {
      const double begin = static_cast<double>(s.begin) + h;
      const double end = static_cast<double>(s.end) + h;
      while (first < k_.places.size() && static_cast<double>(k_.places[first].end) <= begin) ++first;
      for (std::size_t i = first; i < k_.places.size(); ++i) {
        const auto from = static_cast<double>(k_.places[i].begin);
        if (from >= end) break;
        sum += std::max(0.0, std::min(end, static_cast<double>(k_.places[i].end)) - std::max(begin, from));
      }
    }
    return sum;
  }

  /// Chance that both coefficients of a pair are kept. What overlaps is kept or lost together, where no
  /// missing sample is borne; of one level always.
  [[nodiscard]] double kept_together(double h) const {
    const double both = j_.kept * k_.kept;
    if (both == 1.0) return 1.0;
    if (j_.width != k_.width && (j_.bears_holes || k_.bears_holes)) return both;
    // The supports end at 0 and at h.
    const double overlap = std::max(0.0, std::min(0.0, h) - std::max(-j_.width, h - k_.width));
    const double most = std::max(j_.kept, k_.kept);
    return both * std::pow(most, -overlap / std::min(j_.width, k_.width));
  }

  [[nodiscard]] double extent() const {
    if (j_.places.empty() || k_.places.empty()) return std::max(m_j_, m_k_);
    return static_cast<double>(std::max(j_.places.back().end, k_.places.back().end) -
                               std::min(j_.places.front().begin, k_.places.front().begin));
  }

  const LevelPlaces& j_;
  const LevelPlaces& k_;
  double m_j_;
  double m_k_;
};

/// Sum of f over the integers of [low, high]. Between its break points f is smooth, the more so the further
/// from them: each integer counts close to a break point, then blocks of doubling length by the three-point
/// rule that is exact for polynomials of degree five over equally spaced points. F has at(h) for break
/// points, and enter(p, q) with inside(h) for what lies between.
template <typename F>
class LagSum {
 public:
  LagSum(F& f, double exact_near) : f_(f), exact_(exact_near) {}

  double between(const std::vector<double>& breaks, double low, double high) {
    constexpr double kFar = std::numeric_limits<double>::infinity();
    double sum = 0.0;
    double last = -kFar;
    for (const double b : breaks) {
      sum += interval(last, b, low, high);
      if (b >= low && b <= high) sum += f_.at(b);
      last = b;
    }
    return sum + interval(last, kFar, low, high);
  }

 private:
  /// Integers strictly between the break points p and q that lie in [low, high].
  double interval(double p, double q, double low, double high) {
    const double from = std::max(p + 1.0, low);
    const double to = std::min(q - 1.0, high);
    if (from > to) return 0.0;
    f_.enter(p, q);
    if (std::isinf(q)) return away(p, 1.0, from - p, to - p);
    if (std::isinf(p)) return away(q, -1.0, q - to, q - from);
    const double middle = std::floor(0.5 * (p + q));
    return away(p, 1.0, from - p, std::min(to, middle) - p) +
           away(q, -1.0, q - to, q - std::max(from, middle + 1.0));
  }

  /// Distances first..last from the break point at origin.
  double away(double origin, double sign, double first, double last) {
    double sum = 0.0;
    double d = first;
    for (; d <= last && d <= exact_; d += 1.0) sum += f_.inside(origin + sign * d);
    while (d <= last) {
      const double length = std::min(d, last - d + 1.0);
      sum += block(origin, sign, d, length);
      d += length;
    }
    return sum;
  }

  double block(double origin, double sign, double first, double length) {
    if (length < 4.0) {
      double sum = 0.0;
      for (double d = first; d < first + length; d += 1.0) sum += f_.inside(origin + sign * d);
      return sum;
    }
    const double centre = first + 0.5 * (length - 1.0);
    const double second_moment = length * (length * length - 1.0) / 12.0;
    const double offset = std::sqrt((3.0 * length * length - 7.0) / 20.0);
    const double side = 0.5 * second_moment / (offset * offset);
    return side *
               (f_.inside(origin + sign * (centre - offset)) + f_.inside(origin + sign * (centre + offset))) +
           (length - 2.0 * side) * f_.inside(origin + sign * centre);
  }

  F& f_;
  double exact_;
};

/// Variance of the coefficients of two levels and the terms of biweight_correlation_terms(), empty for the
/// classical estimator.
struct RobustTerms {
  double variance_j = 1.0;
  double variance_k = 1.0;
  std::vector<double> terms;
};

/// N_jk(h) [2 C^2 + 4 m_j m_k C] at the distance x >= 0 from the centre lag n_k - n_j, both sides together: C
/// is symmetric about that lag. In the form that LagSum takes.
class PairTerm {
 public:
  PairTerm(CrossCovariance c, const PairCounts& pairs, double centre, double means, const RobustTerms& robust)
      : c_(std::move(c)), pairs_(pairs), centre_(centre), means_(means), robust_(robust) {}

  void enter(double p, double q) { c_.enter(centre_ + p, centre_ + q); }
  [[nodiscard]] double inside(double x) const { return weighted(x, c_.inside(centre_ + x)); }
  [[nodiscard]] double at(double x) const { return weighted(x, c_(centre_ + x)); }

 private:
  [[nodiscard]] double weighted(double x, double c) const {
    const double mirrored = x > 0.0 ? pairs_(centre_ - x) : 0.0;
    return (pairs_(centre_ + x) + mirrored) * (covariance_of_squares(c) + means_ * c);
  }
  [[nodiscard]] double covariance_of_squares(double c) const {
    if (robust_.terms.empty()) return 2.0 * c * c;
    const double scale = robust_.variance_j * robust_.variance_k;
    const double rho2 = c * c / scale;
    double sum = 0.0;
    for (auto term = robust_.terms.rbegin(); term != robust_.terms.rend(); ++term) sum = (sum + *term) * rho2;
    return sum * scale;
  }

  CrossCovariance c_;
  const PairCounts& pairs_;
  double centre_;
  double means_;
  const RobustTerms& robust_;
};

/// |transfer function of level's coefficients|^2 at angular frequency b.
double gain_at(double b, double n) {
  const double ratio = std::sin(0.5 * n * b) / (n * std::sin(0.5 * b));
  return ratio * ratio * std::sin(0.5 * n * b) * std::sin(0.5 * n * b);
}

/// Spectrum sum_h gamma(h) exp(-i b h) of the parts that are stationary or become so by the wavelet.
double spectrum_at(const Parts& parts, double b) {
  const double s2 = 4.0 * std::sin(0.5 * b) * std::sin(0.5 * b);
  double sum = parts.white + parts.quantization * s2 + parts.walk / s2;
  for (const Exponential& e : parts.exponentials) {
    sum += e.variance * (1.0 - e.phi * e.phi) / ((1.0 - e.phi) * (1.0 - e.phi) + e.phi * s2);
  }
  for (const Oscillation& o : parts.oscillations) {
    const Complex z = std::exp(-o.rate);
    sum += (o.variance * (1.0 - z * z) / ((1.0 - z) * (1.0 - z) + z * s2)).real();
  }
  return sum;
}

/// G-10. Quantization is a difference of uniform numbers, whose fourth cumulant narrows the wavelet
/// variance's spread by kappa q2^2 sum_i A_j(i) A_k(i) / (M_j M_k), A_j(i) the summed squared weights of
/// number i at level j.
double uniform_correction(double q2, const std::vector<Segment>& runs, const WvLevel& j, const WvLevel& k) {
  constexpr double kExcessKurtosis = -1.2;
  const double n_j = 0.5 * j.tau_samples;
  const double n_k = 0.5 * k.tau_samples;
  const auto overlap_of_run = [&](double length) {
    const double m_j = length - 2.0 * n_j + 1.0;
    const double m_k = length - 2.0 * n_k + 1.0;
    if (m_j <= 0.0 || m_k <= 0.0) return 0.0;
    double sum = 0.0;
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b) {
        const double weight = kDifference[a] * kDifference[a] * kDifference[b] * kDifference[b];
        const double end = -std::max(static_cast<double>(a) * n_j, static_cast<double>(b) * n_k);
        const double begin =
            -std::min(static_cast<double>(a) * n_j + m_j, static_cast<double>(b) * n_k + m_k);
        sum += weight * std::max(0.0, end - begin);
      }
    }
    return sum;
  };
  double sum = 0.0;
  for (const Segment& s : runs) sum += overlap_of_run(static_cast<double>(s.end - s.begin));
  const auto count_j = static_cast<double>(j.n_coefficients);
  const auto count_k = static_cast<double>(k.n_coefficients);
  if (runs.empty()) sum = overlap_of_run(std::min(count_j + 2.0 * n_j, count_k + 2.0 * n_k) - 1.0);
  const double scale = 1.0 / (16.0 * n_j * n_j * n_k * n_k);
  return kExcessKurtosis * q2 * q2 * scale * sum / (count_j * count_k);
}

/// G-34: what missing samples add to two levels behaves as white noise.
Parts with_missing(const Parts& parts, const WvLevel& j, const WvLevel& k) {
  const auto white_of = [](const WvLevel& level) {
    return (level.inflation - 1.0) * level.value * level.tau_samples;
  };
  Parts out = parts;
  if (j.inflation > 1.0 && k.inflation > 1.0) out.white += std::sqrt(white_of(j) * white_of(k));
  return out;
}

/// What acts like a simpler process on both levels becomes that, where the model is approximate or the
/// difference small: of the processes that stand for a power law, those that are a random walk to both
/// levels, or white noise to both, become just that: to within what the sum itself deviates by.
Parts folded(Parts parts, double n_j, double n_k) {
  constexpr double kWalk = 0.02;  // of a n: 2 sigma2 (1 - e^{-a n}) is a walk's growth to a hundredth
  constexpr double kWhite = 50.0;
  std::erase_if(parts.exponentials, [&](const Exponential& e) {
    if (!e.is_approximate) return false;
    const bool is_walk = e.a * std::max(n_j, n_k) < kWalk;
    const bool is_white = e.a * std::min(n_j, n_k) > kWhite;
    if (is_walk) parts.walk += 2.0 * e.a * e.variance;
    if (is_white) parts.white += 2.0 * e.linear * e.variance;
    return is_walk || is_white;
  });
  // A resonance that rings many times within both supports is white noise to them but for a few lags.
  constexpr double kRung = 60.0;  // radians
  constexpr double kFaded = 8.0;  // time constants
  std::erase_if(parts.oscillations, [&](const Oscillation& o) {
    if (std::abs(o.rate) * std::min(n_j, n_k) < kRung || o.rate.real() * std::min(n_j, n_k) < kFaded)
      return false;
    parts.white += 2.0 * o.linear;
    return true;
  });
  return parts;
}

double covariance_of_pair(const Parts& whole, const WvLevel& j, const WvLevel& k, const LevelPlaces& at_j,
                          const LevelPlaces& at_k, const std::vector<Segment>& runs,
                          const std::vector<double>& robust_terms) {
  const double n_j = 0.5 * j.tau_samples;
  const double n_k = 0.5 * k.tau_samples;
  const Parts parts = folded(with_missing(whole, j, k), n_j, n_k);
  const PairCounts pairs(j, k, at_j, at_k);
  const double means = 4.0 * (0.5 * parts.ramp * n_j) * (0.5 * parts.ramp * n_k);
  const double centre = n_k - n_j;
  RobustTerms robust;
  if (!robust_terms.empty()) {
    robust = {CrossCovariance(with_missing(whole, j, j), n_j, n_j)(0.0),
              CrossCovariance(with_missing(whole, k, k), n_k, n_k)(0.0), robust_terms};
  }
  PairTerm term(CrossCovariance(parts, n_j, n_k), pairs, centre, means, robust);
  std::vector<double> breaks;  // distances from the centre
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) breaks.push_back(std::abs(b * n_k - a * n_j - centre));
  }
  std::sort(breaks.begin(), breaks.end());
  breaks.erase(std::unique(breaks.begin(), breaks.end()), breaks.end());
  // Beyond the overlap of the supports only exponentials reach, and none further than this many time
  // constants.
  constexpr double kTimeConstants = 18.0;
  constexpr double kRinging = 4.0;  // time constants after which a product of two is below 1e-3
  constexpr double kExactNearAlternating = 64.0;
  double reach = 0.0;
  double exact_near = 5.0;
  for (const Oscillation& o : parts.oscillations) {
    // While it rings no block of lags is smooth.
    reach = std::max(reach, kTimeConstants / o.rate.real());
    exact_near = std::max(exact_near, kRinging / o.rate.real());
  }
  for (const Exponential& e : parts.exponentials) {
    const double a = e.a > 0.0 ? e.a : -std::log(std::abs(e.phi));
    reach = std::max(reach, kTimeConstants / a);
    if (e.a < 0.0) exact_near = std::max(exact_near, kExactNearAlternating);
  }
  const double furthest_pair = std::max(pairs.highest() - centre, centre - pairs.lowest());
  const double high = std::min(furthest_pair, breaks.back() + std::ceil(reach));
  for (const double lag : pairs.kinks(centre, high)) breaks.push_back(std::abs(lag - centre));
  std::sort(breaks.begin(), breaks.end());
  breaks.erase(std::unique(breaks.begin(), breaks.end()), breaks.end());
  LagSum sum(term, exact_near);
  const double count_j = static_cast<double>(j.n_coefficients);
  const double count_k = static_cast<double>(k.n_coefficients);
  double result = sum.between(breaks, 0.0, high) / (count_j * count_k);
  if (parts.uniform > 0.0) result += uniform_correction(parts.uniform, runs, j, k);
  for (const Component& s : parts.sinusoids) {
    const double b = s.shape[0];
    result += 2.0 * s.amplitude * gain_at(b, n_j) * gain_at(b, n_k) * spectrum_at(parts, b) /
              std::max(count_j, count_k);
  }
  return result;
}

/// Counts of pairs that are told by shares and by few break points may leave a matrix that is no covariance.
/// Those of whole records have no correlation eigenvalue below twice this.
constexpr double kLeastEigenvalue = 0.01;

/// The nearest matrix of the same variances whose correlations have no smaller eigenvalue.
Eigen::MatrixXd bounded_below(const Eigen::MatrixXd& v) {
  const Eigen::VectorXd sd = v.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation = sd.cwiseInverse().asDiagonal() * v * sd.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of_correlation(correlation);
  if (!(of_correlation.eigenvalues().minCoeff() < kLeastEigenvalue)) return v;
  const Eigen::MatrixXd& axes = of_correlation.eigenvectors();
  const Eigen::MatrixXd lifted =
      axes * of_correlation.eigenvalues().cwiseMax(kLeastEigenvalue).asDiagonal() * axes.transpose();
  const Eigen::VectorXd scale = sd.cwiseQuotient(lifted.diagonal().cwiseSqrt());
  return scale.asDiagonal() * lifted * scale.asDiagonal();
}

/// @param robust_terms  of G-11; empty: classical
Eigen::MatrixXd covariance(const Model& model, const WaveletVariance& wv, std::size_t levels,
                           const std::vector<double>& robust_terms) {
  const Parts parts = parts_of(model);
  const auto size = static_cast<Eigen::Index>(levels);
  Eigen::MatrixXd v(size, size);
  std::vector<LevelPlaces> places;
  for (std::size_t j = 0; j < levels; ++j) places.push_back(places_of(wv, wv.levels[j]));
  for (std::size_t j = 0; j < levels; ++j) {
    for (std::size_t k = 0; k <= j; ++k) {
      const double value = covariance_of_pair(parts, wv.levels[j], wv.levels[k], places[j], places[k],
                                              wv.segments, robust_terms);
      v(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(k)) = value;
      v(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j)) = value;
    }
  }
  const bool is_exact =
      std::all_of(places.begin(), places.end(), [](const auto& p) { return p.places.empty(); });
  return is_exact ? v : bounded_below(v);
}

}  // namespace

double coefficient_covariance(const Model& model, int level_j, int level_k, double lag) {
  const Parts parts = parts_of(model);
  return CrossCovariance(parts, std::ldexp(1.0, level_j - 1), std::ldexp(1.0, level_k - 1))(lag);
}

Eigen::MatrixXd wv_covariance(const Model& model, const WaveletVariance& wv, std::size_t levels) {
  return covariance(model, wv, levels,
                    wv.efficiency < 1.0 ? biweight_correlation_terms(wv.efficiency) : std::vector<double>{});
}

Eigen::MatrixXd robust_loss(const Model& model, const WaveletVariance& robust, std::size_t levels) {
  auto terms = biweight_correlation_terms(robust.efficiency);
  terms.front() = 0.0;  // that of the classical one
  return covariance(model, robust, levels, terms);
}

}  // namespace imuscope::noise
