#include "models/noise/select.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "models/noise/nested_fit.h"
#include "models/noise/replicates.h"
#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

/// Criteria closer than this are equal: exp(-2) in likelihood.
constexpr double kEquivalent = 4.0;

std::vector<ModelSpec> sub_models(const ModelSpec& full) {
  std::map<ProcessKind, int> counts;
  for (const ProcessKind kind : full.processes) ++counts[kind];
  std::vector<ModelSpec> models(1);
  for (const auto& [kind, most] : counts) {
    std::vector<ModelSpec> next;
    for (const ModelSpec& model : models) {
      for (int n = 0; n <= most; ++n) {
        ModelSpec with = model;
        with.processes.insert(with.processes.end(), static_cast<std::size_t>(n), kind);
        next.push_back(with);
      }
    }
    models = std::move(next);
  }
  std::erase_if(models, [](const ModelSpec& m) { return m.processes.empty(); });
  return models;
}

bool is_rejected(const FitResult& fit) { return fit.j_test && fit.j_test->p_value < kRejectedOutright; }

/// A model of which no term has an amplitude: nothing that a test could reject, and nothing that is compared.
bool is_without_noise(const FitResult& fit) {
  return std::ranges::none_of(fit.model.components, [](const Component& c) { return c.amplitude > 0.0; });
}

bool before(const RankedModel& a, const RankedModel& b) {
  if (is_without_noise(a.fit) || is_without_noise(b.fit)) return !is_without_noise(a.fit);
  if (is_rejected(a.fit) != is_rejected(b.fit)) return is_rejected(b.fit);
  if (a.fit.identifiable != b.fit.identifiable) return a.fit.identifiable;
  return a.criterion < b.criterion;
}

void apply_parsimony(std::vector<RankedModel>& ranked) {
  if (ranked.empty()) return;
  ranked.front().reason = "smallest criterion";
  std::size_t best = 0;
  for (std::size_t i = 1; i < ranked.size(); ++i) {
    const bool close = ranked[i].criterion - ranked.front().criterion < kEquivalent;
    if (ranked[i].fit.identifiable && ranked.front().fit.identifiable && close &&
        is_rejected(ranked[i].fit) == is_rejected(ranked.front().fit) &&
        ranked[i].fit.spec.parameter_count() < ranked[best].fit.spec.parameter_count()) {
      best = i;
    }
  }
  for (std::size_t i = 1; i < ranked.size(); ++i) {
    const RankedModel& first = ranked.front();
    ranked[i].reason =
        is_rejected(ranked[i].fit) && !is_rejected(first.fit)
            ? fmt::format("rejected: J-test p = {:.2g}", ranked[i].fit.j_test->p_value)
        : !ranked[i].fit.identifiable
            ? ranked[i].fit.warnings.empty() ? "not identifiable" : ranked[i].fit.warnings.front()
            : fmt::format("criterion larger by {:.3g}", ranked[i].criterion - first.criterion);
  }
  if (best > 0) {
    ranked[best].reason = fmt::format("as good as {} (criterion within {}) with fewer parameters",
                                      ranked.front().fit.spec.name(), kEquivalent);
    std::rotate(ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(best),
                ranked.begin() + static_cast<std::ptrdiff_t>(best) + 1);
  }
}

/// Grows and prunes one model.
class Grower {
 public:
  Grower(const WaveletVariance& wv, std::span<const ProcessKind> terms, double rate_hz,
         const FitOptions& options)
      : terms_(terms),
        rate_hz_(rate_hz),
        options_(options),
        wv_(wv),
        models_(wv, fitted_levels(wv, options), options.covariances, NestedFit::Starts::kKnownSubModels) {
    options_.intervals = Intervals::kQuick;
  }

  Result<GrownModel> run() {
    for (const ProcessKind kind : terms_) consider(ModelSpec{{kind}}, 0.0);
    if (!best_) return tl::unexpected(why_none_);
    // White noise and one more are what most sensors show, and no step of one term may lead there.
    for (const ProcessKind kind : terms_) {
      if (kind != ProcessKind::kWhiteNoise)
        consider(ModelSpec{{ProcessKind::kWhiteNoise, kind}}, kEquivalent);
    }
    // A model that cannot be right may grow by small steps.
    while (add_one(is_rejected(*best_) ? 0.0 : kEquivalent)) {
    }
    constexpr int kMostRounds = 20;
    for (int round = 0; round < kMostRounds; ++round) {
      while (drop_one()) {
      }
      if (!exchange_one() && !split_one() && !add_one(kEquivalent)) break;
    }
    return GrownModel{*best_, rivals()};
  }

