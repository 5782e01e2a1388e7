#include "models/noise/separable_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "base/contracts.h"

namespace imuscope::noise {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Grid points a coordinate by the number of coordinates; chosen so that every local minimum of three GM over
/// twenty octaves has a point in its basin. Models of more coordinates grow from smaller ones.
constexpr std::array<int, 6> kGridPoints{1, 200, 60, 32, 16, 10};
constexpr std::size_t kPolished = 8;

/// One searched coordinate: shape value `shape` of process `process` of the spec.
struct Coordinate {
  std::size_t process;
  int shape;
  ProcessKind kind;
  CoordinateRange range;
};

std::vector<Coordinate> coordinates_of(const SeparableProblem& problem) {
  std::vector<Coordinate> out;
  const int highest = problem.levels.back();
  for (std::size_t p = 0; p < problem.spec.processes.size(); ++p) {
    const ProcessKind kind = problem.spec.processes[p];
    for (int i = 0; i < shape_count(kind); ++i)
      out.push_back({p, i, kind, coordinate_range(kind, i, highest)});
  }
  return out;
}

/// A process's wavelet variance at every level, and its derivatives by its shape values.
struct Curve {
  RowVector value;
  std::array<RowVector, 2> slope;
};

Curve curve_of(const SeparableProblem& problem, ProcessKind kind, const Shape& shape) {
  Curve curve;
  const auto shapes = static_cast<std::size_t>(shape_count(kind));
  curve.value.resize(problem.y.size());
  for (std::size_t i = 0; i < shapes; ++i) curve.slope[i].resize(problem.y.size());
  std::array<CurvePoint, kMaxLevel> points;
  unit_curve(kind, shape, std::span(points).first(static_cast<std::size_t>(problem.levels.back())));
  for (Eigen::Index r = 0; r < curve.value.size(); ++r) {
    const CurvePoint& point =
        points[static_cast<std::size_t>(problem.levels[static_cast<std::size_t>(r)] - 1)];
    curve.value[r] = point.value;
    for (std::size_t i = 0; i < shapes; ++i) curve.slope[i][r] = point.derivative[i];
  }
  return curve;
}

/// Shapes of all processes at a point of the coordinates.
std::vector<Shape> shapes_at(const SeparableProblem& problem, const std::vector<Coordinate>& coordinates,
                             const ColumnVector& u) {
  std::vector<Shape> shapes(problem.spec.processes.size(), Shape{});
  for (std::size_t c = 0; c < coordinates.size(); ++c) {
    const Coordinate& k = coordinates[c];
    shapes[k.process][static_cast<std::size_t>(k.shape)] =
        shape_of_coordinate(k.kind, u[static_cast<Eigen::Index>(c)]);
  }
  return shapes;
}

/// G-12: the amplitudes and what remains at one point of the coordinates.
struct Evaluation {
  Design columns;          ///< whitened, of length 1
  ColumnVector length;     ///< of the whitened columns before
  ColumnVector amplitude;  ///< of the columns of length 1
  RowVector residual;
  double objective = 0.0;
  std::array<std::array<RowVector, 2>, kMaxColumns>
      slope;  ///< of each process by its shape values, not whitened
};

/// Whitened columns of the processes that have no shape: one of no size where it has.
std::vector<RowVector> fixed_columns(const SeparableProblem& problem) {
  std::vector<RowVector> columns;
  for (const ProcessKind kind : problem.spec.processes)
    columns.push_back(shape_count(kind) == 0
                          ? RowVector(problem.whitener * curve_of(problem, kind, Shape{}).value)
                          : RowVector());
  return columns;
}

/// @param fixed  those of fixed_columns()
Evaluation evaluate(const SeparableProblem& problem, const RowVector& target,
                    const std::vector<RowVector>& fixed, const std::vector<Shape>& shapes) {
  Evaluation e;
  const auto p = static_cast<Eigen::Index>(shapes.size());
  e.columns.resize(target.size(), p);
  e.length.resize(p);
  for (Eigen::Index i = 0; i < p; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (fixed[k].size() > 0) {
      e.columns.col(i) = fixed[k];
    } else {
      const Curve curve = curve_of(problem, problem.spec.processes[k], shapes[k]);
      e.slope[k] = curve.slope;
      e.columns.col(i) = problem.whitener * curve.value;
    }
    e.length[i] = e.columns.col(i).norm();
    e.columns.col(i) /= e.length[i];
  }
  e.amplitude = nnls(e.columns, target);
  e.residual = target - e.columns * e.amplitude;
  e.objective = e.residual.squaredNorm();
  return e;
}

/// Levenberg-Marquardt on the coordinates with the amplitudes projected out (Kaufman's Jacobian).
class Polisher {
 public:
  Polisher(const SeparableProblem& problem, const std::vector<Coordinate>& coordinates)
      : problem_(problem),
        coordinates_(coordinates),
        target_(problem.whitener * problem.y),
        fixed_(fixed_columns(problem)) {}

