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

std::string ProgressBar::time_left(double share) const {
  constexpr double kTold_s = 2.0;
  constexpr double kShareTold = 0.02;
  const double gone_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - step_began_).count();
  if (gone_s < kTold_s || share < kShareTold || share >= 1.0) return {};
  const double left_s = gone_s * (1.0 - share) / share;
  constexpr double kMinute_s = 60.0;
  return left_s < 2.0 * kMinute_s ? fmt::format(", {:.0f} s left", left_s)
                                  : fmt::format(", {:.0f} min left", left_s / kMinute_s);
}

void ProgressBar::show(const std::string& step, double share) {
  if (!is_terminal_) return;
  constexpr int kWidth = 30;
  const int percent = static_cast<int>(share * 100.0);
  if (percent == shown_percent_ && step == shown_step_) return;
  if (step != shown_step_) step_began_ = std::chrono::steady_clock::now();
  shown_percent_ = percent;
  shown_step_ = step;
  const int filled = percent * kWidth / 100;
  fmt::print(stderr, "\r\x1b[K{:<16} [{:#<{}}{:<{}}] {:3} %{}", step, "", filled, "", kWidth - filled,
             percent, time_left(share));
  std::fflush(stderr);
}

void ProgressBar::show(const std::string& step) {
  if (!is_terminal_) return;
  shown_percent_ = 0;
  shown_step_ = step;
  fmt::print(stderr, "\r\x1b[K{} ...", step);
  std::fflush(stderr);
}

}  // namespace imuscope::cli