 private:
  static constexpr int kMostAlike = 3;
  static constexpr std::size_t kMostRivals = 8;

  /// T-4: models that were tried and are as good as the best, or as likely, and rejected for their parameters
  /// alone. What contains the best is always as likely.
  [[nodiscard]] std::vector<FitResult> rivals() const {
    std::vector<FitResult> out;
    for (const auto& [name, tried] : tried_) {
      if (!tried || name == best_->spec.name() || is_rejected(*tried) != is_rejected(*best_)) continue;
      const bool is_as_likely =
          !contains(tried->spec, best_->spec) && misfit(*tried) < misfit(*best_) + kEquivalent;
      if (is_as_likely || tried->criterion < best_->criterion + kEquivalent) out.push_back(*tried);
    }
    std::stable_sort(out.begin(), out.end(),
                     [](const FitResult& a, const FitResult& b) { return misfit(a) < misfit(b); });
    if (out.size() > kMostRivals) out.resize(kMostRivals);
    return out;
  }

  /// The criterion with no more for a parameter than it takes off the deviance of a right model (G-16).
  static double misfit(const FitResult& fitted) {
    const double price = std::log(static_cast<double>(fitted.wv.size()));
    return fitted.criterion + (1.0 - price) * fitted.spec.parameter_count();
  }

  static bool contains(const ModelSpec& whole, const ModelSpec& part) {
    return std::ranges::all_of(part.processes,
                               [&](ProcessKind kind) { return whole.count(kind) >= part.count(kind); });
  }

  /// Takes the model where it is better than the best by `margin`.
  /// @param start  nothing: those of the search alone
  /// @param added  the kind that it has more than the best; fast or steep ones that get no amplitude are not
  /// tried again, but where the error of a rejected model may hide them
  bool consider(ModelSpec spec, double margin, std::optional<ProcessKind> added = std::nullopt,
                const Model* start = nullptr) {
    std::sort(spec.processes.begin(), spec.processes.end());
    if (start != nullptr && models_.improve(spec, *start)) tried_.erase(spec.name());
    const auto known = tried_.find(spec.name());
    auto fitted = known != tried_.end() ? known->second : fit(wv_, spec, rate_hz_, options_, models_);
    if (!fitted) {
      why_none_ = fitted.error();
      tried_.emplace(spec.name(), std::move(fitted));
      return false;
    }
    if (is_without_noise(*fitted)) {
      why_none_ = Error{ErrorKind::kWork, fmt::format("the record supports no {}", spec.name()), {}};
      tried_.emplace(spec.name(), std::move(fitted));
      return false;
    }
    if (added && is_fast_or_steep(*added) && !is_rejected(*fitted) &&
        std::any_of(fitted->model.components.begin(), fitted->model.components.end(),
                    [&](const Component& c) { return c.kind == *added && c.amplitude <= 0.0; }))
      unsupported_.insert(*added);
    tried_.emplace(fitted->spec.name(), fitted);
    const bool is_better = !best_ || (is_rejected(*fitted) != is_rejected(*best_)
                                          ? is_rejected(*best_)
                                          : fitted->criterion < best_->criterion - margin);
    if (is_better) best_ = std::move(*fitted);
    return is_better;
  }