  Evaluation run(ColumnVector& u) const {
    constexpr int kMaxSteps = 200;
    constexpr double kRelativeStop = 1e-13;
    Evaluation now = at(u);
    double damping = 1e-3;
    int quiet = 0;
    for (int step = 0; step < kMaxSteps && u.size() > 0 && quiet < 3; ++step) {
      const Design jacobian = projected_jacobian(now, u);
      const Gram normal = jacobian.transpose() * jacobian;
      const ColumnVector gradient = jacobian.transpose() * now.residual;
      bool improved = false;
      while (damping < 1e12) {
        Gram damped = normal;
        for (Eigen::Index i = 0; i < u.size(); ++i) damped(i, i) += damping * normal(i, i) + 1e-300;
        const ColumnVector move = ColumnVector(damped.ldlt().solve(gradient)).cwiseMax(-2.0).cwiseMin(2.0);
        // Twice what the step can gain at most.
        if (gradient.dot(move) <= kRelativeStop * now.objective) break;
        ColumnVector next = u + move;
        clamp(next);
        const Evaluation trial = at(next);
        if (trial.objective < now.objective) {
          quiet = now.objective - trial.objective <= kRelativeStop * now.objective ? quiet + 1 : 0;
          u = next;
          now = trial;
          damping = std::max(damping * 0.1, 1e-12);
          improved = true;
          break;
        }
        damping *= 10.0;
      }
      if (!improved) break;
    }
    return now;
  }

 private:
  [[nodiscard]] Evaluation at(const ColumnVector& u) const {
    return evaluate(problem_, target_, fixed_, shapes_at(problem_, coordinates_, u));
  }

  void clamp(ColumnVector& u) const {
    for (std::size_t c = 0; c < coordinates_.size(); ++c) {
      double& v = u[static_cast<Eigen::Index>(c)];
      v = std::clamp(v, coordinates_[c].range.low, coordinates_[c].range.high);
    }
  }

  /// d(model)/du with the part that the active amplitudes can follow removed; zero columns where the
  /// amplitude is zero and where a coordinate presses against the end of its range.
  [[nodiscard]] Design projected_jacobian(const Evaluation& e, const ColumnVector& u) const {
    Design active(e.columns.rows(), e.columns.cols());
    Eigen::Index n_active = 0;
    for (Eigen::Index i = 0; i < e.columns.cols(); ++i) {
      if (e.amplitude[i] > 0.0) active.col(n_active++) = e.columns.col(i);
    }
    active.conservativeResize(e.columns.rows(), n_active);
    Design jacobian = Design::Zero(e.columns.rows(), u.size());
    if (n_active == 0) return jacobian;
    const Eigen::ColPivHouseholderQR<Design> qr(active);
    for (std::size_t c = 0; c < coordinates_.size(); ++c) {
      const Coordinate& k = coordinates_[c];
      const auto p = static_cast<Eigen::Index>(k.process);
      if (e.amplitude[p] <= 0.0) continue;
      const double v = u[static_cast<Eigen::Index>(c)];
      RowVector column = problem_.whitener * e.slope[k.process][static_cast<std::size_t>(k.shape)];
      column *= e.amplitude[p] / e.length[p] * shape_slope(k.kind, v);
      column -= active * ColumnVector(qr.solve(column));
      const double downhill = column.dot(e.residual);
      if ((v <= k.range.low && downhill < 0.0) || (v >= k.range.high && downhill > 0.0)) continue;
      jacobian.col(static_cast<Eigen::Index>(c)) = column;
    }
    return jacobian;
  }

