#include "noise/wv_covariance.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace imuscope::noise {
namespace {

/// Weights of the summed signal S in W = (S_t - 2 S_{t-n} + S_{t-2n}) / 2n.
constexpr std::array<double, 3> kDifference{1.0, -2.0, 1.0};

/// First-order autoregressive part with variance `variance` (may be negative within an ARMA) and phi =
/// exp(-a).
struct Exponential {
  double a = 0.0;
  double variance = 0.0;
  double phi = 0.0;     ///< used for negative phi, where a has no meaning
  double gain = 0.0;    ///< phi / (1 - phi)^2
  double linear = 0.0;  ///< (1 + phi) / (2 (1 - phi))
  double rest = 0.0;    ///< a gain - linear, without cancellation
};

/// The model sorted by what its summed signal's generalized covariance G(m) looks like.
struct Parts {
  double white = 0.0;         ///< -white |m| / 2
  double walk = 0.0;          ///< walk (|m|^3 - |m|) / 12
  double quantization = 0.0;  ///< at m = 0 only
  double uniform = 0.0;       ///< of that, what is made of uniform numbers
  double ramp = 0.0;          ///< omega per sample
  std::vector<Exponential> exponentials;
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
  }
  return sum;
}

/// Cross-covariance of the coefficients of two levels as a function of the lag.
class CrossCovariance {
 public:
  CrossCovariance(const Parts& parts, double n_j, double n_k)
      : parts_(parts), n_j_(n_j), n_k_(n_k), scale_(1.0 / (4.0 * n_j * n_k)) {}

  [[nodiscard]] double operator()(double h) const {
    if (h > 2.0 * n_k_) return beyond(h - 2.0 * n_k_);
    if (h < -2.0 * n_j_) return beyond(-h - 2.0 * n_j_);
    std::array<double, 9> lag{};
    std::array<double, 9> weight{};
    std::size_t i = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b, ++i) {
        lag[i] = std::abs(h + static_cast<double>(a) * n_j_ - static_cast<double>(b) * n_k_);
        weight[i] = kDifference[a] * kDifference[b];
      }
    }
    double sum = 0.0;
    for (i = 0; i < lag.size(); ++i) {
      const double m = lag[i];
      double g = m * (parts_.walk * (m * m - 1.0) / 12.0 - 0.5 * parts_.white);
      if (m == 0.0) g += parts_.quantization;
      sum += weight[i] * g;
    }
    for (const Exponential& e : parts_.exponentials) sum += e.variance * difference_of(e, lag, weight);
    return sum * scale_;
  }

 private:
  /// Where the two supports do not overlap only the exponentials remain, and only as a product.
  [[nodiscard]] double beyond(double distance) const {
    double sum = 0.0;
    for (const Exponential& e : parts_.exponentials) {
      const double pj = e.a > 0.0 ? -std::expm1(-e.a * n_j_) : 1.0 - std::pow(e.phi, n_j_);
      const double pk = e.a > 0.0 ? -std::expm1(-e.a * n_k_) : 1.0 - std::pow(e.phi, n_k_);
      const double decay = e.a > 0.0 ? std::exp(-e.a * distance) : std::pow(e.phi, std::round(distance));
      sum -= e.variance * e.gain * decay * pj * pj * pk * pk;
    }
    return sum * scale_;
  }

  [[nodiscard]] double difference_of(const Exponential& e, const std::array<double, 9>& lag,
                                     const std::array<double, 9>& weight) const {
    double sum = 0.0;
    if (e.a < 0.0) {
      for (std::size_t i = 0; i < lag.size(); ++i) {
        sum -= weight[i] * (e.gain * std::pow(e.phi, std::round(lag[i])) + e.linear * lag[i]);
      }
    } else if (e.a * std::max(n_j_, n_k_) >= 0.5) {
      for (std::size_t i = 0; i < lag.size(); ++i) {
        sum -= weight[i] * (e.gain * std::exp(-e.a * lag[i]) + e.linear * lag[i]);
      }
    } else {
      // Constant, linear-even and quadratic terms drop out of a fourth difference: leave them out beforehand.
      for (std::size_t i = 0; i < lag.size(); ++i) {
        sum += weight[i] * (e.rest * lag[i] - e.gain * exponential_remainder(e.a * lag[i]));
      }
    }
    return sum;
  }

  const Parts& parts_;
  double n_j_;
  double n_k_;
  double scale_;
};

