#include "estimation/calibration/resting_noise.h"

#include <algorithm>
#include <cmath>

#include "base/contracts.h"
#include "base/units.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

/// What an update of a mounting is a mean over, so that it is the noise which matters there that is seen (C-15). An engine
/// stays outside.
constexpr double kPiece_s = 0.1;
/// Of a window, eight seconds: its 40 pairs, of three axes, show the noise's variance to an eighth.
constexpr std::size_t kPieces = 80;
constexpr double kSquares = 3.0 * kPieces / 2.0;
/// From so many pieces on it is asked whether they are white.
constexpr std::size_t kPiecesAtFirst = 40;
/// Of what is white, pieces a second apart differ by no more than neighbours do; of what moves, by many times as much.
constexpr double kWhite = 3.0;
/// Windows that are as quiet as those before differ by less than this, by chance; what is quieter tells more than all before.
constexpr double kAlike = 2.0;
/// Twice an MTx's, the noisiest that anyone takes for a reference: what shows more is shaken.
constexpr double kNoisiest_radps_per_sqrt_hz = 10.0 * kRadPerDeg / 60.0;
constexpr double kGap = 1.5;  ///< in sample periods

}  // namespace

RestingNoise::RestingNoise(double rate_hz)
    : rate_hz_(rate_hz),
      samples_per_piece_(
          std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(kPiece_s * rate_hz)))) {
  IMUSCOPE_EXPECTS(rate_hz > 0.0);
}

bool RestingNoise::add(const Vector3d& omega_radps, const Vector3d& f_mps2, double dt_s) noexcept {
  if (dt_s > kGap / rate_hz_) restart();
  gyro_.sum += omega_radps;
  accel_.sum += f_mps2;
  return ++samples_ == samples_per_piece_ && end_piece();
}

void RestingNoise::restart() noexcept {
  samples_ = pieces_ = 0;
  for (Triad* triad : {&gyro_, &accel_}) {
    triad->sum.setZero();
    triad->neighbours = triad->far_apart = triad->pairs = 0.0;
  }
}

// C-28
void RestingNoise::Triad::end_piece(std::size_t piece, double samples) noexcept {
  const Vector3d mean = sum / samples;
  sum.setZero();
  const double from_last = piece > 0 ? (mean - means[(piece - 1) % kFarApart]).squaredNorm() : 0.0;
  // As many of either kind.
  if (piece >= kFarApart) {
    neighbours += from_last;
    far_apart += (mean - means[piece % kFarApart]).squaredNorm();
  }
  if (piece % 2 == 1) pairs += from_last;
  means[piece % kFarApart] = mean;
}

// C-28: whether it rests
bool RestingNoise::Triad::is_white() const noexcept { return far_apart <= kWhite * neighbours; }

bool RestingNoise::end_piece() noexcept {
  samples_ = 0;
  for (Triad* triad : {&gyro_, &accel_}) triad->end_piece(pieces_, static_cast<double>(samples_per_piece_));
  ++pieces_;
  if (pieces_ >= kPiecesAtFirst && !(gyro_.is_white() && accel_.is_white())) restart();
  return pieces_ == kPieces && end_window();
}

// C-28
bool RestingNoise::end_window() noexcept {
  const std::array<Triad*, 2> triads = {&gyro_, &accel_};
  const bool first = quiet_windows_ == 0;
  const auto shakes = [](const Triad* triad) { return triad->pairs > kAlike * triad->quiet; };
  const bool counts =
      density(gyro_.pairs) < kNoisiest_radps_per_sqrt_hz && (first || std::ranges::none_of(triads, shakes));
  if (counts) {
    const auto is_quieter = [](const Triad* triad) { return triad->pairs < triad->quiet / kAlike; };
    quiet_windows_ = first || std::ranges::any_of(triads, is_quieter) ? 1 : quiet_windows_ + 1;
    const auto n = static_cast<double>(quiet_windows_);
    for (Triad* triad : triads) triad->quiet += (triad->pairs - triad->quiet) / n;
    seen_ = WhiteNoise{density(gyro_.quiet), density(accel_.quiet), std::sqrt(2.0 / (kSquares * n))};
  }
  restart();
  return counts;
}

double RestingNoise::density(double pairs) const noexcept {
  const double piece_s = static_cast<double>(samples_per_piece_) / rate_hz_;
  return std::sqrt(0.5 * piece_s * pairs / kSquares);
}

}  // namespace imuscope