  const SeparableProblem& problem_;
  const std::vector<Coordinate>& coordinates_;
  RowVector target_;
  std::vector<RowVector> fixed_;
};

/// The objective over the whole grid of coordinates.
class GridSearch {
 public:
  GridSearch(const SeparableProblem& problem, const std::vector<Coordinate>& coordinates)
      : problem_(problem), coordinates_(coordinates), target_(problem.whitener * problem.y) {
    IMUSCOPE_EXPECTS(coordinates.size() < kGridPoints.size());
    points_ = kGridPoints[coordinates.size()];
    total_ = 1;
    for (std::size_t c = 0; c < coordinates.size(); ++c) total_ *= static_cast<std::size_t>(points_);
    prepare_columns();
    objective_.assign(total_, kInfinity);
    for (std::size_t cell = 0; cell < total_; ++cell) {
      if (ordered(cell)) objective_[cell] = solve(cell);
    }
  }

  /// Coordinates of the best local minima, best first.
  [[nodiscard]] std::vector<ColumnVector> best(std::size_t count) const {
    std::vector<std::size_t> minima;
    for (std::size_t cell = 0; cell < total_; ++cell) {
      if (objective_[cell] < kInfinity && is_local_minimum(cell)) minima.push_back(cell);
    }
    std::sort(minima.begin(), minima.end(),
              [&](std::size_t a, std::size_t b) { return objective_[a] < objective_[b]; });
    if (minima.size() > count) minima.resize(count);
    std::vector<ColumnVector> out;
    for (const std::size_t cell : minima) {
      ColumnVector u(static_cast<Eigen::Index>(coordinates_.size()));
      for (std::size_t c = 0; c < coordinates_.size(); ++c)
        u[static_cast<Eigen::Index>(c)] = value(c, index(cell, c));
      out.push_back(u);
    }
    return out;
  }

 private:
  [[nodiscard]] double value(std::size_t c, int i) const {
    const CoordinateRange& r = coordinates_[c].range;
    return r.low + (r.high - r.low) * (static_cast<double>(i) + 0.5) / points_;
  }
  [[nodiscard]] std::size_t stride(std::size_t c) const {
    std::size_t s = 1;
    for (std::size_t k = 0; k < c; ++k) s *= static_cast<std::size_t>(points_);
    return s;
  }
  [[nodiscard]] int index(std::size_t cell, std::size_t c) const {
    return static_cast<int>(cell / stride(c) % static_cast<std::size_t>(points_));
  }

  /// Processes of one kind are interchangeable: only falling first coordinates are searched.
  [[nodiscard]] bool ordered(std::size_t cell) const {
    for (std::size_t c = 1; c < coordinates_.size(); ++c) {
      const Coordinate& before = coordinates_[c - 1];
      const Coordinate& here = coordinates_[c];
      if (here.kind != before.kind || here.process == before.process) continue;
      if (index(cell, c) >= index(cell, c - 1)) return false;
    }
    return true;
  }

  [[nodiscard]] bool is_local_minimum(std::size_t cell) const {
    for (std::size_t c = 0; c < coordinates_.size(); ++c) {
      const int i = index(cell, c);
      if (i > 0 && objective_[cell - stride(c)] < objective_[cell]) return false;
      if (i + 1 < points_ && objective_[cell + stride(c)] < objective_[cell]) return false;
    }
    return true;
  }

