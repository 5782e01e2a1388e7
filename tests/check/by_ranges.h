#pragma once

/// What the tests of limits share: values that grow, answers by the ranges in which they hold, and tracks that are
/// filled by hand.

#include <fmt/format.h>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "check/checks.h"
#include "made_drive.h"

namespace imuscope::check {

using test::kGnss;
using test::kReference;
using test::kStudy;

/// `n` values from one to another, in even ratios.
inline std::vector<double> ratios(double first, double last, int n) {
  std::vector<double> values;
  for (int i = 0; i <= n; ++i) values.push_back(first * std::pow(last / first, static_cast<double>(i) / n));
  return values;
}

/// The same in even steps.
inline std::vector<double> steps(double first, double last, int n) {
  std::vector<double> values;
  for (int i = 0; i <= n; ++i) values.push_back(first + (last - first) * i / n);
  return values;
}

/// What is found of each value, by ranges of values of which the same is found.
inline std::string by_ranges(const std::string& title, const std::vector<double>& values,
                             const std::function<std::string(double)>& answer) {
  std::string text = title + '\n';
  std::string before;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string now = answer(values[i]);
    if (i == 0 || now != before) text += fmt::format("from {:.6g}: {}\n", values[i], now);
    before = now;
  }
  return text;
}

/// What was found without its numbers.
inline std::string words_of(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& f : findings)
    text +=
        fmt::format("{}[{} {} {}: {}]", text.empty() ? "" : " ", key_of(f.harm), f.device, f.check, f.what);
  return text.empty() ? "-" : text;
}

/// Three devices without samples; the rates of the configuration are 100, 50 and 10 Hz.
class Empty {
 public:
  Empty()
      : made_(made_drive({.length_s = 0.0, .reference_hz = 100.0, .study_hz = 50.0, .gnss_hz = 10.0})),
        drive_(made_.configuration) {}
  Empty(const Empty&) = delete;
  Empty& operator=(const Empty&) = delete;

  Configuration& configuration() { return made_.configuration; }
  [[nodiscard]] Drive& drive() { return drive_; }
  ImuTrack& imu(std::size_t device = kReference) { return drive_.imu(device); }
  GnssTrack& gnss() { return drive_.gnss(kGnss); }

  /// An ordinary sample, which is like none before it.
  void add_imu(std::size_t device, double time_s) {
    ImuTrack& track = imu(device);
    const auto n = static_cast<float>(track.size());
    track.time_s.push_back(time_s);
    track.omega_radps.emplace_back(0.1F * std::sin(n), 0.1F * std::sin(1.3F * n), 0.1F * std::sin(1.7F * n));
    track.f_mps2.emplace_back(std::sin(0.9F * n), std::sin(0.7F * n), -9.8F + 0.1F * std::sin(0.8F * n));
    track.counter.push_back(static_cast<std::int64_t>(track.size()));
  }
  void add_gnss(double time_s, double north_m, double east_m, double sd_m = 0.02) {
    gnss().time_s.push_back(time_s);
    gnss().position_m.emplace_back(north_m, east_m);
    gnss().claimed_sd_m.push_back(sd_m);
  }
  void fill(std::size_t device, std::size_t n, double rate_hz, double first_s = 0.0) {
    for (std::size_t i = 0; i < n; ++i) {
      const double time_s = first_s + static_cast<double>(i) / rate_hz;
      if (device == kGnss)
        add_gnss(time_s, std::sin(static_cast<double>(i)), std::cos(static_cast<double>(i)));
      else
        add_imu(device, time_s);
    }
  }
  [[nodiscard]] std::string stamps(std::size_t device = kReference) {
    std::vector<Finding> findings;
    check_stamps(drive_, device, findings);
    return words_of(findings);
  }

 private:
  test::DriveInMemory made_;
  Drive drive_;
};

}  // namespace imuscope::check
