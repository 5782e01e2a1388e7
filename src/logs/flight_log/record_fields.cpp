#include "logs/flight_log/record_fields.h"

#include <bit>

namespace imuscope::flight_log {
namespace {

constexpr std::array<std::size_t, 10> kSizes{1, 1, 2, 2, 4, 4, 8, 8, 4, 8};

}  // namespace

std::size_t size_of(NumberKind kind) noexcept { return kSizes[static_cast<std::size_t>(kind)]; }

void Layout::add(std::string name, NumberKind kind, std::size_t count, double scale) {
  entries_.push_back({std::move(name), kind, size_, count, scale});
  size_ += size_of(kind) * count;
}

const Layout::Entry* Fields::entry(std::string_view name) const noexcept {
  for (const auto& entry : layout_.entries_) {
    if (entry.name == name) return &entry;
  }
  return nullptr;
}

bool Fields::is_float(std::string_view name) const noexcept {
  const auto* found = entry(name);
  return found != nullptr && (found->kind == NumberKind::kF32 || found->kind == NumberKind::kF64);
}

std::optional<double> Fields::number(std::string_view name, std::size_t index) const noexcept {
  const auto* found = entry(name);
  if (found == nullptr || index >= found->count) return std::nullopt;
  const std::size_t size = size_of(found->kind);
  const std::size_t at = found->offset + index * size;
  if (at + size > record_.size()) return std::nullopt;
  mcap::RecordReader in(record_.subspan(at));
  double value = 0.0;
  switch (found->kind) {
    case NumberKind::kI8:
      value = in.number<std::int8_t>();
      break;
    case NumberKind::kU8:
      value = in.number<std::uint8_t>();
      break;
    case NumberKind::kI16:
      value = in.number<std::int16_t>();
      break;
    case NumberKind::kU16:
      value = in.number<std::uint16_t>();
      break;
    case NumberKind::kI32:
      value = in.number<std::int32_t>();
      break;
    case NumberKind::kU32:
      value = in.number<std::uint32_t>();
      break;
    case NumberKind::kI64:
      value = static_cast<double>(in.number<std::int64_t>());
      break;
    case NumberKind::kU64:
      value = static_cast<double>(in.number<std::uint64_t>());
      break;
    case NumberKind::kF32:
      value = std::bit_cast<float>(in.number<std::uint32_t>());
      break;
    case NumberKind::kF64:
      value = std::bit_cast<double>(in.number<std::uint64_t>());
      break;
  }
  return value * found->scale;
}

std::optional<double> Fields::first_of(std::initializer_list<std::string_view> names) const noexcept {
  for (const auto name : names) {
    if (const auto value = number(name)) return value;
  }
  return std::nullopt;
}

std::optional<std::array<double, 3>> Fields::three(std::string_view x, std::string_view y,
                                                   std::string_view z) const noexcept {
  const auto a = number(x);
  const auto b = number(y);
  const auto c = number(z);
  if (!a || !b || !c) return std::nullopt;
  return std::array{*a, *b, *c};
}

std::optional<std::array<double, 3>> Fields::three(std::string_view name) const noexcept {
  const auto z = number(name, 2);
  if (!z) return std::nullopt;
  return std::array{*number(name, 0), *number(name, 1), *z};
}

}  // namespace imuscope::flight_log
