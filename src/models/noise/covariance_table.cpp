#include "models/noise/covariance_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "models/noise/covariance_corrections.h"
#include "models/noise/lag_sum.h"
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
/// Values that one set of nodes may hold of all processes.
constexpr std::size_t kMostHeld = 8'000'000;

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

/// exp(-z); nothing where it is lost.
Complex faded(Complex z) {
  constexpr double kNothing = 60.0;
  return z.real() < kNothing ? std::exp(-z) : 0.0;
}

}  // namespace

struct CovarianceTable::PairOfLevels {
  std::size_t j = 0;
  std::size_t k = 0;
  double n_j = 0.0;
  double n_k = 0.0;

  [[nodiscard]] double shorter() const { return std::min(n_j, n_k); }
};

/// Where the sums over lags of some pairs of levels are evaluated, with their weights, and the values of
/// processes there.
class CovarianceTable::Nodes {
 public:
  /// @param below  pairs whose shorter n is less; each lag up to `exact_near` from a break point counts
  Nodes(const WaveletVariance& record, std::size_t levels, double exact_near, double below) {
    std::vector<LevelPlaces> places;
    for (std::size_t j = 0; j < levels; ++j) places.push_back(places_of(record, record.levels[j]));
    std::size_t number = 0;
    for (std::size_t j = 0; j < levels; ++j) {
      for (std::size_t k = 0; k <= j; ++k, ++number) {
        const WvLevel& level_j = record.levels[j];
        const WvLevel& level_k = record.levels[k];
        const PairOfLevels pair{j, k, 0.5 * level_j.tau_samples, 0.5 * level_k.tau_samples};
        if (pair.shorter() >= below) continue;
        Collector collector(*this, pair, PairCounts(level_j, level_k, places[j], places[k]));
        first_.push_back(runs_.size());
        collector.collect(exact_near, static_cast<double>(level_j.n_coefficients) *
                                          static_cast<double>(level_k.n_coefficients));
        pairs_.push_back(pair);
        numbers_.push_back(number);
      }
    }
    first_.push_back(runs_.size());
  }

  [[nodiscard]] const std::vector<PairOfLevels>& pairs() const { return pairs_; }
  /// Of each pair among all pairs of levels.
  [[nodiscard]] const std::vector<std::size_t>& numbers() const { return numbers_; }

  /// Forgets the values of all processes where those of so many more would be too much memory.
  void make_room(std::size_t processes) {
    if ((values_.size() + processes) * x_.size() > kMostHeld) values_.clear();
  }