  /// The best model without its component `out`, and with a term of each of `in` in its place, by the best
  /// model's weights, which needs no search; nothing where it stays so far from the data that no weights of
  /// its own could make it as likely. Most neighbours of a good model end here.
  std::optional<Model> neighbour(std::size_t out, std::span<const ProcessKind> in) {
    /// In squares of sds: what is so much further is rejected where the best is not, and errs twice as much
    /// where the best errs.
    constexpr double kFar = 50.0;
    const FixedPoint& now = models_.solve(best_->spec).point;
    SeparableProblem problem = unweighted_problem(wv_, best_->spec, models_.levels());
    problem.whitener = whitener_of(now.v);
    if (problem.whitener.size() == 0) return std::nullopt;
    const double far = (problem.whitener * residual_of(problem, now.model)).squaredNorm() + kFar;
    SeparableSolution found;
    found.model = now.model;
    found.model.components.erase(found.model.components.begin() + static_cast<std::ptrdiff_t>(out));
    problem.spec.processes.erase(problem.spec.processes.begin() + static_cast<std::ptrdiff_t>(out));
    if (!found.model.components.empty()) found = polish(problem, found.model);
    for (const ProcessKind kind : in) {
      problem.spec.processes.push_back(kind);
      std::sort(problem.spec.processes.begin(), problem.spec.processes.end());
      SeparableSolution grown;
      grown.objective = std::numeric_limits<double>::infinity();
      for (const Model& start : with_one_more(problem, found.model, kind)) {
        SeparableSolution candidate = polish(problem, start);
        if (candidate.objective < grown.objective) grown = std::move(candidate);
      }
      found = std::move(grown);
    }
    if (found.objective > far) return std::nullopt;
    return std::move(found.model);
  }

  /// White noise, quantization and a ramp stand at the ends of the scales: what is added later leaves even
  /// less to them.
  static bool is_fast_or_steep(ProcessKind kind) {
    return kind == ProcessKind::kWhiteNoise || kind == ProcessKind::kQuantization ||
           kind == ProcessKind::kRamp;
  }

  bool add_one(double margin) {
    const ModelSpec base = best_->spec;
    bool grown = false;
    for (const ProcessKind kind : terms_) {
      const int most = kind == ProcessKind::kGaussMarkov ? kMostAlike : 1;
      if (base.count(kind) >= most || unsupported_.contains(kind)) continue;
      ModelSpec more = base;
      more.processes.push_back(kind);
      grown = consider(std::move(more), grown ? 0.0 : margin, kind) || grown;
    }
    return grown;
  }

  bool drop_one() {
    const ModelSpec base = best_->spec;
    if (base.processes.size() < 2) return false;
    for (std::size_t i = 0; i < base.processes.size(); ++i) {
      ModelSpec less = base;
      less.processes.erase(less.processes.begin() + static_cast<std::ptrdiff_t>(i));
      const auto start = neighbour(i, {});
      if (!start) continue;
      const bool already_rejected = is_rejected(*best_);
      const double before = best_->criterion;
      const FitResult kept = *best_;
      if (consider(std::move(less), -kEquivalent, std::nullopt, &*start) &&
          is_rejected(*best_) == already_rejected && best_->criterion < before + kEquivalent)
        return true;
      best_ = kept;
    }
    return false;
  }

  /// Another process in the place of one, where the model is likelier by it with no more parameters.
  bool exchange_one() {
    const ModelSpec base = best_->spec;
    for (std::size_t i = 0; i < base.processes.size(); ++i) {
      for (const ProcessKind kind : terms_) {
        const bool alike =
            kind == base.processes[i] || (kind != ProcessKind::kGaussMarkov && base.count(kind) > 0);
        if (alike || base.count(kind) >= kMostAlike) continue;
        ModelSpec other = base;
        other.processes[i] = kind;
        const auto start = neighbour(i, std::array{kind});
        if (!start) continue;
        const double margin = other.parameter_count() > base.parameter_count() ? kEquivalent : 0.0;
        if (consider(std::move(other), margin, std::nullopt, &*start)) return true;
      }
    }
    return false;
  }