/// Number of coefficient pairs (t of level j, t + h of level k) as a function of the lag.
class PairCounts {
 public:
  PairCounts(const WaveletVariance& wv, const WvLevel& j, const WvLevel& k)
      : segments_(wv.segments),
        m_j_(static_cast<double>(j.n_coefficients)),
        m_k_(static_cast<double>(k.n_coefficients)),
        width_j_(j.tau_samples),
        width_k_(k.tau_samples) {}

  [[nodiscard]] double operator()(double h) const {
    if (segments_.size() < 2) {
      // Both runs end at the newest sample.
      return std::max(0.0, std::min(0.0, -h) - std::max(-m_j_, -m_k_ - h));
    }
    double sum = 0.0;
    std::size_t first = 0;
    for (const Segment& s : segments_) {
      const double begin = static_cast<double>(s.begin) + width_j_ - 1.0 + h;
      const double end = static_cast<double>(s.end) + h;
      if (begin >= end) continue;
      while (first < segments_.size() && static_cast<double>(segments_[first].end) <= begin) ++first;
      for (std::size_t i = first; i < segments_.size(); ++i) {
        const double from = static_cast<double>(segments_[i].begin) + width_k_ - 1.0;
        if (from >= end) break;
        sum += std::max(0.0, std::min(end, static_cast<double>(segments_[i].end)) - std::max(begin, from));
      }
    }
    return sum;
  }

  /// Lags beyond these have no pairs.
  [[nodiscard]] double lowest() const { return -extent(); }
  [[nodiscard]] double highest() const { return extent(); }

 private:
  [[nodiscard]] double extent() const {
    if (segments_.size() < 2) return std::max(m_j_, m_k_);
    return static_cast<double>(segments_.back().end - segments_.front().begin);
  }

  const std::vector<Segment>& segments_;
  double m_j_;
  double m_k_;
  double width_j_;
  double width_k_;
};

/// Sum of f over the integers of [low, high]. Between its break points f is smooth, the more so the further
/// from them: each integer counts close to a break point, then blocks of doubling length by the three-point
/// rule that is exact for polynomials of degree five over equally spaced points.
template <typename F>
class LagSum {
 public:
  LagSum(const F& f, int exact_near) : f_(f), exact_(exact_near) {}

  double between(const std::vector<double>& breaks, double low, double high) const {
    double sum = 0.0;
    double last = low - 1.0;
    for (const double b : breaks) {
      if (b < low || b > high) continue;
      sum += interval(last, b, last >= low) + f_(b);
      last = b;
    }
    return sum + interval(last, high + 1.0, false, last >= low);
  }

 private:
  /// Integers strictly between p and q; from_left/from_right: that end is a break point.
  double interval(double p, double q, bool from_left, bool right_open = false) const {
    const double count = q - p - 1.0;
    if (count <= 0.0) return 0.0;
    if (right_open) return away(p, 1.0, count);
    if (!from_left) return away(q, -1.0, count);
    const double left = std::floor(0.5 * count);
    return away(p, 1.0, left) + away(q, -1.0, count - left);
  }

  double away(double origin, double sign, double count) const {
    double sum = 0.0;
    double d = 1.0;
    for (; d <= count && d <= exact_; d += 1.0) sum += f_(origin + sign * d);
    while (d <= count) {
      const double length = std::min(d, count - d + 1.0);
      sum += block(origin, sign, d, length);
      d += length;
    }
    return sum;
  }

  double block(double origin, double sign, double first, double length) const {
    if (length < 4.0) {
      double sum = 0.0;
      for (double d = first; d < first + length; d += 1.0) sum += f_(origin + sign * d);
      return sum;
    }
    const double centre = first + 0.5 * (length - 1.0);
    const double second_moment = length * (length * length - 1.0) / 12.0;
    const double offset = std::sqrt((3.0 * length * length - 7.0) / 20.0);
    const double side = 0.5 * second_moment / (offset * offset);
    return side * (f_(origin + sign * (centre - offset)) + f_(origin + sign * (centre + offset))) +
           (length - 2.0 * side) * f_(origin + sign * centre);
  }