  /// G-9: C_jk(h) of a process at all nodes.
  std::shared_ptr<const Eigen::VectorXd> values(int process) {
    if (const auto at = values_.find(process); at != values_.end()) return at->second;
    Eigen::VectorXd out(static_cast<Eigen::Index>(x_.size()));
    const Parts parts = unit_process(process);
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      CrossCovariance c(parts, pairs_[p].n_j, pairs_[p].n_k);
      const double centre = pairs_[p].n_k - pairs_[p].n_j;
      for (std::size_t r = first_[p]; r < first_[p + 1]; ++r) {
        const Run& run = runs_[r];
        if (!run.is_break) c.enter(centre + run.p, centre + run.q);
        for (std::size_t i = run.begin; i < run.end; ++i)
          out[static_cast<Eigen::Index>(i)] = run.is_break ? c(centre + x_[i]) : c.inside(centre + x_[i]);
      }
    }
    return values_.emplace(process, std::make_shared<Eigen::VectorXd>(std::move(out))).first->second;
  }

  /// G-42: sum of weight 2 a b, pair by pair: K.
  Eigen::VectorXd product(int a, int b) {
    make_room(2);
    const auto of_a = values(a);
    const auto of_b = values(b);
    return over_pairs([&](Eigen::Index begin, Eigen::Index n) {
      return 2.0 *
             weights().segment(begin, n).cwiseProduct(of_a->segment(begin, n)).dot(of_b->segment(begin, n));
    });
  }

  /// Sum of weight a, pair by pair.
  Eigen::VectorXd mean(int a) {
    make_room(1);
    const auto of_a = values(a);
    return over_pairs([&](Eigen::Index begin, Eigen::Index n) {
      return weights().segment(begin, n).dot(of_a->segment(begin, n));
    });
  }

  [[nodiscard]] Eigen::Index begin(std::size_t pair) const {
    return static_cast<Eigen::Index>(runs_[first_[pair]].begin);
  }
  [[nodiscard]] Eigen::Index size(std::size_t pair) const {
    return static_cast<Eigen::Index>(runs_[first_[pair + 1] - 1].end) - begin(pair);
  }
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> weights() const {
    return {weight_.data(), static_cast<Eigen::Index>(weight_.size())};
  }

  /// G-37 in G-9: adds C_jk(h) of a resonance at the nodes of a pair. Lags that follow each other cost two products.
  void add_oscillation(const Oscillation& o, std::size_t pair, Eigen::VectorXd& values) const {
    const auto [j, k, n_j, n_k] = pairs_[pair];
    const double centre = n_k - n_j;
    const double scale = 1.0 / (4.0 * n_j * n_k);
    const Complex towards = std::exp(-o.rate);
    const Complex back = std::exp(o.rate);
    const auto first = static_cast<std::size_t>(begin(pair));
    Between between;
    for (std::size_t r = first_[pair]; r < first_[pair + 1]; ++r) {
      const Run& run = runs_[r];
      between = between_of(o, n_j, n_k, centre + run.p, centre + run.q);
      Complex left;
      Complex right;
      double last = std::numeric_limits<double>::quiet_NaN();
      for (std::size_t i = run.begin; i < run.end; ++i) {
        const double x = x_[i];
        if (x == last + 1.0) {
          left *= towards;
          right *= back;
        } else if (x == last - 1.0) {
          left *= back;
          right *= towards;
        } else {
          left = between.left * faded(o.rate * (x - run.p));
          right = std::isinf(run.q) ? 0.0 : between.right * faded(o.rate * (run.q - x));
        }
        last = x;
        values[static_cast<Eigen::Index>(i - first)] +=
            scale * (between.constant + between.slope * (x - run.p) - (left + right).real());
      }
    }
  }

 private:
  /// Nodes strictly between two break points, as distances from the centre, or one on a break point; of the
  /// latter p is the break point and q the next one.
  struct Run {
    double p = 0.0;
    double q = 0.0;
    bool is_break = false;
    std::size_t begin = 0;
    std::size_t end = 0;
  };

  /// C_jk between two break points: constant + slope d - Re(left e^{-s d} + right e^{-s (q - h)}).
  struct Between {
    double constant = 0.0;
    double slope = 0.0;
    Complex left;
    Complex right;
  };

  static Between between_of(const Oscillation& o, double n_j, double n_k, double p, double q) {
    Between out;
    const Complex variance = o.variance * o.gain;
    const bool is_last = std::isinf(q);
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        const double weight =
            kDifference[static_cast<std::size_t>(a)] * kDifference[static_cast<std::size_t>(b)];
        const double shift = a * n_j - b * n_k;
        const double at = p + shift;
        const double sign = at >= 0.0 ? 1.0 : -1.0;
        if (!is_last) {
          out.constant -= weight * sign * at * o.linear;
          out.slope -= weight * sign * o.linear;
        }
        if (sign > 0.0) {
          out.left += weight * variance * faded(o.rate * at);
        } else {
          out.right += weight * variance * faded(o.rate * -(q + shift));
        }
      }
    }
    return out;
  }

  /// Takes down where LagSum evaluates a pair.
  class Collector {
   public:
    Collector(Nodes& nodes, const PairOfLevels& pair, PairCounts counts)
        : nodes_(nodes),
          centre_(pair.n_k - pair.n_j),
          breaks_(breaks_of(pair.n_j, pair.n_k)),
          counts_(counts) {}

    void collect(double exact_near, double product_of_counts) {
      const std::size_t begin = nodes_.x_.size();
      const double high = std::max(counts_.highest() - centre_, centre_ - counts_.lowest());
      LagSum(*this, exact_near).between(breaks_, 0.0, high);
      for (std::size_t i = begin; i < nodes_.weight_.size(); ++i) nodes_.weight_[i] /= product_of_counts;
    }
    void enter(double p, double q) { run_of(p, q, false); }
    void add_inside(double x, double weight) { add(x, weight); }
    void add_at(double x) {
      const auto next = std::upper_bound(breaks_.begin(), breaks_.end(), x);
      run_of(x, next == breaks_.end() ? std::numeric_limits<double>::infinity() : *next, true);
      add(x, 1.0);
    }

   private:
    void run_of(double p, double q, bool is_break) {
      nodes_.runs_.push_back({p, q, is_break, nodes_.x_.size(), nodes_.x_.size()});
    }
    void add(double x, double weight) {
      const double pairs = counts_.at_distance(centre_, x);
      if (pairs == 0.0 && !nodes_.runs_.back().is_break) return;
      nodes_.x_.push_back(x);
      nodes_.weight_.push_back(weight * pairs);
      nodes_.runs_.back().end = nodes_.x_.size();
    }

    Nodes& nodes_;
    double centre_;
    std::vector<double> breaks_;
    PairCounts counts_;
  };

  template <typename F>
  Eigen::VectorXd over_pairs(F f) const {
    Eigen::VectorXd out(static_cast<Eigen::Index>(pairs_.size()));
    for (std::size_t p = 0; p < pairs_.size(); ++p) out[static_cast<Eigen::Index>(p)] = f(begin(p), size(p));
    return out;
  }

  std::vector<PairOfLevels> pairs_;
  std::vector<std::size_t> numbers_;
  std::vector<std::size_t> first_;  ///< run of each pair
  std::vector<Run> runs_;
  std::vector<double> x_;       ///< distances from the centre
  std::vector<double> weight_;  ///< with the pairs of coefficients there
  std::map<int, std::shared_ptr<const Eigen::VectorXd>> values_;
};