  /// Two in the place of one, where no step of one term leads from one to the other: over a few octaves
  /// flicker noise is like a Gauss-Markov process and one that is slower, and a fast Gauss-Markov process
  /// like white noise beneath a resonance.
  bool split_one() {
    using enum ProcessKind;
    static constexpr std::array<std::pair<ProcessKind, std::array<ProcessKind, 2>>, 3> kSplits{
        {{kFlicker, {kGaussMarkov, kRandomWalk}},
         {kFlicker, {kGaussMarkov, kGaussMarkov}},
         {kGaussMarkov, {kWhiteNoise, kResonance}}}};
    const ModelSpec base = best_->spec;
    for (const auto& [one, two] : kSplits) {
      for (std::size_t i = 0; i < base.processes.size(); ++i) {
        if (base.processes[i] != one) continue;
        ModelSpec other = base;
        other.processes.erase(other.processes.begin() + static_cast<std::ptrdiff_t>(i));
        other.processes.insert(other.processes.end(), two.begin(), two.end());
        if (!may_hold(other)) continue;
        const auto start = neighbour(i, two);
        // As when it grows.
        const double margin = is_rejected(*best_) ? 0.0 : kEquivalent;
        if (start && consider(std::move(other), margin, std::nullopt, &*start)) return true;
      }
    }
    return false;
  }

  /// Whether there may be a term of each kind as often as in the model.
  [[nodiscard]] bool may_hold(const ModelSpec& spec) const {
    return std::ranges::all_of(spec.processes, [&](ProcessKind kind) {
      return spec.count(kind) <= (kind == ProcessKind::kGaussMarkov ? kMostAlike : 1) &&
             std::find(terms_.begin(), terms_.end(), kind) != terms_.end();
    });
  }

  std::span<const ProcessKind> terms_;
  double rate_hz_;
  FitOptions options_;
  const WaveletVariance& wv_;
  NestedFit models_;
  std::set<ProcessKind> unsupported_;
  std::map<std::string, Result<FitResult>> tried_;
  std::optional<FitResult> best_;
  Error why_none_;
};

/// One replicate and the pool of the others.
class LeftOut {
 public:
  LeftOut(WaveletVariance others_pooled, const WaveletVariance& own, const Eigen::MatrixXd& v)
      : others(std::move(others_pooled)), llt_(v) {
    for (Eigen::Index i = 0; i < v.rows(); ++i) own_.push_back(own.levels[static_cast<std::size_t>(i)]);
  }

  [[nodiscard]] bool valid() const { return !own_.empty() && llt_.info() == Eigen::Success; }
  [[nodiscard]] double distance(const Model& model) const {
    Eigen::VectorXd residual(static_cast<Eigen::Index>(own_.size()));
    for (std::size_t i = 0; i < own_.size(); ++i) {
      residual[static_cast<Eigen::Index>(i)] = own_[i].value - model_wv(model, own_[i].level);
    }
    return llt_.matrixL().solve(residual).squaredNorm();
  }

  WaveletVariance others;

 private:
  std::vector<WvLevel> own_;
  Eigen::LLT<Eigen::MatrixXd> llt_;
};

Result<std::vector<LeftOut>> leave_one_out(std::span<const WaveletVariance> replicates,
                                           const Model& reference) {
  std::vector<LeftOut> out;
  for (std::size_t k = 0; k < replicates.size(); ++k) {
    std::vector<WaveletVariance> others(replicates.begin(), replicates.end());
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const auto levels = static_cast<std::size_t>(std::count_if(
        replicates[k].levels.begin(), replicates[k].levels.end(),
        [&](const WvLevel& level) { return has_enough_coefficients(level, replicates[k].efficiency); }));
    out.emplace_back(pool(others), replicates[k], wv_covariance(reference, replicates[k], levels));
    if (!out.back().valid())
      return work_error(fmt::format("replicate {} is too short to be predicted", k + 1),
                        "leave it out, or give a longer record in its place");
  }
  return out;
}

void set_differences(std::vector<CrossValidated>& ranked, const std::vector<Eigen::VectorXd>& scores) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < ranked.size(); ++i) {
    if (ranked[i].score < ranked[best].score) best = i;
  }
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    const Eigen::VectorXd d = scores[i] - scores[best];
    const auto n = static_cast<double>(d.size());
    ranked[i].worse_by = d.mean();
    ranked[i].worse_by_sd = std::sqrt((d.array() - d.mean()).square().sum() / (n - 1.0) / n);
  }
}