  /// Every column that any grid point needs, once: processes of one kind share theirs.
  void prepare_columns() {
    std::vector<RowVector> columns;
    for (std::size_t p = 0; p < problem_.spec.processes.size(); ++p) {
      const ProcessKind kind = problem_.spec.processes[p];
      std::vector<std::size_t> own;
      for (std::size_t c = 0; c < coordinates_.size(); ++c) {
        if (coordinates_[c].process == p) own.push_back(c);
      }
      own_.push_back(own);
      if (p > 0 && problem_.spec.processes[p - 1] == kind) {
        first_.push_back(first_.back());
        continue;
      }
      first_.push_back(columns.size());
      const int n0 = own.empty() ? 1 : points_;
      const int n1 = own.size() < 2 ? 1 : points_;
      for (int j = 0; j < n1; ++j) {
        for (int i = 0; i < n0; ++i) {
          Shape shape{};
          if (!own.empty()) shape[0] = shape_of_coordinate(kind, value(own[0], i));
          if (own.size() > 1) shape[1] = shape_of_coordinate(kind, value(own[1], j));
          columns.push_back(
              RowVector(problem_.whitener * curve_of(problem_, kind, shape).value).normalized());
        }
      }
    }
    Eigen::MatrixXd all(target_.size(), static_cast<Eigen::Index>(columns.size()));
    for (std::size_t i = 0; i < columns.size(); ++i) all.col(static_cast<Eigen::Index>(i)) = columns[i];
    products_.noalias() = all.transpose() * all;
    projected_ = all.transpose() * target_;
    target_square_ = target_.squaredNorm();
  }

  [[nodiscard]] double solve(std::size_t cell) const {
    const auto p = static_cast<Eigen::Index>(problem_.spec.processes.size());
    std::array<Eigen::Index, kMaxColumns> column{};
    for (std::size_t k = 0; k < static_cast<std::size_t>(p); ++k) {
      std::size_t at = first_[k];
      if (!own_[k].empty()) at += static_cast<std::size_t>(index(cell, own_[k][0]));
      if (own_[k].size() > 1) at += static_cast<std::size_t>(index(cell, own_[k][1]) * points_);
      column[k] = static_cast<Eigen::Index>(at);
    }
    Gram gram(p, p);
    ColumnVector projected(p);
    for (Eigen::Index i = 0; i < p; ++i) {
      projected[i] = projected_[column[static_cast<std::size_t>(i)]];
      for (Eigen::Index j = 0; j < p; ++j) {
        gram(i, j) = products_(column[static_cast<std::size_t>(i)], column[static_cast<std::size_t>(j)]);
      }
    }
    const ColumnVector x = nnls_from_gram(gram, projected);
    return target_square_ - 2.0 * projected.dot(x) + x.dot(gram * x);
  }