struct CovarianceTable::Sums {
  struct OfProcess {
    double weight = 0.0;
    const Eigen::VectorXd* with_white = nullptr;
    const Eigen::VectorXd* mean = nullptr;                 ///< where the model has a ramp
    std::shared_ptr<const Eigen::VectorXd> at_nodes;       ///< where it rings
    std::vector<const Eigen::VectorXd*> with_it_and_next;  ///< products with itself and those that follow
  };
  std::vector<OfProcess> processes;
  const Eigen::VectorXd* white_squares = nullptr;
  const Eigen::VectorXd* white_mean = nullptr;
  const Nodes* ringing = nullptr;
  std::shared_ptr<const Eigen::VectorXd> white_at_nodes;
};

CovarianceTable::CovarianceTable(const WaveletVariance& wv, std::size_t levels)
    : record_(wv),
      levels_(levels),
      nodes_(std::make_unique<Nodes>(wv, levels, kExactNear, std::numeric_limits<double>::infinity())) {}

CovarianceTable::~CovarianceTable() = default;

bool CovarianceTable::serves(const WaveletVariance& wv) {
  return wv.efficiency >= 1.0 && wv.segments.size() <= 1 && !wv.levels.empty() &&
         std::ranges::all_of(wv.levels, [](const WvLevel& level) { return level.places.empty(); });
}

bool CovarianceTable::fits(const WaveletVariance& wv, std::size_t levels) const {
  return levels == levels_ && serves(wv) &&
         std::equal(record_.levels.begin(), record_.levels.end(), wv.levels.begin(), wv.levels.end(),
                    [](const WvLevel& a, const WvLevel& b) {
                      return a.level == b.level && a.n_coefficients == b.n_coefficients;
                    });
}

const Eigen::VectorXd& CovarianceTable::product(int a, int b) const {
  const std::pair<int, int> key = std::minmax(a, b);
  const auto at = products_.find(key);
  return at != products_.end() ? at->second : products_.emplace(key, nodes_->product(a, b)).first->second;
}

const Eigen::VectorXd& CovarianceTable::mean(int a) const {
  const auto at = means_.find(a);
  return at != means_.end() ? at->second : means_.emplace(a, nodes_->mean(a)).first->second;
}

CovarianceTable::Nodes& CovarianceTable::ringing(const Parts& parts) const {
  double exact = kExactNear;
  double below = 1.0;
  for (const Oscillation& o : parts.oscillations) {
    exact = std::max(exact, power_above(rings_for(o)));
    below = std::max(below, power_above(white_from(o)));
  }
  std::unique_ptr<Nodes>& nodes = ringing_[{static_cast<int>(exact), static_cast<int>(below)}];
  if (!nodes) nodes = std::make_unique<Nodes>(record_, levels_, exact, below);
  return *nodes;
}

CovarianceTable::Sums CovarianceTable::sums_of(const Weights& weights, const Parts& parts) const {
  const std::lock_guard lock(mutex_);
  Nodes* nodes = parts.oscillations.empty() ? nullptr : &ringing(parts);
  if (nodes != nullptr) nodes->make_room(weights.size() + 1);
  Sums out;
  out.ringing = nodes;
  for (auto a = weights.begin(); a != weights.end(); ++a) {
    Sums::OfProcess& process = out.processes.emplace_back();
    process.weight = a->second;
    process.with_white = &product(kWhite, a->first);
    if (parts.ramp != 0.0) process.mean = &mean(a->first);
    if (nodes != nullptr) process.at_nodes = nodes->values(a->first);
    for (auto b = a; b != weights.end(); ++b)
      process.with_it_and_next.push_back(&product(a->first, b->first));
  }
  out.white_squares = &product(kWhite, kWhite);
  if (parts.ramp != 0.0) out.white_mean = &mean(kWhite);
  if (nodes != nullptr) out.white_at_nodes = nodes->values(kWhite);
  return out;
}

