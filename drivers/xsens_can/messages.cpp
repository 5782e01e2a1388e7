#include "drivers/xsens_can/messages.h"

#include <cmath>

#include "base/bytes.h"

namespace imuscope::xsens_can {
namespace {

constexpr double kUnitQuaternion = 1.0 / 32767.0;
/// After the three numbers of delta_v.
constexpr std::size_t kExponentAt = 6;

constexpr std::size_t size_of(Item item) noexcept { return kItemKinds[static_cast<std::size_t>(item)].size; }

}  // namespace

ItemIds default_ids() noexcept {
  ItemIds ids;
  for (std::size_t i = 0; i < kItemCount; ++i) ids[i] = {kItemKinds[i].id, false};
  return ids;
}

std::optional<std::uint32_t> read_u32(std::span<const std::uint8_t> data) noexcept {
  if (data.size() < sizeof(std::uint32_t)) return std::nullopt;
  return read_be<std::uint32_t>(data);
}

std::optional<std::uint16_t> read_u16(std::span<const std::uint8_t> data) noexcept {
  if (data.size() < sizeof(std::uint16_t)) return std::nullopt;
  return read_be<std::uint16_t>(data);
}

std::optional<RawTriad> read_raw(std::span<const std::uint8_t> data) noexcept {
  if (data.size() < size_of(Item::kRateOfTurn)) return std::nullopt;
  return RawTriad{read_be<std::int16_t>(data, 0), read_be<std::int16_t>(data, 2),
                  read_be<std::int16_t>(data, 4)};
}

std::optional<Triad> read_scaled(std::span<const std::uint8_t> data, double scale) noexcept {
  const auto raw = read_raw(data);
  if (!raw) return std::nullopt;
  return Triad{scale * (*raw)[0], scale * (*raw)[1], scale * (*raw)[2]};
}

std::optional<Triad> read_delta_v(std::span<const std::uint8_t> data) noexcept {
  if (data.size() < size_of(Item::kDeltaV)) return std::nullopt;
  return read_scaled(data, std::ldexp(1.0, -static_cast<int>(data[kExponentAt])));
}

std::optional<std::array<double, 4>> read_delta_q(std::span<const std::uint8_t> data) noexcept {
  if (data.size() < size_of(Item::kDeltaQ)) return std::nullopt;
  std::array<double, 4> q{};
  for (std::size_t i = 0; i < q.size(); ++i) q[i] = kUnitQuaternion * read_be<std::int16_t>(data, 2 * i);
  return q;
}

}  // namespace imuscope::xsens_can