void order_by_parsimony(std::vector<CrossValidated>& ranked) {
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const CrossValidated& a, const CrossValidated& b) { return a.score < b.score; });
  std::size_t simplest = 0;
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    CrossValidated& m = ranked[i];
    const bool equivalent = i == 0 || m.worse_by <= m.worse_by_sd;
    m.reason = i == 0 ? "predicts a replicate left out best"
                      : fmt::format("{} {:.3g} (sd {:.2g})", equivalent ? "equivalent: worse by" : "worse by",
                                    m.worse_by, m.worse_by_sd);
    if (!m.pooled.identifiable) {
      m.reason += ", not identifiable";
      continue;
    }
    const auto& chosen = ranked[simplest].pooled;
    if (equivalent &&
        (!chosen.identifiable || m.pooled.spec.parameter_count() < chosen.spec.parameter_count()))
      simplest = i;
  }
  if (simplest == 0) return;
  const auto& best = ranked.front().pooled;
  const bool is_simpler = ranked[simplest].pooled.spec.parameter_count() < best.spec.parameter_count();
  ranked[simplest].reason +=
      fmt::format(", and {} {}", is_simpler ? "simpler than" : "identifiable, unlike", best.spec.name());
  const auto at = ranked.begin() + static_cast<std::ptrdiff_t>(simplest);
  std::rotate(ranked.begin(), at, at + 1);
}

}  // namespace

Result<std::vector<RankedModel>> rank_models(const WaveletVariance& wv, const ModelSpec& full, double rate_hz,
                                             const FitOptions& options) {
  std::vector<RankedModel> ranked;
  NestedFit models(wv, fitted_levels(wv, options), options.covariances);
  for (const ModelSpec& spec : sub_models(full)) {
    auto fitted = fit(wv, spec, rate_hz, options, models);
    if (!fitted) return tl::unexpected(fitted.error());
    RankedModel model;
    model.criterion = fitted->criterion;
    model.fit = std::move(*fitted);
    ranked.push_back(std::move(model));
  }
  std::stable_sort(ranked.begin(), ranked.end(), before);
  apply_parsimony(ranked);
  return ranked;
}

Result<GrownModel> grow_model(const WaveletVariance& wv, std::span<const ProcessKind> terms, double rate_hz,
                              const FitOptions& options) {
  CovarianceTables own;
  FitOptions growing = options;
  if (growing.covariances == nullptr) growing.covariances = &own;
  auto grown = Grower(wv, terms, rate_hz, growing).run();
  if (!grown || options.intervals == Intervals::kQuick) return grown;
  FitOptions again = options;
  again.warm_start = &grown->best;
  auto best = fit(wv, grown->best.spec, rate_hz, again);
  if (!best) return tl::unexpected(best.error());
  grown->best = std::move(*best);
  return grown;
}

Result<std::vector<CrossValidated>> cross_validate(std::span<const WaveletVariance> replicates,
                                                   const ModelSpec& full, double rate_hz,
                                                   const FitOptions& options) {
  constexpr std::size_t kFewest = 3;
  if (replicates.size() < kFewest) {
    return usage_error(fmt::format("{} replicates are too few to leave one out", replicates.size()),
                       fmt::format("give at least {}", kFewest));
  }
  const auto reference = fit(pool(replicates), full, rate_hz, options);
  if (!reference) return tl::unexpected(reference.error());
  const auto left_out = leave_one_out(replicates, reference->model);
  if (!left_out) return tl::unexpected(left_out.error());
  std::vector<CrossValidated> ranked;
  std::vector<Eigen::VectorXd> scores;
  for (const ModelSpec& spec : sub_models(full)) {
    auto pooled = fit(pool(replicates), spec, rate_hz, options);
    if (!pooled) return tl::unexpected(pooled.error());
    Eigen::VectorXd score(static_cast<Eigen::Index>(left_out->size()));
    for (std::size_t k = 0; k < left_out->size(); ++k) {
      const auto trained = fit((*left_out)[k].others, spec, rate_hz, options);
      if (!trained) return tl::unexpected(trained.error());
      score[static_cast<Eigen::Index>(k)] = (*left_out)[k].distance(trained->model);
    }
    ranked.push_back({std::move(*pooled), score.mean(), 0.0, 0.0, {}});
    scores.push_back(std::move(score));
  }
  set_differences(ranked, scores);
  order_by_parsimony(ranked);
  return ranked;
}

}  // namespace imuscope::noise
