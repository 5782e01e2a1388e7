#include "estimation/regimes/standstills.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace imuscope {

namespace {

/// Cells to either side of one over which its spread is looked at: half a second in all.
constexpr std::ptrdiff_t kSpreadHalf = 2;
/// Cells next to an edge whose mean is the level of the stop: two seconds, in which nobody gets out.
constexpr std::size_t kLevelCells = 20;
/// The shortest stop inside a run: a second less what the cells at its two ends may lose.
constexpr std::size_t kShortestCells = 8;
/// Factor on the limits of rate, force and vibration where a speed says that the vehicle stands.
constexpr double kShaking = 6.0;
/// Before a start nothing but the start moves a vehicle, while after braking its body swings on the springs:
/// so at the end of a stop the limits are closer.
constexpr double kStarting = 2.0;
/// A speed counts as motion only where it exceeds so many of its own standard deviations.
constexpr double kSpeedSds = 4.0;
/// The share of the cells that is taken to be at rest when the reference's own noise is learned.
constexpr double kQuietShare = 0.1;
/// Rms of white noise in a spread (five cells of three axes) and in one cell (three axes), in its own sd,
/// that one in a thousand exceeds: sqrt(chi2(0.999) / degrees of freedom).
constexpr double kNoiseInSpread = 1.59;
constexpr double kNoiseInCell = 2.33;

/// At an edge the speed of rest is lower: this share of the limit, or so many standard deviations. One cell
/// that noise takes away costs a tenth of a second there, where inside it would cost the stop.
constexpr double kEdgeShare = 1.0 / 3.0;
constexpr double kEdgeSpeedSds = 2.5;

double lower_tenth(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(kQuietShare * static_cast<double>(values.size()));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double squared_distance(const Vector3& a, const Vector3& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

double distance(const Vector3& a, const Vector3& b) { return std::sqrt(squared_distance(a, b)); }

/// Mean over the known cells of [first, last); absent without any.
std::optional<Vector3> mean_of(const std::vector<MotionCell>& cells, Vector3 MotionCell::*what,
                               std::size_t first, std::size_t last) {
  Vector3 sum{};
  int n = 0;
  for (std::size_t i = first; i < last; ++i) {
    if (cells[i].n == 0) continue;
    ++n;
    for (std::size_t k = 0; k < 3; ++k) sum[k] += (cells[i].*what)[k];
  }
  if (n == 0) return std::nullopt;
  for (double& axis : sum) axis /= n;
  return sum;
}

/// Rms distance of the means of the cells around cell `i` from their own mean.
double spread_at(const std::vector<MotionCell>& cells, Vector3 MotionCell::*what, std::size_t i) {
  const auto at = static_cast<std::ptrdiff_t>(i);
  const auto first = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, at - kSpreadHalf));
  const auto last = std::min(cells.size(), i + static_cast<std::size_t>(kSpreadHalf) + 1);
  const auto mean = mean_of(cells, what, first, last);
  if (!mean) return 0.0;
  double squares = 0.0;
  int n = 0;
  for (std::size_t j = first; j < last; ++j) {
    if (cells[j].n == 0) continue;
    ++n;
    squares += squared_distance(cells[j].*what, *mean);
  }
  // Of n cells about their own mean n - 1 are free.
  return n > 1 ? std::sqrt(squares / (n - 1)) : 0.0;
}

class Judge {
 public:
  Judge(const std::vector<MotionCell>& cells, const MotionLimits& limits, const CellNoise& noise)
      : cells_(cells), limits_(limits), noise_(noise) {}

  /// Around one cell, of rate and of force.
  struct Spread {
    double omega_radps;
    double f_mps2;
  };
  [[nodiscard]] Spread spread(std::size_t i) const {
    return {spread_at(cells_, &MotionCell::omega_radps, i), spread_at(cells_, &MotionCell::f_mps2, i)};
  }
  /// Still in all measures together: their squares, each against its limit for rest, sum to less than one.
  [[nodiscard]] bool rests(const MotionCell& cell, const Spread& spread) const {
    const double room = room_of(cell);
    const double rate = spread.omega_radps / std::hypot(room * limits_.rest_rate_spread_radps,
                                                        kNoiseInSpread * noise_.omega_radps);
    const double force =
        spread.f_mps2 / std::hypot(room * limits_.rest_force_spread_mps2, kNoiseInSpread * noise_.f_mps2);
    const double vibration = cell.vibration_mps2 / (room * limits_.rest_vibration_mps2);
    return is_slow(cell) && rate * rate + force * force + vibration * vibration < 1.0;
  }
  /// Above one limit for motion.
  [[nodiscard]] bool moves(const MotionCell& cell, const Spread& spread) const {
    const double room = room_of(cell);
    return cell.speed_mps.value_or(0.0) > std::max(limits_.motion_speed_mps, kSpeedSds * cell.speed_sd_mps) ||
           cell.vibration_mps2 > room * limits_.motion_vibration_mps2 ||
           spread.omega_radps >
               std::hypot(room * limits_.motion_rate_spread_radps, kNoiseInSpread * noise_.omega_radps) ||
           spread.f_mps2 >
               std::hypot(room * limits_.motion_force_spread_mps2, kNoiseInSpread * noise_.f_mps2);
  }
  /// One cell by itself: as still as a stop with that level of rate and force.
  [[nodiscard]] bool keeps(std::size_t i, const Vector3& omega, const Vector3& f,
                           double most_room = kShaking) const {
    const MotionCell& cell = cells_[i];
    const double room = std::min(room_of(cell), most_room);
    const double speed_limit_mps =
        std::max(kEdgeShare * limits_.rest_speed_mps, kEdgeSpeedSds * cell.speed_sd_mps);
    return cell.n > 0 && cell.speed_mps.value_or(0.0) < speed_limit_mps &&
           cell.vibration_mps2 < room * limits_.rest_vibration_mps2 &&
           distance(cell.omega_radps, omega) <
               std::hypot(room * limits_.rest_rate_spread_radps, kNoiseInCell * noise_.omega_radps) &&
           distance(cell.f_mps2, f) <
               std::hypot(room * limits_.rest_force_spread_mps2, kNoiseInCell * noise_.f_mps2);
  }

