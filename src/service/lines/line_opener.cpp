#include "service/lines/line_opener.h"

#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "base/contracts.h"
#include "rt/thread_setup.h"

namespace imuscope {

struct LineOpener::Attempt {
  std::mutex mutex;
  std::optional<Outcome> outcome;
};

void LineOpener::begin(std::function<Outcome()> open) {
  IMUSCOPE_EXPECTS(!is_under_way());
  attempt_ = std::make_shared<Attempt>();
  try {
    std::thread([attempt = attempt_, open = std::move(open)] {
      (void)setup_this_thread({"imuscope-open", Scheduling::kNormal, 0, {}});
      auto outcome = open();
      const std::lock_guard lock(attempt->mutex);
      attempt->outcome.emplace(std::move(outcome));
    }).detach();
  } catch (const std::system_error& error) {
    attempt_->outcome.emplace(work_error(std::string("no thread to open it in (") + error.what() + ")",
                                         "raise the limit of threads or of locked memory"));
  }
}

std::optional<LineOpener::Outcome> LineOpener::take() {
  if (!attempt_) return std::nullopt;
  std::optional<Outcome> outcome;
  {
    const std::lock_guard lock(attempt_->mutex);
    outcome = std::exchange(attempt_->outcome, std::nullopt);
  }
  if (outcome) attempt_.reset();
  return outcome;
}

}  // namespace imuscope