  const SeparableProblem& problem_;
  const std::vector<Coordinate>& coordinates_;
  RowVector target_;
  int points_ = 1;
  std::size_t total_ = 1;
  std::vector<std::size_t> first_;
  std::vector<std::vector<std::size_t>> own_;
  Eigen::MatrixXd products_;
  Eigen::VectorXd projected_;
  double target_square_ = 0.0;
  std::vector<double> objective_;
};

void order_components(Model& model) {
  std::stable_sort(model.components.begin(), model.components.end(),
                   [](const Component& a, const Component& b) {
                     return a.kind != b.kind ? a.kind < b.kind : a.shape[0] > b.shape[0];
                   });
}

SeparableSolution solution_of(const SeparableProblem& problem, const std::vector<Coordinate>& coordinates,
                              const ColumnVector& u, const Evaluation& e) {
  SeparableSolution s;
  s.objective = e.objective;
  const auto shapes = shapes_at(problem, coordinates, u);
  for (std::size_t p = 0; p < shapes.size(); ++p) {
    const auto i = static_cast<Eigen::Index>(p);
    s.model.components.push_back({problem.spec.processes[p], e.amplitude[i] / e.length[i], shapes[p]});
  }
  order_components(s.model);
  return s;
}

SeparableSolution best_of_grid(const SeparableProblem& problem, const std::vector<Coordinate>& coordinates) {
  const Polisher polisher(problem, coordinates);
  std::vector<ColumnVector> starts(1);
  if (!coordinates.empty()) starts = GridSearch(problem, coordinates).best(kPolished);
  Evaluation best;
  best.objective = kInfinity;
  ColumnVector best_u;
  for (ColumnVector& u : starts) {
    const Evaluation e = polisher.run(u);
    if (e.objective < best.objective) {
      best = e;
      best_u = u;
    }
  }
  return solution_of(problem, coordinates, best_u, best);
}

/// Shapes that lie between one below and one above this, whose coordinate is the inverse hyperbolic tangent.
std::optional<double> middle_of_bounded(ProcessKind kind) {
  if (kind == ProcessKind::kMa1 || kind == ProcessKind::kArma11) return 0.0;
  if (kind == ProcessKind::kPowerLaw) return 1.0;
  return std::nullopt;
}

/// The kind of which a smaller model has one less: the last repeated one, or, where the grid cannot hold the
/// model, the last that can be repeated.
std::optional<ProcessKind> removable_kind(const ModelSpec& spec, bool on_grid) {
  const int kept = on_grid ? 1 : 0;
  for (const ProcessKind kind :
       {ProcessKind::kResonance, ProcessKind::kGaussMarkov, ProcessKind::kSinusoid}) {
    if (spec.count(kind) > kept) return kind;
  }
  return std::nullopt;
}

/// Shapes of a further term from which the search for its own begins, the slowest first. ARMA11 begins as
/// white noise.
std::vector<Shape> tried_shapes(ProcessKind kind, int highest_level) {
  constexpr int kRates = 40;
  constexpr int kDampings = 5;
  if (shape_count(kind) == 0 || kind == ProcessKind::kArma11) return {Shape{}};
  const auto place = [&](int i, int k, int n) {
    const CoordinateRange range = coordinate_range(kind, i, highest_level);
    return shape_of_coordinate(kind, range.low + (range.high - range.low) * k / n);
  };
  std::vector<Shape> shapes;
  for (int k = 0; k <= kRates; ++k) {
    if (kind != ProcessKind::kResonance) {
      shapes.push_back({place(0, k, kRates), 0.0});
      continue;
    }
    for (int d = 0; d <= kDampings; ++d) shapes.push_back({place(0, d, kDampings), place(1, k, kRates)});
  }
  return shapes;
}

}  // namespace

double coordinate_of_shape(ProcessKind kind, double shape) noexcept {
  const auto middle = middle_of_bounded(kind);
  return middle ? std::atanh(shape - *middle) : std::log(shape);
}

double shape_of_coordinate(ProcessKind kind, double coordinate) noexcept {
  const auto middle = middle_of_bounded(kind);
  return middle ? *middle + std::tanh(coordinate) : std::exp(coordinate);
}

double shape_slope(ProcessKind kind, double coordinate) noexcept {
  const double shape = shape_of_coordinate(kind, coordinate);
  const auto middle = middle_of_bounded(kind);
  return middle ? 1.0 - (shape - *middle) * (shape - *middle) : shape;
}

