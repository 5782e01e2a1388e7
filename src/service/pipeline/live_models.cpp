#include "service/pipeline/live_models.h"

#include <utility>

namespace imuscope {

LiveModels::LiveModels(const Configuration& configuration, noise::ModelSpec spec, Take take)
    : limits_(configuration.regimes.limits),
      book_(configuration, std::move(spec)),
      take_(std::move(take)),
      studies_(configuration.study_indices().size(), Study{RecentRegimes(limits_), {}}) {}

void LiveModels::add(const ErrorRecord& record) {
  Study& study = studies_[record.study];
  if (!study.regimes.follows(record.row.time)) finish(study);
  study.regimes.add(record.row.time, record.row.predicted_omega_s_radps, record.row.predicted_f_s_mps2);
  if (record.speed)
    study.regimes.add_speed(record.speed->time, record.speed->speed_mps, record.speed->sd_mps);
  study.waiting.push_back(record);
  release(study);
}

void LiveModels::finish() {
  for (Study& study : studies_) finish(study);
}

void LiveModels::finish(Study& study) {
  study.regimes.settle();
  release(study);
  study.regimes = RecentRegimes(limits_);
}

void LiveModels::release(Study& study) {
  const auto until = study.regimes.settled_until();
  while (until && !study.waiting.empty() && study.waiting.front().row.time < *until) {
    const ErrorRecord& record = study.waiting.front();
    const auto regime = study.regimes.at(record.row.time);
    book_.add(record, regime ? std::optional(static_cast<Regime>(*regime)) : std::nullopt);
    study.waiting.pop_front();
    // At the very row, so that a replay fits the same samples.
    while (auto refit = book_.refit()) take_(std::move(*refit));
  }
}

}  // namespace imuscope
