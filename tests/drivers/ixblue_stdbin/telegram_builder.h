#pragma once

/// Builds StdBin telegrams for tests, written from the protocol's layout and not from the decoder.

#include <bit>
#include <cstdint>
#include <map>

#include "tests/drivers/support/streams.h"

namespace imuscope::test {

class TelegramBuilder {
 public:
  explicit TelegramBuilder(std::uint8_t version, std::uint32_t counter, std::uint32_t validity_ticks)
      : version_(version), counter_(counter), validity_ticks_(validity_ticks) {}

  static Bytes floats(std::initializer_list<float> values) {
    Bytes bytes;
    for (const float value : values) put(bytes, std::bit_cast<std::uint32_t>(value), 4);
    return bytes;
  }
  static Bytes word(std::uint32_t value) {
    Bytes bytes;
    put(bytes, value, 4);
    return bytes;
  }
  static Bytes date(std::uint8_t day, std::uint8_t month, std::uint16_t year) {
    Bytes bytes{day, month};
    put(bytes, year, 2);
    return bytes;
  }

  TelegramBuilder& nav(unsigned bit, Bytes block) { return add(nav_, bit, std::move(block)); }
  TelegramBuilder& extended(unsigned bit, Bytes block) { return add(extended_, bit, std::move(block)); }
  TelegramBuilder& external(unsigned bit, Bytes block) { return add(external_, bit, std::move(block)); }

  [[nodiscard]] Bytes build() const {
    const std::size_t header = version_ == 2 ? 21 : version_ == 3 ? 25 : 27;
    const std::size_t inside = size(nav_) + size(extended_);
    const std::size_t total = header + inside + size(external_) + 4;
    Bytes bytes{'I', 'X', version_};
    put(bytes, mask(nav_), 4);
    if (version_ > 2) put(bytes, mask(extended_), 4);
    put(bytes, mask(external_), 4);
    if (version_ > 3) put(bytes, inside, 2);
    put(bytes, total, 2);
    put(bytes, validity_ticks_, 4);
    put(bytes, counter_, 4);
    for (const Blocks* blocks : {&nav_, &extended_, &external_}) {
      for (const auto& [bit, block] : *blocks) bytes.insert(bytes.end(), block.begin(), block.end());
    }
    std::uint32_t sum = 0;
    for (const std::uint8_t byte : bytes) sum += byte;
    put(bytes, sum, 4);
    return bytes;
  }

 private:
  using Blocks = std::map<unsigned, Bytes>;

  TelegramBuilder& add(Blocks& blocks, unsigned bit, Bytes block) {
    blocks[bit] = std::move(block);
    return *this;
  }
  static void put(Bytes& bytes, std::uint64_t value, int size) {
    for (int i = size - 1; i >= 0; --i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  }
  static std::size_t size(const Blocks& blocks) {
    std::size_t sum = 0;
    for (const auto& [bit, block] : blocks) sum += block.size();
    return sum;
  }
  static std::uint32_t mask(const Blocks& blocks) {
    std::uint32_t bits = 0;
    for (const auto& [bit, block] : blocks) bits |= 1U << bit;
    return bits;
  }

  std::uint8_t version_;
  std::uint32_t counter_;
  std::uint32_t validity_ticks_;
  Blocks nav_, extended_, external_;
};

}  // namespace imuscope::test
