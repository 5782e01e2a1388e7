#include "models/noise/covariance_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "models/noise/covariance_corrections.h"
#include "models/noise/pair_counts.h"
#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

/// Processes of the table by number: these four, then Gauss-Markov ones of the grid. Flicker noise is one, as
/// the sum that stands for it (G-39) has one form: a dozen processes would be read for it each time.
constexpr int kWhite = 0;
constexpr int kWalk = 1;
constexpr int kQuantizationNumber = 2;
constexpr int kFlickerNumber = 3;
constexpr int kMarkov = 1000;  ///< plus the place on the grid, which may be negative

/// The grid of rates, on the logarithm: an eighth of the step of the sum that stands for a power law
/// (G-39), from its fastest rate on, so that the rates of that sum are places of the grid. A cubic between
/// four places is within 1e-4 there.
const double kGridStep = std::log(8.0) / 8.0;
constexpr double kGridOrigin = std::numbers::ln2;
/// Of a sample: faster processes are white.
constexpr double kWhiteAbove = 40.0;
/// Lags that are summed one by one about a break point; longer ringing is left to wv_covariance().
constexpr double kMostRinging = 512.0;
/// In the place of a process: the places themselves.
constexpr int kPlaces = -1'000'000;
/// Where the products of processes that do not ring are summed.
constexpr Lags kEveryPair{kExactNear, std::numeric_limits<double>::infinity()};

/// G-42: one process of amplitude 1.
Parts unit_process(int number) {
  Parts parts;
  if (number == kWhite) parts.white = 1.0;
  if (number == kWalk) parts.walk = 1.0;
  if (number == kQuantizationNumber) parts.quantization = 1.0;
  if (number == kFlickerNumber) return parts_of({{{ProcessKind::kFlicker, 1.0, {}}}});
  if (number > kFlickerNumber)
    parts.exponentials.push_back(
        exponential_of_rate(std::exp(kGridOrigin + (number - kMarkov) * kGridStep), 1.0));
  return parts;
}

/// A model as a sum over the processes of the table.
using Weights = std::map<int, double>;

/// G-42: a rate between those of the grid by the cubic through four of them.
void add_markov(Weights& weights, const Exponential& e) {
  if (e.a > kWhiteAbove) {
    weights[kWhite] += 2.0 * e.linear * e.variance;
    return;
  }
  const double at = (std::log(e.a) - kGridOrigin) / kGridStep;
  constexpr double kOnThePlace = 1e-9;
  const double nearest = std::round(at);
  if (std::abs(at - nearest) < kOnThePlace) {
    weights[kMarkov + static_cast<int>(nearest)] += e.variance;
    return;
  }
  const double below = std::floor(at);
  const double t = at - below;
  const std::array<double, 4> lagrange{-t * (t - 1.0) * (t - 2.0) / 6.0,
                                       (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
                                       -(t + 1.0) * t * (t - 2.0) / 2.0, (t + 1.0) * t * (t - 1.0) / 6.0};
  for (int i = 0; i < 4; ++i)
    weights[kMarkov + static_cast<int>(below) - 1 + i] += e.variance * lagrange[static_cast<std::size_t>(i)];
}

/// @param flicker  amplitude of flicker noise, which is no part of `parts`
Weights weights_of(const Parts& parts, double flicker) {
  Weights weights;
  if (flicker > 0.0) weights[kFlickerNumber] = flicker;
  if (parts.white != 0.0) weights[kWhite] += parts.white;
  if (parts.walk != 0.0) weights[kWalk] += parts.walk;
  if (parts.quantization != 0.0) weights[kQuantizationNumber] += parts.quantization;
  for (const Exponential& e : parts.exponentials) add_markov(weights, e);
  return weights;
}

bool is_held(const Parts& parts) {
  return std::ranges::all_of(parts.exponentials, [](const Exponential& e) { return e.a > 0.0; }) &&
         std::ranges::all_of(parts.oscillations,
                             [](const Oscillation& o) { return rings_for(o) <= kMostRinging; });
}

/// Least power of two that is not less.
double power_above(double value) { return std::exp2(std::ceil(std::log2(value))); }

/// Whether a resonance is white noise on this pair.
bool is_white(const Oscillation& o, const PairOfLevels& pair) { return pair.shorter() >= white_from(o); }

/// Which lags a model that rings asks for.
Lags lags_of(const std::vector<Oscillation>& oscillations) {
  Lags lags{kExactNear, 1.0};
  for (const Oscillation& o : oscillations) {
    lags.exact_near = std::max(lags.exact_near, power_above(rings_for(o)));
    lags.below = std::max(lags.below, power_above(white_from(o)));
  }
  return lags;
}

/// G-8: what a ramp makes of the covariance of two levels.
double of_means(double ramp, const PairOfLevels& pair) {
  return 4.0 * (0.5 * ramp * pair.n_j) * (0.5 * ramp * pair.n_k);
}

/// What is white on each pair alone: missing samples, resonances that are slow beside neither level.
Eigen::VectorXd white_of(const Parts& parts, const WaveletVariance& wv,
                         const std::vector<PairOfLevels>& pairs) {
  Eigen::VectorXd white(static_cast<Eigen::Index>(pairs.size()));
  for (Eigen::Index p = 0; p < white.size(); ++p) {
    const PairOfLevels& pair = pairs[static_cast<std::size_t>(p)];
    white[p] = white_of_missing(wv.levels[pair.j], wv.levels[pair.k]);
    for (const Oscillation& o : parts.oscillations) {
      if (is_white(o, pair)) white[p] += 2.0 * o.linear;
    }
  }
  return white;
}

}  // namespace

