#include "noise/select.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>

namespace imuscope::noise {
namespace {

/// Criteria closer than this are equal: exp(-1) in likelihood.
constexpr double kEquivalent = 2.0;

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

bool before(const RankedModel& a, const RankedModel& b) {
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
        ranked[i].fit.spec.parameter_count() < ranked[best].fit.spec.parameter_count()) {
      best = i;
    }
  }
  for (std::size_t i = 1; i < ranked.size(); ++i) {
    const RankedModel& first = ranked.front();
    ranked[i].reason =
        !ranked[i].fit.identifiable
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

}  // namespace

Result<std::vector<RankedModel>> rank_models(const WaveletVariance& wv, const ModelSpec& full, double rate_hz,
                                             const FitOptions& options) {
  std::vector<RankedModel> ranked;
  for (const ModelSpec& spec : sub_models(full)) {
    auto fitted = fit(wv, spec, rate_hz, options);
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

}  // namespace imuscope::noise
