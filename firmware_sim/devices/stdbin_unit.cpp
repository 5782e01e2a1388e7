#include "firmware_sim/devices/stdbin_unit.h"

#include <algorithm>
#include <cmath>

namespace imusim {
namespace {

constexpr double kTick_s = 1e-4;

}  // namespace

double StdbinUnit::sample_time(std::int64_t index) const {
  return static_cast<double>(options_.phase_100us) * kTick_s + static_cast<double>(index) / options_.rate_hz;
}

void StdbinUnit::skip_to(double t_s) {
  const double index = std::ceil((t_s - sample_time(0)) * options_.rate_hz);
  next_index_ = std::max(next_index_, static_cast<std::int64_t>(std::max(index, 0.0)));
}

void StdbinUnit::run_until(double t_s, std::vector<Emission>& out) {
  while (true) {
    const double sampled_s = sample_time(next_index_);
    const double ready_s = sampled_s + options_.latency_s;
    if (ready_s > t_s) return;
    stdbin::Telegram telegram = sampler_(sampled_s);
    const UtcParts utc = utc_parts(utc_after(options_.utc_begin, sampled_s));
    using Ticks = std::chrono::duration<std::int64_t, std::ratio<1, 10000>>;
    telegram.validity_100us = static_cast<std::uint32_t>(std::chrono::round<Ticks>(utc.time_of_day).count());
    telegram.date = stdbin::Date{static_cast<std::uint8_t>(utc.day), static_cast<std::uint8_t>(utc.month),
                                 static_cast<std::uint16_t>(utc.year)};
    telegram.counter = options_.first_counter + static_cast<std::uint32_t>(next_index_);
    out.push_back({ready_s, stdbin::encode(telegram)});
    ++next_index_;
  }
}

}  // namespace imusim
