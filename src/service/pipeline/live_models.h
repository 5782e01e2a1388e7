#pragma once

/// Rows of a run that goes on, each to the model of the regime that held there. Rows wait for the few seconds
/// that regimes take to settle (recent_regimes.h); the same rows give the same refits, live and in a replay.

#include <deque>
#include <functional>
#include <vector>

#include "configuration/config.h"
#include "estimation/regimes/recent_regimes.h"
#include "models/noise/model.h"
#include "service/pipeline/core.h"
#include "service/pipeline/model_book.h"
#include "service/pipeline/refit.h"

namespace imuscope {

/// Thread: one.
class LiveModels {
 public:
  using Take = std::function<void(Refit)>;
  /// @param take  called with every refit, from within add() and finish()
  LiveModels(const Configuration& configuration, noise::ModelSpec spec, Take take);

  void add(const ErrorRecord& record);
  /// The run ends: what still waits is taken with what is known.
  void finish();
  void set_options(noise::ModelSpec spec, double refit_interval_s) {
    book_.set_options(std::move(spec), refit_interval_s);
  }

 private:
  struct Study {
    RecentRegimes regimes;
    std::deque<ErrorRecord> waiting;
  };
  /// Hands over what is settled.
  void release(Study& study);
  void finish(Study& study);

  MotionLimits limits_;
  ModelBook book_;
  Take take_;
  std::vector<Study> studies_;
};

}  // namespace imuscope