/// What a model needs of the table's sums, pair by pair.
struct CovarianceTable::Sums {
  struct OfProcess {
    double weight = 0.0;
    const Eigen::VectorXd* with_white = nullptr;
    const Eigen::VectorXd* mean = nullptr;                 ///< where the model has a ramp
    std::vector<const Eigen::VectorXd*> with_it_and_next;  ///< products with itself and those that follow
  };
  std::vector<OfProcess> processes;
  const Eigen::VectorXd* white_squares = nullptr;
  const Eigen::VectorXd* white_mean = nullptr;
};

CovarianceTable::CovarianceTable(const WaveletVariance& wv, std::size_t levels,
                                 std::shared_ptr<CovarianceMemory> memory)
    : record_(wv),
      levels_(levels),
      has_holes_(std::ranges::any_of(
          wv.levels, [&](const WvLevel& level) { return !places_of(wv, level).places.empty(); })),
      memory_(std::move(memory)),
      number_(memory_->next_table()) {}

CovarianceTable::~CovarianceTable() = default;

bool CovarianceTable::serves(const WaveletVariance& wv) { return wv.efficiency >= 1.0 && !wv.levels.empty(); }

bool CovarianceTable::fits(const WaveletVariance& wv, std::size_t levels) const {
  return levels == levels_ && serves(wv) && record_.segments == wv.segments &&
         std::equal(record_.levels.begin(), record_.levels.end(), wv.levels.begin(), wv.levels.end(),
                    [](const WvLevel& a, const WvLevel& b) {
                      return a.level == b.level && a.n_coefficients == b.n_coefficients &&
                             a.places == b.places;
                    });
}

std::shared_ptr<const CovariancePlaces> CovarianceTable::places(const Lags& lags) const {
  return memory_->get<CovariancePlaces>({number_, lags, kPlaces},
                                        [&] { return CovariancePlaces(record_, levels_, lags); });
}

std::shared_ptr<const Eigen::VectorXd> CovarianceTable::values(const Lags& lags, int process) const {
  return memory_->get<Eigen::VectorXd>({number_, lags, process},
                                       [&] { return places(lags)->values(unit_process(process)); });
}

const Eigen::VectorXd& CovarianceTable::product(int a, int b) const {
  const std::pair<int, int> key = std::minmax(a, b);
  const auto at = products_.find(key);
  if (at != products_.end()) return at->second;
  const auto of_a = values(kEveryPair, a);
  const auto of_b = values(kEveryPair, b);
  return products_.emplace(key, places(kEveryPair)->product(*of_a, *of_b)).first->second;
}

const Eigen::VectorXd& CovarianceTable::mean(int a) const {
  const auto at = means_.find(a);
  if (at != means_.end()) return at->second;
  return means_.emplace(a, places(kEveryPair)->mean(*values(kEveryPair, a))).first->second;
}

// G-42
CovarianceTable::Sums CovarianceTable::sums_of(const std::map<int, double>& weights, bool has_ramp) const {
  const std::lock_guard lock(mutex_);
  Sums out;
  for (auto a = weights.begin(); a != weights.end(); ++a) {
    Sums::OfProcess& process = out.processes.emplace_back();
    process.weight = a->second;
    process.with_white = &product(kWhite, a->first);
    if (has_ramp) process.mean = &mean(a->first);
    for (auto b = a; b != weights.end(); ++b)
      process.with_it_and_next.push_back(&product(a->first, b->first));
  }
  out.white_squares = &product(kWhite, kWhite);
  if (has_ramp) out.white_mean = &mean(kWhite);
  return out;
}

