#pragma once

/// A progress bar on stderr, drawn only where stderr is a terminal.

#include <chrono>
#include <string>

namespace imuscope::cli {

class ProgressBar {
 public:
  ProgressBar();
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// With the time that the step has left, where it takes longer than a moment.
  /// @param share  0 to 1
  void show(const std::string& step, double share);

  /// A step of some seconds of which nobody knows how far it is.
  void show(const std::string& step);

  /// Takes it off the screen.
  void clear();

 private:
  /// ", 12 s left", once the step has gone on for long enough to tell; else nothing.
  [[nodiscard]] std::string time_left(double share) const;

  bool is_terminal_;
  int shown_percent_ = -1;
  std::string shown_step_;
  std::chrono::steady_clock::time_point step_began_;
};

}  // namespace imuscope::cli
