#include "progress.h"

#include <fmt/format.h>
#include <unistd.h>
#include <cstdio>

namespace imuscope::cli {

ProgressBar::ProgressBar() : is_terminal_(isatty(STDERR_FILENO) == 1) {}

ProgressBar::~ProgressBar() { clear(); }

void ProgressBar::clear() {
  if (shown_percent_ >= 0) fmt::print(stderr, "\r\x1b[K");
  shown_percent_ = -1;
}

void ProgressBar::show(const std::string& step, double share) {
  if (!is_terminal_) return;
  constexpr int kWidth = 30;
  const int percent = static_cast<int>(share * 100.0);
  if (percent == shown_percent_ && step == shown_step_) return;
  shown_percent_ = percent;
  shown_step_ = step;
  const int filled = percent * kWidth / 100;
  fmt::print(stderr, "\r\x1b[K{:<16} [{:#<{}}{:<{}}] {:3} %", step, "", filled, "", kWidth - filled, percent);
  std::fflush(stderr);
}

}  // namespace imuscope::cli