 private:
  [[nodiscard]] double room_of(const MotionCell& cell) const {
    return cell.speed_mps && *cell.speed_mps < limits_.rest_speed_mps ? kShaking : 1.0;
  }
  [[nodiscard]] bool is_slow(const MotionCell& cell) const {
    return cell.speed_mps.value_or(0.0) < std::max(limits_.rest_speed_mps, kSpeedSds * cell.speed_sd_mps);
  }

  const std::vector<MotionCell>& cells_;
  const MotionLimits& limits_;
  const CellNoise& noise_;
};

/// From the first cell at rest on, until the last cell at rest before motion.
std::vector<Standstill> with_hysteresis(const std::vector<MotionCell>& cells, const Judge& judge) {
  std::vector<Standstill> found;
  bool stands = false;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (cells[i].n == 0) {
      continue;  // what surrounds it decides
    }
    const Judge::Spread spread = judge.spread(i);
    if (judge.rests(cells[i], spread)) {
      if (!stands) found.push_back({i, i + 1});
      found.back().last = i + 1;
      stands = true;
    } else if (judge.moves(cells[i], spread)) {
      stands = false;
    }
  }
  // A hole at the run's end goes on with the rest before it.
  if (stands) {
    std::size_t end = found.back().last;
    while (end < cells.size() && cells[end].n == 0) ++end;
    if (end == cells.size()) found.back().last = end;
  }
  return found;
}

/// Moves both edges of a stop to where rate and force leave the level next to that edge.
/// @param least, most  cells that the stop may reach
Standstill with_edges(const std::vector<MotionCell>& cells, const Judge& judge, Standstill stop,
                      std::size_t least, std::size_t most) {
  const auto level = [&](std::size_t first, std::size_t last) {
    return std::pair{mean_of(cells, &MotionCell::omega_radps, first, last),
                     mean_of(cells, &MotionCell::f_mps2, first, last)};
  };
  const auto [omega_first, f_first] = level(stop.first, std::min(stop.last, stop.first + kLevelCells));
  const auto [omega_last, f_last] =
      level(stop.last - std::min(stop.last - stop.first, kLevelCells), stop.last);
  if (!omega_first || !omega_last) return stop;
  while (stop.first < stop.last && cells[stop.first].n > 0 &&
         !judge.keeps(stop.first, *omega_first, *f_first))
    ++stop.first;
  while (stop.first < stop.last && cells[stop.last - 1].n > 0 &&
         !judge.keeps(stop.last - 1, *omega_last, *f_last, kStarting))
    --stop.last;
  if (stop.first == stop.last) return stop;
  while (stop.first > least && judge.keeps(stop.first - 1, *omega_first, *f_first)) --stop.first;
  while (stop.last < most && judge.keeps(stop.last, *omega_last, *f_last, kStarting)) ++stop.last;
  return stop;
}

}  // namespace

CellNoise cell_noise(const std::vector<MotionCell>& cells) {
  std::vector<double> omega;
  std::vector<double> f;
  for (const auto& cell : cells) {
    if (cell.n < 2) continue;
    const double root_n = std::sqrt(static_cast<double>(cell.n));
    omega.push_back(cell.rate_scatter_radps / root_n);
    f.push_back(cell.vibration_mps2 / root_n);
  }
  return {lower_tenth(std::move(omega)), lower_tenth(std::move(f))};
}

std::vector<Standstill> find_standstills(const std::vector<MotionCell>& cells, const MotionLimits& limits,
                                         const CellNoise& noise) {
  const Judge judge(cells, limits, noise);
  std::vector<Standstill> stops;
  const auto found = with_hysteresis(cells, judge);
  for (std::size_t k = 0; k < found.size(); ++k) {
    const std::size_t least = stops.empty() ? 0 : stops.back().last;
    const std::size_t most = k + 1 < found.size() ? found[k + 1].first : cells.size();
    const Standstill stop = with_edges(cells, judge, found[k], least, most);
    // The beginning and the end of the recording cut a stop short.
    const bool inside = stop.first > 0 && stop.last < cells.size();
    if (stop.first == stop.last || (inside && stop.last - stop.first < kShortestCells)) continue;
    stops.push_back(stop);
  }
  return stops;
}

}  // namespace imuscope
