#include "drivers/xsens_mt/unwrap.h"

#include <algorithm>
#include <cmath>

#include "base/contracts.h"

namespace imuscope::xsens {
namespace {

// A count may be ahead of host time by this much: batches and an oscillator 1 % off.
constexpr double kAheadAllowance_s = 0.5;
constexpr double kRateAllowance = 0.01;
// A suspected count is a restart when the next one follows it within this time.
constexpr double kFollows_s = 0.5;
// The first frame of a segment may come out of a full kernel buffer, this late.
constexpr double kUnknownBacklog_s = 3.0;
// Without host time a longer gap than this is taken for a restart.
constexpr double kLongestGap_s = 600.0;

}  // namespace

CountUnwrapper::CountUnwrapper(const UnwrapConfig& config) noexcept
    : config_(config), s_per_count_(1.0 / config.counts_per_s) {
  IMUSCOPE_EXPECTS(config.modulus > 0 && config.counts_per_s > 0.0);
}

CountStep CountUnwrapper::take(std::int64_t raw, HostTime arrival) noexcept {
  if (!has_last_) {
    has_last_ = true;
    raw_ = raw;
    count_ = raw;
    arrival_ = arrival;
    behind_s_ = kUnknownBacklog_s;
    return CountStep::kFirst;
  }
  std::int64_t step = smallest_step(raw);
  if (!config_.host_time_is_meaningful) {
    if (step > config_.modulus / 2 || static_cast<double>(step) > kLongestGap_s * config_.counts_per_s) {
      accept(raw, arrival, 1);
      return CountStep::kRestarted;
    }
    accept(raw, arrival, step);
    return step == 0 ? CountStep::kRepeated : CountStep::kForward;
  }
  const double elapsed_s = to_seconds(arrival - arrival_);
  const double most_s = elapsed_s + behind_s_;
  // Whole turns of the counter fit into a long silence: take the number that host time is nearest to.
  const auto modulus = static_cast<double>(config_.modulus);
  const double unexplained = most_s * config_.counts_per_s - static_cast<double>(step);
  if (unexplained >= 0.5 * modulus) {
    step += static_cast<std::int64_t>(std::floor(unexplained / modulus + 0.5)) * config_.modulus;
  }
  const double step_s = static_cast<double>(step) * s_per_count_;
  if (step_s > most_s + kAheadAllowance_s + kRateAllowance * elapsed_s) return suspect(raw, arrival);

  suspected_ = false;
  // Late now by what host time ran more than the count; forgotten slowly, so that a constant delay that came
  // to stay is not taken for a backlog for ever. Never below zero: a frame found inside a false one arrived
  // before the one that was counted last, and most_s may be negative then.
  behind_s_ = std::max(std::min(most_s - step_s - kRateAllowance * elapsed_s, most_s), 0.0);
  accept(raw, arrival, step);
  return step == 0 ? CountStep::kRepeated : CountStep::kForward;
}

std::int64_t CountUnwrapper::smallest_step(std::int64_t raw) const noexcept {
  if (raw >= raw_) return raw - raw_;
  std::int64_t step = raw + config_.modulus - raw_;
  if (config_.other_modulus > raw_) step = std::min(step, raw + config_.other_modulus - raw_);
  return step;
}

CountStep CountUnwrapper::suspect(std::int64_t raw, HostTime arrival) noexcept {
  const std::int64_t since_suspect = raw - suspect_raw_;
  const bool follows = suspected_ && since_suspect > 0 &&
                       static_cast<double>(since_suspect) <= kFollows_s * config_.counts_per_s;
  if (!follows) {
    suspected_ = true;
    suspect_raw_ = raw;
    return CountStep::kRejected;
  }
  suspected_ = false;
  behind_s_ = kUnknownBacklog_s;
  accept(raw, arrival, 1);
  return CountStep::kRestarted;
}

void CountUnwrapper::accept(std::int64_t raw, HostTime arrival, std::int64_t step) noexcept {
  raw_ = raw;
  count_ += step;
  step_ = step;
  arrival_ = arrival;
}

}  // namespace imuscope::xsens