  const F& f_;
  double exact_;
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
  return sum;
}

/// Quantization is a difference of uniform numbers, whose fourth cumulant narrows the wavelet variance's
/// spread by kappa q2^2 sum_i A_j(i) A_k(i) / (M_j M_k), A_j(i) the summed squared weights of number i at
/// level j.
double uniform_correction(double q2, const WaveletVariance& wv, const WvLevel& j, const WvLevel& k) {
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
  for (const Segment& s : wv.segments) sum += overlap_of_run(static_cast<double>(s.end - s.begin));
  const auto count_j = static_cast<double>(j.n_coefficients);
  const auto count_k = static_cast<double>(k.n_coefficients);
  if (wv.segments.empty()) sum = overlap_of_run(std::min(count_j + 2.0 * n_j, count_k + 2.0 * n_k) - 1.0);
  const double scale = 1.0 / (16.0 * n_j * n_j * n_k * n_k);
  return kExcessKurtosis * q2 * q2 * scale * sum / (count_j * count_k);
}

double covariance_of_pair(const Parts& parts, const WaveletVariance& wv, const WvLevel& j, const WvLevel& k) {
  const double n_j = 0.5 * j.tau_samples;
  const double n_k = 0.5 * k.tau_samples;
  const CrossCovariance c(parts, n_j, n_k);
  const PairCounts pairs(wv, j, k);
  const double means = 4.0 * (0.5 * parts.ramp * n_j) * (0.5 * parts.ramp * n_k);
  const auto term = [&](double h) {
    const double n = pairs(h);
    if (n <= 0.0) return 0.0;
    const double value = c(h);
    return n * value * (2.0 * value + means);
  };
  std::vector<double> breaks;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) breaks.push_back(b * n_k - a * n_j);
  }
  std::sort(breaks.begin(), breaks.end());
  breaks.erase(std::unique(breaks.begin(), breaks.end()), breaks.end());
  // Beyond the overlap of the supports only exponentials reach, and none further than this many time
  // constants.
  constexpr double kTimeConstants = 18.0;
  double reach = 0.0;
  bool alternating = false;
  for (const Exponential& e : parts.exponentials) {
    const double a = e.a > 0.0 ? e.a : -std::log(std::abs(e.phi));
    reach = std::max(reach, kTimeConstants / a);
    alternating = alternating || e.a < 0.0;
  }
  const double low = std::max(pairs.lowest(), breaks.front() - std::ceil(reach));
  const double high = std::min(pairs.highest(), breaks.back() + std::ceil(reach));
  constexpr int kExactNear = 5;
  constexpr int kExactNearAlternating = 64;
  const LagSum sum(term, alternating ? kExactNearAlternating : kExactNear);
  const double count_j = static_cast<double>(j.n_coefficients);
  const double count_k = static_cast<double>(k.n_coefficients);
  double result = sum.between(breaks, low, high) / (count_j * count_k);
  if (parts.uniform > 0.0) result += uniform_correction(parts.uniform, wv, j, k);
  for (const Component& s : parts.sinusoids) {
    const double b = s.shape[0];
    result += 2.0 * s.amplitude * gain_at(b, n_j) * gain_at(b, n_k) * spectrum_at(parts, b) /
              std::max(count_j, count_k);
  }
  return result;
}

}  // namespace

double coefficient_covariance(const Model& model, int level_j, int level_k, double lag) {
  const Parts parts = parts_of(model);
  return CrossCovariance(parts, std::ldexp(1.0, level_j - 1), std::ldexp(1.0, level_k - 1))(lag);
}

Eigen::MatrixXd wv_covariance(const Model& model, const WaveletVariance& wv, std::size_t levels) {
  const Parts parts = parts_of(model);
  const auto size = static_cast<Eigen::Index>(levels);
  Eigen::MatrixXd v(size, size);
  for (std::size_t j = 0; j < levels; ++j) {
    for (std::size_t k = 0; k <= j; ++k) {
      const double value = covariance_of_pair(parts, wv, wv.levels[j], wv.levels[k]) / wv.efficiency;
      v(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(k)) = value;
      v(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j)) = value;
    }
  }
  return v;
}

}  // namespace imuscope::noise
