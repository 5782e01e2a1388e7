#include "service/recording/capture_damage.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>

#include "base/text.h"

namespace imuscope {

namespace {

/// "1 record", "2 records".
std::string records(std::uint64_t n) { return fmt::format("{} record{}", n, n == 1 ? "" : "s"); }

/// What the files of a capture hold that is no good.
void add_file_damage(const CaptureSummary& summary, const std::string& input,
                     std::vector<std::string>& damage) {
  const LogHealth all = health_of(summary.files);
  for (const auto& [number, health] : summary.files) {
    if (!health.is_sealed || health.index) continue;
    // The recorder goes on in another file only when it has ended one.
    const bool is_last = number == summary.files.back().number;
    damage.push_back(fmt::format("{}: {} ends without its index: {}", input,
                                 capture_file(input, number).filename().string(),
                                 is_last ? "the recorder was cut off, and what came then was never recorded"
                                         : "its end was recorded once and is lost"));
  }
  if (all.bytes_cut_off > 0) {
    damage.push_back(fmt::format("{}: its last record is cut off ({} bytes); everything before it is used",
                                 input, all.bytes_cut_off));
  }
  if (all.bytes_skipped > 0)
    damage.push_back(fmt::format("{}: {} bytes are damaged and were passed over", input, all.bytes_skipped));
  if (all.records_damaged > 0) {
    damage.push_back(
        fmt::format("{}: {} passed over for a wrong checksum", input, records(all.records_damaged)));
  }
  if (all.is_sealed && all.records_unsealed > 0) {
    damage.push_back(
        fmt::format("{}: {} whose checksum is lost, taken as found", input, records(all.records_unsealed)));
  }
  if (all.records_missing > 0) {
    damage.push_back(fmt::format("{}: {} lost that had been recorded", input, records(all.records_missing)));
  }
}

}  // namespace

std::vector<std::string> damage_of(const CaptureSummary& summary, const std::string& input) {
  std::vector<std::string> damage;
  for (const auto& gap : summary.breaks) {
    const std::string behind = capture_file(input, gap.behind).filename().string();
    if (gap.n_missing > 0) {
      damage.push_back(
          fmt::format("{}: {} file{} from {} on {} missing or unreadable; {:.1f} s of the recording are lost "
                      "and it goes on with {}",
                      input, gap.n_missing, gap.n_missing == 1 ? "" : "s",
                      capture_file(input, gap.first_missing).filename().string(),
                      gap.n_missing == 1 ? "is" : "are", gap.seconds, behind));
    } else {
      damage.push_back(
          fmt::format("{}: the beginning of {} is damaged; {:.1f} s of the recording are lost there", input,
                      behind, gap.seconds));
    }
  }
  // One remark a device, however many holes a capture has or claims.
  struct Lost {
    std::int64_t records = 0;
    std::int64_t places = 0;
    double seconds = 0.0;
  };
  std::map<std::string, Lost> lost;
  for (const auto& loss : summary.losses) {
    Lost& of_device = lost[loss.device];
    of_device.records += std::min(loss.records, std::numeric_limits<std::int64_t>::max() - of_device.records);
    ++of_device.places;
    of_device.seconds += std::max(0.0, to_seconds(loss.until - loss.after));
  }
  for (const auto& [device, of_device] : lost) {
    damage.push_back(fmt::format(
        "{}: {} missing in {} place{}, {:.1f} s in all; the replay is not exact from the first on",
        one_line(device), records(static_cast<std::uint64_t>(of_device.records)), of_device.places,
        of_device.places == 1 ? "" : "s", of_device.seconds));
  }
  add_file_damage(summary, input, damage);
  return damage;
}

}  // namespace imuscope
