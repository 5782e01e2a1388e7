#include "models/certificate/temperature.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <vector>

#include "models/noise/whitener.h"

namespace imuscope::certificate {
namespace {

/// Windows over which the variance of fast noise is held against the temperature.
constexpr std::size_t kWindows = 40;
constexpr std::size_t kLeastWindow = 500;

bool is_there(const PieceWithTemperature& piece, std::size_t i) {
  return (piece.mask.empty() || piece.mask[i] != 0) && std::isfinite(piece.x[i]) &&
         std::isfinite(piece.temperature_c[i]);
}

struct Range {
  double mean = 0.0;
  double lowest = 0.0;
  double highest = 0.0;
  std::size_t n = 0;        ///< samples that are there
  std::size_t samples = 0;  ///< all

  void add(const PieceWithTemperature& piece) {
    for (std::size_t i = 0; i < piece.x.size(); ++i) {
      if (!is_there(piece, i)) continue;
      const auto now = static_cast<double>(piece.temperature_c[i]);
      lowest = n == 0 ? now : std::min(lowest, now);
      highest = n == 0 ? now : std::max(highest, now);
      mean += (now - mean) / static_cast<double>(++n);
    }
    samples += piece.x.size();
  }
};

/// Least-squares line through (x, y) with the sd of its slope from the scatter; absent with fewer than three
/// places.
struct Slope {
  double value = 0.0;
  double sd = 0.0;
};

std::optional<Slope> slope_of(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  if (x.size() < 3) return std::nullopt;
  double mx = 0.0;
  double my = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mx += x[i] / n;
    my += y[i] / n;
  }
  double sxx = 0.0;
  double sxy = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    sxx += (x[i] - mx) * (x[i] - mx);
    sxy += (x[i] - mx) * (y[i] - my);
  }
  if (!(sxx > 0.0)) return std::nullopt;
  Slope slope{sxy / sxx, 0.0};
  double rest = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double r = y[i] - my - slope.value * (x[i] - mx);
    rest += r * r;
  }
  slope.sd = std::sqrt(rest / (n - 2.0) / sxx);
  return slope;
}

/// Bias by generalised least squares: both columns go through the noise's own whitening filter (T-2).
class BiasSlope {
 public:
  BiasSlope(const noise::Model& model, double mean_c) : whitener_(model, kColumns), mean_c_(mean_c) {}

  void add(const PieceWithTemperature& piece) {
    for (std::size_t i = 0; i < piece.x.size(); ++i) {
      if (!is_there(piece, i)) {
        whitener_.skip();
        continue;
      }
      std::array<double, kColumns> row{piece.x[i], 1.0,
                                       static_cast<double>(piece.temperature_c[i]) - mean_c_};
      if (!whitener_.push(row)) continue;
      const Eigen::Vector2d a(row[1], row[2]);
      normal_ += a * a.transpose();
      right_ += a * row[0];
    }
  }

  void tell(Temperature& out) const {
    const Eigen::LDLT<Eigen::Matrix2d> ldlt(normal_);
    const Eigen::Matrix2d covariance = ldlt.solve(Eigen::Matrix2d::Identity());
    out.bias_per_c = ldlt.solve(right_)[1];
    out.bias_per_c_sd = std::sqrt(std::max(0.0, covariance(1, 1)));
    if (out.bias_per_c_sd > 0.0) {
      const double z = std::abs(out.bias_per_c) / out.bias_per_c_sd;
      out.bias_p_value = 2.0 * boost::math::cdf(boost::math::complement(boost::math::normal(), z));
    }
  }

 private:
  static constexpr std::size_t kColumns = 3;  // signal, constant, temperature
  noise::Whitener whitener_;
  double mean_c_;
  Eigen::Matrix2d normal_ = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right_ = Eigen::Vector2d::Zero();
};

/// T-2: logarithm of the mean square of successive differences, window by window, on the windows' temperature.
class NoiseSlope {
 public:
  explicit NoiseSlope(std::size_t samples) : length_(samples / kWindows) {}

  void add(const PieceWithTemperature& piece) {
    if (length_ < kLeastWindow) return;
    for (std::size_t i = 0; i < piece.x.size(); ++i) {
      const std::optional<double> now = is_there(piece, i) ? std::optional(piece.x[i]) : std::nullopt;
      if (at_ % length_ != 0 && now && before_) {
        square_ += (*now - *before_) * (*now - *before_);
        sum_c_ += static_cast<double>(piece.temperature_c[i]);
        ++n_;
      }
      before_ = now;
      if (++at_ % length_ == 0) end_window();
    }
  }

  void tell(Temperature& out) const {
    const auto slope = slope_of(temperature_c_, log_variance_);
    if (!slope) return;
    out.noise_per_c = slope->value;
    out.noise_per_c_sd = slope->sd;
  }

 private:
  void end_window() {
    if (at_ <= kWindows * length_ && n_ >= kLeastWindow / 2 && square_ > 0.0) {
      temperature_c_.push_back(sum_c_ / static_cast<double>(n_));
      log_variance_.push_back(std::log(square_ / static_cast<double>(n_)));
    }
    square_ = sum_c_ = 0.0;
    n_ = 0;
  }

  std::size_t length_;
  std::size_t at_ = 0;
  std::optional<double> before_;
  double square_ = 0.0;  ///< of differences within the window
  double sum_c_ = 0.0;
  std::size_t n_ = 0;
  std::vector<double> temperature_c_;
  std::vector<double> log_variance_;
};

}  // namespace

Result<std::optional<Temperature>> temperature_of(const ReadWithTemperature& read,
                                                  const noise::FitResult& fit) {
  Range range;
  if (auto done = read([&](const PieceWithTemperature& piece) { range.add(piece); }); !done)
    return tl::unexpected(done.error());
  if (range.n == 0 || range.highest - range.lowest < kLeastRange_c) return std::nullopt;
  const auto& terms = fit.model.components;
  if (std::ranges::none_of(terms, [](const auto& term) { return term.amplitude > 0.0; })) return std::nullopt;
  Temperature out;
  out.mean_c = range.mean;
  out.lowest_c = range.lowest;
  out.highest_c = range.highest;
  BiasSlope bias(fit.model, out.mean_c);
  NoiseSlope noise(range.samples);
  const auto take = [&](const PieceWithTemperature& piece) {
    bias.add(piece);
    noise.add(piece);
  };
  if (auto done = read(take); !done) return tl::unexpected(done.error());
  bias.tell(out);
  noise.tell(out);
  return out;
}

std::optional<Temperature> temperature_of(std::span<const double> x, std::span<const std::uint8_t> mask,
                                          std::span<const float> temperature_c, const noise::FitResult& fit) {
  if (temperature_c.size() != x.size()) return std::nullopt;
  const PieceWithTemperature all{x, mask, temperature_c};
  const auto read = [&all](const std::function<void(const PieceWithTemperature&)>& take) -> Result<void> {
    take(all);
    return {};
  };
  return *temperature_of(read, fit);
}

}  // namespace imuscope::certificate
