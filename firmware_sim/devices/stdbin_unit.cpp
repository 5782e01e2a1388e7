#include "firmware_sim/devices/stdbin_unit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace imusim {
namespace {

constexpr double kTick_s = 1e-4;
/// From power to the first telegram.
constexpr double kReferenceBoot_s = 5.0;

using stdbin::Telegram;

struct Block {
  std::string_view name;
  void (*remove)(Telegram&);
};
constexpr std::array<Block, 7> kBlocks{{
    {"raw_acceleration", [](Telegram& t) { t.raw_acceleration_mps2.reset(); }},
    {"raw_rotation_rate", [](Telegram& t) { t.raw_rotation_rate_degps.reset(); }},
    {"position", [](Telegram& t) { t.position.reset(), t.position_sd.reset(); }},
    {"speed", [](Telegram& t) { t.speed_neu_mps.reset(), t.speed_sd_neu_mps.reset(); }},
    {"attitude", [](Telegram& t) { t.heading_roll_pitch_deg.reset(), t.heading_roll_pitch_sd_deg.reset(); }},
    {"date", [](Telegram& t) { t.date.reset(); }},
    {"status", [](Telegram& t) { t.user_status.reset(), t.sensor_status.reset(); }},
}};

const Block* find_block(const std::string& name) {
  const auto* const found =
      std::find_if(kBlocks.begin(), kBlocks.end(), [&](const Block& block) { return block.name == name; });
  return found == kBlocks.end() ? nullptr : found;
}

}  // namespace

StdbinUnit::StdbinUnit(const Options& options, Sampler sampler)
    : options_(options),
      sampler_(std::move(sampler)),
      grid_(static_cast<double>(options.phase_100us) * kTick_s, 1.0 / options.rate_hz) {}

void StdbinUnit::skip_to(double t_s) { next_index_ = std::max(next_index_, grid_.first_from(t_s)); }

void StdbinUnit::power_cycle(double t_s, double off_s) {
  const double up_s = t_s + off_s + kReferenceBoot_s;
  skip_to(up_s);
  counted_from_ = next_index_;
  options_.first_counter = 0;
  aligned_s_ = up_s + options_.alignment_s;
}

bool StdbinUnit::leave_out(const std::vector<std::string>& blocks) {
  const bool known = std::all_of(blocks.begin(), blocks.end(),
                                 [](const std::string& name) { return find_block(name) != nullptr; });
  if (known) left_out_ = blocks;
  return known;
}

Telegram StdbinUnit::telegram_of(std::int64_t index) {
  const double sampled_s = grid_.instant(index);
  Telegram telegram = sampler_(sampled_s);
  // Its time of day ends at 24 h: in a leap second it repeats the last one.
  const CalendarTime utc =
      calendar_time(utc_without_leap_second(gps_after(options_.utc_begin, grid_.device_time(index))));
  using Ticks = std::chrono::duration<std::int64_t, std::ratio<1, 10000>>;
  telegram.validity_100us = static_cast<std::uint32_t>(std::chrono::round<Ticks>(utc.time_of_day).count());
  telegram.date = stdbin::Date{static_cast<std::uint8_t>(utc.day), static_cast<std::uint8_t>(utc.month),
                               static_cast<std::uint16_t>(utc.year)};
  telegram.counter = options_.first_counter + static_cast<std::uint32_t>(index - counted_from_);
  if (sampled_s < aligned_s_ && telegram.user_status) {
    *telegram.user_status &= ~stdbin::kUserNavigation;
    *telegram.user_status |= stdbin::kUserHrpInvalid | stdbin::kUserAlignment;
  }
  for (const std::string& name : left_out_) find_block(name)->remove(telegram);
  return telegram;
}

void StdbinUnit::run_until(double t_s, std::vector<Emission>& out) {
  while (true) {
    const double ready_s = grid_.instant(next_index_) + options_.latency_s;
    if (ready_s > t_s) return;
    out.push_back({ready_s, stdbin::encode(telegram_of(next_index_))});
    ++next_index_;
  }
}

}  // namespace imusim