CoordinateRange coordinate_range(ProcessKind kind, int i, int highest_level) noexcept {
  constexpr double kMaBound = 3.8;        // theta = 0.999
  constexpr double kArmaPhiBound = 5.3;   // phi = 0.99995
  constexpr double kFastestRate = 20.0;   // phi = 2e-9: white
  constexpr double kPowerLawBound = 1.5;  // exponents of 0.095 to 1.905
  // Of a resonance, radians a sample: below, it is a line; above, it has no peak; slower ones are drift.
  constexpr double kNarrowest = 0.02;
  constexpr double kWidest = 1.5;
  constexpr double kSlowestRinging = 0.05;
  constexpr double kSlowestShare = 0.01;  // of a over the longest tau: a random walk to within half a percent
  const double longest = std::ldexp(1.0, highest_level);
  switch (kind) {
    case ProcessKind::kMa1:
      return {-kMaBound, kMaBound};
    case ProcessKind::kArma11:
      return i == 0 ? CoordinateRange{-1.5, kArmaPhiBound} : CoordinateRange{-kMaBound, kMaBound};
    case ProcessKind::kSinusoid:
      return {std::log(std::numbers::pi / longest), std::log(0.999 * std::numbers::pi)};
    case ProcessKind::kResonance:
      return i == 0 ? CoordinateRange{std::log(kNarrowest), std::log(kWidest)}
                    : CoordinateRange{std::log(kSlowestRinging), std::log(0.999 * std::numbers::pi)};
    case ProcessKind::kPowerLaw:
      return {-kPowerLawBound, kPowerLawBound};
    default:
      return {std::log(kSlowestShare / longest), std::log(kFastestRate)};
  }
}

std::vector<Model> with_one_more(const SeparableProblem& problem, const Model& smaller, ProcessKind kind) {
  constexpr std::size_t kKept = 3;
  const auto with = [&](const Shape& shape) {
    Model model = smaller;
    model.components.push_back({kind, 0.0, shape});
    order_components(model);
    return model;
  };
  const std::vector<Shape> tried = tried_shapes(kind, problem.levels.back());
  if (tried.size() == 1) return {with(tried.front())};
  const RowVector target = problem.whitener * problem.y;
  struct Candidate {
    double objective;
    Model model;
  };
  std::vector<Candidate> candidates;
  const std::vector<RowVector> fixed = fixed_columns(problem);
  for (const Shape& shape : tried) {
    Model model = with(shape);
    std::vector<Shape> shapes;
    for (const Component& c : model.components) shapes.push_back(c.shape);
    candidates.push_back({evaluate(problem, target, fixed, shapes).objective, std::move(model)});
  }
  std::vector<Model> kept{candidates.front().model};
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.objective < b.objective; });
  for (std::size_t i = 0; i < kKept; ++i) kept.push_back(candidates[i].model);
  return kept;
}

SeparableSolution find_global_minimum(const SeparableProblem& problem) {
  const auto coordinates = coordinates_of(problem);
  // A resonance of two shapes makes the grid long and is sharply placed: it grows from the model without it.
  const bool on_grid =
      coordinates.size() < kGridPoints.size() && problem.spec.count(ProcessKind::kResonance) == 0;
  SeparableSolution found;
  found.objective = kInfinity;
  if (on_grid) found = best_of_grid(problem, coordinates);
  const auto kind = removable_kind(problem.spec, on_grid);
  if (!kind) return found;
  // Where the last GM has no support the surface has a kink that stops the polish short of the smaller
  // model's minimum; that minimum is a point of this model too.
  SeparableProblem smaller = problem;
  smaller.spec.processes.erase(
      std::find(smaller.spec.processes.begin(), smaller.spec.processes.end(), *kind));
  const SeparableSolution nested = find_global_minimum(smaller);
  for (const Model& start : with_one_more(problem, nested.model, *kind)) {
    SeparableSolution candidate = polish(problem, start);
    if (candidate.objective < found.objective) found = std::move(candidate);
  }
  return found;
}

SeparableSolution polish(const SeparableProblem& problem, const Model& start) {
  const auto coordinates = coordinates_of(problem);
  ColumnVector u(static_cast<Eigen::Index>(coordinates.size()));
  for (std::size_t c = 0; c < coordinates.size(); ++c) {
    const Coordinate& k = coordinates[c];
    const double shape = start.components.at(k.process).shape[static_cast<std::size_t>(k.shape)];
    u[static_cast<Eigen::Index>(c)] =
        std::clamp(coordinate_of_shape(k.kind, shape), k.range.low, k.range.high);
  }
  const Evaluation e = Polisher(problem, coordinates).run(u);
  return solution_of(problem, coordinates, u, e);
}

}  // namespace imuscope::noise