// G-42
Eigen::MatrixXd CovarianceTable::of(const Model& model, const WaveletVariance& wv) const {
  Model others;
  double flicker = 0.0;
  for (const Component& c : model.components) {
    if (c.kind == ProcessKind::kFlicker) flicker += c.amplitude;
    if (c.kind != ProcessKind::kFlicker) others.components.push_back(c);
  }
  const Parts parts = parts_of(others);
  if (!is_held(parts)) return wv_covariance(model, wv, levels_);
  const Sums sums = sums_of(weights_of(parts, flicker), parts);
  const auto& pairs = nodes_->pairs();
  const auto count = static_cast<Eigen::Index>(pairs.size());
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd means = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd with_white = Eigen::VectorXd::Zero(count);
  for (std::size_t a = 0; a < sums.processes.size(); ++a) {
    const Sums::OfProcess& process = sums.processes[a];
    squares += process.weight * process.weight * *process.with_it_and_next.front();
    for (std::size_t b = 1; b < process.with_it_and_next.size(); ++b)
      squares += 2.0 * process.weight * sums.processes[a + b].weight * *process.with_it_and_next[b];
    with_white += 2.0 * process.weight * *process.with_white;
    if (process.mean != nullptr) means += process.weight * *process.mean;
  }
  const auto of_means = [&](const PairOfLevels& pair) {
    return 4.0 * (0.5 * parts.ramp * pair.n_j) * (0.5 * parts.ramp * pair.n_k);
  };
  std::vector<double> white_at;  // of each resonance, the n from which it is
  for (const Oscillation& o : parts.oscillations) white_at.push_back(white_from(o));
  // What is white on this pair alone: missing samples, resonances that are slow beside neither level.
  Eigen::VectorXd white(count);
  for (Eigen::Index p = 0; p < count; ++p) {
    const PairOfLevels& pair = pairs[static_cast<std::size_t>(p)];
    white[p] = white_of_missing(wv.levels[pair.j], wv.levels[pair.k]);
    for (std::size_t o = 0; o < white_at.size(); ++o) {
      if (pair.shorter() >= white_at[o]) white[p] += 2.0 * parts.oscillations[o].linear;
    }
    squares[p] += white[p] * with_white[p] + white[p] * white[p] * (*sums.white_squares)[p];
    if (sums.white_mean != nullptr)
      squares[p] += of_means(pair) * (means[p] + white[p] * (*sums.white_mean)[p]);
  }
  for (std::size_t i = 0; sums.ringing != nullptr && i < sums.ringing->pairs().size(); ++i) {
    const Nodes& nodes = *sums.ringing;
    const PairOfLevels& pair = nodes.pairs()[i];
    const auto p = static_cast<Eigen::Index>(nodes.numbers()[i]);
    if (std::ranges::all_of(white_at, [&](double at) { return pair.shorter() >= at; })) continue;
    Eigen::VectorXd c = white[p] * sums.white_at_nodes->segment(nodes.begin(i), nodes.size(i));
    for (const Sums::OfProcess& process : sums.processes)
      c += process.weight * process.at_nodes->segment(nodes.begin(i), nodes.size(i));
    for (std::size_t o = 0; o < white_at.size(); ++o) {
      if (pair.shorter() < white_at[o]) nodes.add_oscillation(parts.oscillations[o], i, c);
    }
    const auto w = nodes.weights().segment(nodes.begin(i), nodes.size(i));
    // G-8, lag by lag
    squares[p] = 2.0 * w.cwiseProduct(c).dot(c) + of_means(pair) * w.dot(c);
  }
  const auto size = static_cast<Eigen::Index>(levels_);
  Eigen::MatrixXd v(size, size);
  for (Eigen::Index p = 0; p < count; ++p) {
    const PairOfLevels& pair = pairs[static_cast<std::size_t>(p)];
    const WvLevel& j = wv.levels[pair.j];
    const WvLevel& k = wv.levels[pair.k];
    // G-44, G-10
    double value = squares[p] + sinusoid_covariance(parts, j, k);
    if (parts.uniform > 0.0) value += uniform_correction(parts.uniform, wv.segments, j, k);
    v(static_cast<Eigen::Index>(pair.j), static_cast<Eigen::Index>(pair.k)) = value;
    v(static_cast<Eigen::Index>(pair.k), static_cast<Eigen::Index>(pair.j)) = value;
  }
  return v;
}

std::shared_ptr<const CovarianceTable> CovarianceTables::of(const WaveletVariance& wv, std::size_t levels) {
  if (!CovarianceTable::serves(wv)) return nullptr;
  const std::lock_guard lock(mutex_);
  for (const auto& table : tables_) {
    if (table->fits(wv, levels)) return table;
  }
  tables_.push_back(std::make_shared<CovarianceTable>(wv, levels));
  return tables_.back();
}

}  // namespace imuscope::noise
