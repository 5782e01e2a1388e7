#include "logs/flight_log/ulog_reader.h"

#include <fmt/format.h>
#include <algorithm>
#include <charconv>
#include <cmath>

#include "logs/flight_log/ulog_messages.h"

namespace imuscope::flight_log {
namespace {

using mcap::Bytes;
using mcap::text_of;

constexpr std::size_t kFileHead = 16;
/// Size and kind before every message.
constexpr std::size_t kHead = 3;
constexpr std::size_t kSizeMost = 65535;
constexpr std::string_view kKinds = "BFIMPQARDLCSO";
/// A whole message of synchronisation.
constexpr std::array<std::uint8_t, 11> kSynchronisation{0x08, 0x00, 'S',  0x2F, 0x73, 0x13,
                                                        0x20, 0x25, 0x0C, 0xBB, 0x12};
constexpr std::size_t kFormatsMost = 4096;
constexpr int kDepthMost = 8;
/// Fields of one record, those of its parts counted.
constexpr int kFieldsMost = 4096;
constexpr double kMs_s = 1e-3;

std::optional<NumberKind> kind_of(std::string_view type) {
  constexpr std::array<std::pair<std::string_view, NumberKind>, 12> kTypes{{{"int8_t", NumberKind::kI8},
                                                                            {"uint8_t", NumberKind::kU8},
                                                                            {"bool", NumberKind::kU8},
                                                                            {"char", NumberKind::kU8},
                                                                            {"int16_t", NumberKind::kI16},
                                                                            {"uint16_t", NumberKind::kU16},
                                                                            {"int32_t", NumberKind::kI32},
                                                                            {"uint32_t", NumberKind::kU32},
                                                                            {"int64_t", NumberKind::kI64},
                                                                            {"uint64_t", NumberKind::kU64},
                                                                            {"float", NumberKind::kF32},
                                                                            {"double", NumberKind::kF64}}};
  for (const auto& [name, kind] : kTypes) {
    if (name == type) return kind;
  }
  return std::nullopt;
}

/// "float[3]" as "float" and 3; nothing where that is no number that a record can have.
std::optional<std::size_t> split_array(std::string_view& type) {
  const auto bracket = type.find('[');
  if (bracket == std::string_view::npos) return 1;
  std::size_t count = 0;
  const char* const begin = type.data() + bracket + 1;
  const char* const end = type.data() + type.size();
  const auto [after, error] = std::from_chars(begin, end, count);
  if (error != std::errc{} || after == end || *after != ']' || count > kSizeMost) return std::nullopt;
  type = type.substr(0, bracket);
  return count;
}

}  // namespace

Result<UlogReader> UlogReader::open(const std::filesystem::path& file) {
  auto window = Window::open(file);
  if (!window) return tl::unexpected<Error>(window.error());
  const std::string name = file.string();
  const Bytes head = window->peek(kFileHead);
  if (head.size() < kFileHead || !std::equal(kUlogMagic.begin(), kUlogMagic.end(), head.begin()))
    return work_error(fmt::format("{}: is no ULog of PX4", name), "check how it was made");
  window->skip(kFileHead);
  // What a file needs its reader to know stands first.
  const Bytes flags = window->peek(kHead + 40);
  UlogReader reader(std::move(*window), name);
  if (flags.size() == kHead + 40 && flags[2] == 'B') {
    constexpr std::uint8_t kAppended = 1;
    const Bytes incompatible = flags.subspan(kHead + 8, 8);
    for (std::size_t i = 0; i < incompatible.size(); ++i) {
      if ((incompatible[i] & ~(i == 0 ? kAppended : 0U)) != 0)
        return work_error(fmt::format("{}: is of a newer kind of ULog than is known here", name),
                          "convert it to an older one");
    }
    if ((incompatible[0] & kAppended) != 0) {
      mcap::RecordReader offsets(flags.subspan(kHead + 16));
      while (!offsets.rest().empty()) {
        const auto offset = offsets.number<std::uint64_t>();
        if (offset > kFileHead && offset < reader.window_.size()) reader.appended_.push_back(offset);
      }
      std::sort(reader.appended_.begin(), reader.appended_.end());
    }
  }
  return reader;
}

std::uint64_t UlogReader::next_appended() const {
  const auto next = std::upper_bound(appended_.begin(), appended_.end(), window_.position());
  return next == appended_.end() ? window_.size() : *next;
}

/// From behind a byte that begins no message to the next synchronisation, appended part or the end.
bool UlogReader::find_synchronisation() {
  constexpr std::size_t kLook = 64 * 1024;
  const std::uint64_t until = next_appended();
  window_.skip(1);
  bool is_found = false;
  while (window_.position() < until) {
    const Bytes piece = window_.peek(kLook);
    const auto found =
        std::search(piece.begin(), piece.end(), kSynchronisation.begin(), kSynchronisation.end());
    const auto passed = static_cast<std::uint64_t>(found - piece.begin());
    is_found = found != piece.end() && window_.position() + passed < until;
    if (found != piece.end() || piece.size() < kLook) {
      window_.skip(passed);
      break;
    }
    window_.skip(piece.size() - kSynchronisation.size() + 1);
  }
  window_.go_to(std::min(window_.position(), until));
  return is_found;
}

bool UlogReader::read_message() {
  const Bytes head = window_.peek(kHead);
  if (head.empty()) return false;
  const std::uint64_t until = next_appended();
  const std::uint64_t left = until - window_.position();
  if (head.size() < kHead || left < kHead) {
    loss_.cut_off = loss_.cut_off || until == window_.size();
    window_.go_to(until);
    return true;
  }
  const std::size_t size = head[0] + 256U * head[1];
  const char kind = static_cast<char>(head[2]);
  const bool is_unknown = kKinds.find(kind) == std::string_view::npos;
  if (is_unknown || kHead + size > left) {
    // A message that leads beyond the end is damage where the file goes on, and else the cut. After a cut
    // may stand what was appended.
    const std::uint64_t begin = window_.position();
    const bool goes_on = find_synchronisation();
    if (is_unknown || goes_on) loss_.bytes += window_.position() - begin;
    if (!is_unknown && !goes_on && until == window_.size()) loss_.cut_off = true;
    return true;
  }
  const Bytes content = window_.peek(kHead + size).subspan(kHead);
  if (content.size() < size) return false;  // the file shrank
  window_.skip(kHead + size);
  switch (kind) {
    case 'F':
      take_format(content);
      break;
    case 'A':
      take_subscription(content);
      break;
    case 'D':
      take_data(content);
      break;
    case 'O':
      ++loss_.dropouts;
      loss_.dropped_s += mcap::RecordReader(content).number<std::uint16_t>() * kMs_s;
      break;
    default:
      break;
  }
  return true;
}

void UlogReader::take_format(Bytes content) {
  const auto text = text_of(content);
  const auto colon = text.find(':');
  if (colon == std::string_view::npos || formats_.size() >= kFormatsMost) return;
  formats_.try_emplace(std::string(text.substr(0, colon)), Format{std::string(text.substr(colon + 1))});
}

/// Fields of a format and of the formats in it, the latter without a name that anything here asks for.
bool UlogReader::add_fields(const std::string& format, const std::string& prefix, int depth, int& budget,
                            Layout& layout) const {
  const auto found = formats_.find(format);
  if (found == formats_.end() || depth > kDepthMost) return false;
  std::string_view rest = found->second.fields;
  while (!rest.empty()) {
    const auto end = rest.find(';');
    const std::string_view one = rest.substr(0, end);
    rest = end == std::string_view::npos ? std::string_view{} : rest.substr(end + 1);
    if (one.empty()) continue;
    const auto space = one.find(' ');
    if (space == std::string_view::npos || --budget < 0) return false;
    std::string_view type = one.substr(0, space);
    const std::string name = prefix + std::string(one.substr(space + 1));
    const auto count = split_array(type);
    if (!count) return false;
    if (const auto kind = kind_of(type)) {
      layout.add(name, *kind, *count);
      if (layout.size() > kSizeMost) return false;
      continue;
    }
    for (std::size_t i = 0; i < *count; ++i) {
      if (!add_fields(std::string(type), name + ".", depth + 1, budget, layout)) return false;
    }
  }
  return true;
}

void UlogReader::take_subscription(Bytes content) {
  mcap::RecordReader fields(content);
  const auto instance = fields.number<std::uint8_t>();
  const auto id = fields.number<std::uint16_t>();
  const std::string type(text_of(fields.rest()));
  if (!fields.good()) return;
  Subscription subscription;
  if (is_taken_of_px4(type)) {
    int budget = kFieldsMost;
    if (add_fields(type, "", 0, budget, subscription.layout)) {
      subscription.type = type;
      subscription.topic = fmt::format("{}/{}", type, instance);
    } else {
      ++loss_.messages;
    }
  }
  subscriptions_.insert_or_assign(id, std::move(subscription));
}

void UlogReader::take_data(Bytes content) {
  mcap::RecordReader in(content);
  const auto found = subscriptions_.find(in.number<std::uint16_t>());
  if (!in.good() || found == subscriptions_.end()) {
    ++loss_.messages;
    return;
  }
  const Subscription& subscription = found->second;
  if (subscription.type.empty()) return;
  const auto taken =
      take_of_px4(subscription.type, subscription.topic, Fields(subscription.layout, in.rest()), queue_);
  if (!taken.is_good) ++loss_.messages;
  if (taken.accel_lag_s) {
    accel_lag_s_ += *taken.accel_lag_s;
    ++accel_lags_;
  }
}

std::optional<mcap::Message> UlogReader::next() {
  for (;;) {
    if (auto message = queue_.take()) return message;
    if (!read_message()) return std::nullopt;
  }
}

std::vector<std::string> UlogReader::losses() const {
  std::vector<std::string> losses;
  if (loss_.dropouts > 0) {
    losses.push_back(fmt::format("{}: the flight controller dropped data {} times, {:.1f} s together", name_,
                                 loss_.dropouts, loss_.dropped_s));
  }
  if (loss_.messages > 0) losses.push_back(fmt::format("{}: {} messages are damaged", name_, loss_.messages));
  if (loss_.bytes > 0)
    losses.push_back(fmt::format("{}: {} bytes are damaged and were passed over", name_, loss_.bytes));
  if (loss_.cut_off)
    losses.push_back(fmt::format("{}: is cut off; what stands before the cut is used", name_));
  constexpr double kLagLeast_s = 5e-4;
  const double lag_s = accel_lags_ > 0 ? accel_lag_s_ / static_cast<double>(accel_lags_) : 0.0;
  if (std::abs(lag_s) > kLagLeast_s) {
    losses.push_back(
        fmt::format("{}: accelerometers of sensor_combined are {:+.1f} ms from the gyros, whose times "
                    "hold for both; vehicle_imu has them together",
                    name_, lag_s * 1e3));
  }
  return losses;
}

}  // namespace imuscope::flight_log
