#include "firmware_sim/devices/gnss_talker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "firmware_sim/devices/gnss_encoders.h"

namespace imusim {
namespace {

constexpr std::array<std::string_view, 4> kSentences = {"GGA", "GST", "RMC", "ZDA"};

}  // namespace

double first_epoch_s(Utc utc_begin, double rate_hz) {
  constexpr double kRounding = 1e-9;
  const double time_of_day = std::chrono::duration<double>(calendar_time(utc_begin).time_of_day).count();
  return std::ceil(time_of_day * rate_hz - kRounding) / rate_hz - time_of_day;
}

GnssTalker::GnssTalker(const Options& options, Solver solver)
    : options_(options),
      solver_(std::move(solver)),
      grid_(first_epoch_s(options.utc_begin, options.rate_hz), 1.0 / options.rate_hz),
      header_is_due_(options.language == Language::kRtklib) {}

void GnssTalker::power_cycle(double t_s, double off_s) {
  skip_to(t_s + off_s + kWarmStart_s);
  header_is_due_ = options_.language == Language::kRtklib;
}

bool GnssTalker::leave_out(const std::vector<std::string>& blocks) {
  const bool known =
      options_.language == Language::kNmea
          ? std::all_of(blocks.begin(), blocks.end(),
                        [](const std::string& name) {
                          return std::find(kSentences.begin(), kSentences.end(), name) != kSentences.end();
                        })
          : blocks.empty();
  if (known) left_out_ = blocks;
  return known;
}

Bytes GnssTalker::epoch(std::int64_t index) const {
  const greis::Solution solution = solver_(grid_.instant(index));
  const Gps gps = gps_after(options_.utc_begin, grid_.device_time(index));
  switch (options_.language) {
    case Language::kNmea:
      return encode_nmea(solution, gps, left_out_);
    case Language::kUbx:
      return encode_ubx_nav_pvt(solution, gps);
    case Language::kRtklib:
      break;
  }
  return encode_rtklib(solution, gps);
}

void GnssTalker::run_until(double t_s, std::vector<Emission>& out) {
  for (;; ++next_index_) {
    const double ready_s = grid_.instant(next_index_) + options_.latency_s;
    if (ready_s > t_s) return;
    if (std::exchange(header_is_due_, false)) out.push_back({ready_s, rtklib_header()});
    if (Bytes bytes = epoch(next_index_); !bytes.empty()) out.push_back({ready_s, std::move(bytes)});
  }
}

}  // namespace imusim
