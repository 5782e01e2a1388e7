#pragma once

/// A progress bar on stderr, drawn only where stderr is a terminal.

#include <string>

namespace imuscope::cli {

class ProgressBar {
 public:
  ProgressBar();
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// @param share  0 to 1
  void show(const std::string& step, double share);

  /// Takes it off the screen.
  void clear();

 private:
  bool is_terminal_;
  int shown_percent_ = -1;
  std::string shown_step_;
};

}  // namespace imuscope::cli