// G-42
Eigen::VectorXd CovarianceTable::from_products(const std::map<int, double>& weights, double ramp,
                                               const Eigen::VectorXd& white,
                                               const std::vector<PairOfLevels>& pairs) const {
  const Sums sums = sums_of(weights, ramp != 0.0);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(white.size());
  Eigen::VectorXd means = Eigen::VectorXd::Zero(white.size());
  Eigen::VectorXd with_white = Eigen::VectorXd::Zero(white.size());
  for (std::size_t a = 0; a < sums.processes.size(); ++a) {
    const Sums::OfProcess& process = sums.processes[a];
    squares += process.weight * process.weight * *process.with_it_and_next.front();
    for (std::size_t b = 1; b < process.with_it_and_next.size(); ++b)
      squares += 2.0 * process.weight * sums.processes[a + b].weight * *process.with_it_and_next[b];
    with_white += 2.0 * process.weight * *process.with_white;
    if (process.mean != nullptr) means += process.weight * *process.mean;
  }
  for (Eigen::Index p = 0; p < white.size(); ++p) {
    squares[p] += white[p] * with_white[p] + white[p] * white[p] * (*sums.white_squares)[p];
    if (sums.white_mean != nullptr)
      squares[p] +=
          of_means(ramp, pairs[static_cast<std::size_t>(p)]) * (means[p] + white[p] * (*sums.white_mean)[p]);
  }
  return squares;
}

// G-8, lag by lag
void CovarianceTable::sum_what_rings(const std::map<int, double>& weights, const Parts& parts,
                                     const Eigen::VectorXd& white, Eigen::VectorXd& squares) const {
  const Lags lags = lags_of(parts.oscillations);
  const auto where = places(lags);
  Eigen::VectorXd c(where->size());
  const auto of_pair = [&](std::size_t i) { return c.segment(where->begin(i), where->size(i)); };
  const auto number = [&](std::size_t i) { return static_cast<Eigen::Index>(where->numbers()[i]); };
  // Process by process, so that the values of no more than one have to be in memory.
  const auto of_white = values(lags, kWhite);
  for (std::size_t i = 0; i < where->pairs().size(); ++i)
    of_pair(i) = white[number(i)] * of_white->segment(where->begin(i), where->size(i));
  for (const auto& [process, weight] : weights) c += weight * *values(lags, process);
  for (std::size_t i = 0; i < where->pairs().size(); ++i) {
    const PairOfLevels& pair = where->pairs()[i];
    bool rings = false;
    for (const Oscillation& o : parts.oscillations) {
      if (is_white(o, pair)) continue;
      where->add_oscillation(o, i, of_pair(i));
      rings = true;
    }
    if (!rings) continue;
    const auto w = where->weights().segment(where->begin(i), where->size(i));
    squares[number(i)] =
        2.0 * w.cwiseProduct(of_pair(i)).dot(of_pair(i)) + of_means(parts.ramp, pair) * w.dot(of_pair(i));
  }
}

Eigen::MatrixXd CovarianceTable::of(const Model& model, const WaveletVariance& wv) const {
  Model others;
  double flicker = 0.0;
  for (const Component& c : model.components) {
    if (c.kind == ProcessKind::kFlicker) flicker += c.amplitude;
    if (c.kind != ProcessKind::kFlicker) others.components.push_back(c);
  }
  const Parts parts = parts_of(others);
  if (!is_held(parts)) return wv_covariance(model, wv, levels_);
  const Weights weights = weights_of(parts, flicker);
  const auto where = places(kEveryPair);
  const Eigen::VectorXd white = white_of(parts, wv, where->pairs());
  Eigen::VectorXd squares = from_products(weights, parts.ramp, white, where->pairs());
  if (!parts.oscillations.empty()) sum_what_rings(weights, parts, white, squares);
  const auto size = static_cast<Eigen::Index>(levels_);
  Eigen::MatrixXd v(size, size);
  for (Eigen::Index p = 0; p < squares.size(); ++p) {
    const PairOfLevels& pair = where->pairs()[static_cast<std::size_t>(p)];
    const WvLevel& j = wv.levels[pair.j];
    const WvLevel& k = wv.levels[pair.k];
    // G-44, G-10
    double value = squares[p] + sinusoid_covariance(parts, j, k);
    if (parts.uniform > 0.0) value += uniform_correction(parts.uniform, wv.segments, j, k);
    v(static_cast<Eigen::Index>(pair.j), static_cast<Eigen::Index>(pair.k)) = value;
    v(static_cast<Eigen::Index>(pair.k), static_cast<Eigen::Index>(pair.j)) = value;
  }
  return has_holes_ ? bounded_below(v) : v;
}

std::shared_ptr<const CovarianceTable> CovarianceTables::of(const WaveletVariance& wv, std::size_t levels) {
  if (!CovarianceTable::serves(wv)) return nullptr;
  const std::lock_guard lock(mutex_);
  for (const auto& table : tables_) {
    if (table->fits(wv, levels)) return table;
  }
  tables_.push_back(std::make_shared<CovarianceTable>(wv, levels, memory_));
  return tables_.back();
}

}  // namespace imuscope::noise
