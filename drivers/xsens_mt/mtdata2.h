#pragma once

/// MTData2 (0x36): items that name themselves. Items come and go from message to message, each at a rate of
/// its own; an unknown item is stepped over by its size.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "drivers/device/nav_pvt.h"
#include "drivers/xsens_mt/mtdata.h"
#include "drivers/xsens_mt/wire.h"

namespace imuscope::xsens {

/// One item of a message; `data` points into the message.
struct Item {
  std::uint16_t id = 0;  ///< data identifier with its format bits
  std::span<const std::uint8_t> data;

  [[nodiscard]] std::uint16_t kind() const noexcept {
    return static_cast<std::uint16_t>(id & ~xdi::kFormatBits);
  }
  [[nodiscard]] NumberFormat format() const noexcept { return static_cast<NumberFormat>(id & 0x3U); }
};

/// Walks over the items of a message. An item that reaches beyond the end makes the whole message invalid:
/// check at_end() after the last one, or items_are_whole() before the first.
class ItemReader {
 public:
  explicit ItemReader(std::span<const std::uint8_t> data) noexcept : rest_(data) {}
  [[nodiscard]] bool next(Item& item) noexcept {
    if (rest_.size() < kItemHeader) return false;
    const std::size_t size = rest_[2];
    if (rest_.size() < kItemHeader + size) return false;
    item = {read_be<std::uint16_t>(rest_, 0), rest_.subspan(kItemHeader, size)};
    rest_ = rest_.subspan(kItemHeader + size);
    return true;
  }
  [[nodiscard]] bool at_end() const noexcept { return rest_.empty(); }

 private:
  static constexpr std::size_t kItemHeader = 3;
  std::span<const std::uint8_t> rest_;
};

[[nodiscard]] bool items_are_whole(std::span<const std::uint8_t> data) noexcept;

/// How the data of an item is to be read.
enum class ItemContent : std::uint8_t {
  kNumbers,  ///< real numbers in the item's format
  kU8,
  kU16,
  kU32,
  kUtc,
  kGnssPvt,
  kSatellites,
  kRawInertial,       ///< 9 u16, i16
  kGyroTemperatures,  ///< 3 i16
  kBytes,             ///< known by name only
};

/// What is known of one data identifier; find_item_kind() hands out entries of a constant table.
struct ItemKind {
  std::uint16_t kind;  ///< data identifier without format bits
  std::string_view name;
  ItemContent content;
  std::size_t count;  ///< of numbers or integers
};

/// Nothing where the identifier is not known.
const ItemKind* find_item_kind(std::uint16_t id) noexcept;

/// Reads N real numbers; false where the item's size is another.
template <std::size_t N>
[[nodiscard]] bool read_numbers(const Item& item, std::array<double, N>& out) noexcept {
  const NumberFormat format = item.format();
  const std::size_t size = size_of(format);
  if (item.data.size() != N * size) return false;
  for (std::size_t i = 0; i < N; ++i) out[i] = read_number(item.data, i * size, format);
  return true;
}

inline constexpr std::size_t kGnssPvtSize = 94;

/// GNSS solution (0x7010), in the receiver's units.
struct GnssPvt {
  std::uint32_t time_of_week_ms;
  std::uint16_t year;
  std::uint8_t month, day, hour, minute, second;
  std::uint8_t valid;  ///< bit 0 date, 1 time, 2 fully resolved
  std::uint32_t time_accuracy_ns;
  std::int32_t nanoseconds;
  std::uint8_t fix_type;  ///< 0 none, 3 three-dimensional
  std::uint8_t flags;     ///< bit 0 fix ok, 1 differential
  std::uint8_t n_satellites;
  std::uint8_t reserved;
  std::int32_t longitude_1e7_deg;
  std::int32_t latitude_1e7_deg;
  std::int32_t height_mm;
  std::int32_t height_msl_mm;
  std::uint32_t horizontal_accuracy_mm;
  std::uint32_t vertical_accuracy_mm;
  std::array<std::int32_t, 3> velocity_ned_mmps;
  std::int32_t ground_speed_mmps;
  std::int32_t course_1e5_deg;
  std::uint32_t speed_accuracy_mmps;
  std::uint32_t course_accuracy_1e5_deg;
  std::int32_t vehicle_heading_1e5_deg;
  std::array<std::uint16_t, 7> dop_centi;  ///< geometric, position, time, vertical, horizontal, north, east
};

/// Nothing where the size is not kGnssPvtSize.
std::optional<GnssPvt> read_gnss_pvt(std::span<const std::uint8_t> data) noexcept;

/// As the receiver inside computed it.
/// @param rtk  0 none, 1 float, 2 fixed: of the status word
[[nodiscard]] NavPvt nav_pvt_of(const GnssPvt& pvt, unsigned rtk) noexcept;

}  // namespace imuscope::xsens
