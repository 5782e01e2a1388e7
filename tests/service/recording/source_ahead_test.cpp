#include "service/recording/source_ahead.h"

#include <gtest/gtest.h>
#include <algorithm>

namespace imuscope {
namespace {

constexpr int kReadsOfMany = 5000;  // several blocks

/// Reads of growing length, the bytes of which stand only until the next one.
class MadeSource final : public ByteSource {
 public:
  /// @param fails_after  so many reads; never where it is negative
  explicit MadeSource(int reads, int fails_after = -1) : reads_(reads), fails_after_(fails_after) {}

  Result<std::optional<RecordedRead>> next() override {
    if (at_ == fails_after_)
      return tl::unexpected<Error>(Error{ErrorKind::kWork, "the disk is gone", "look"});
    if (at_ == reads_) return std::optional<RecordedRead>{};
    bytes_.assign(static_cast<std::size_t>(at_ % 700), static_cast<std::uint8_t>(at_));
    RecordedRead read{host_time_from_ns(1'000'000'000 + at_), bytes_};
    if (at_ % 3 == 0) read.per_byte = Duration{at_};
    if (at_ % 5 == 0) read.received = host_time_from_ns(2'000'000'000 + at_);
    ++at_;
    return std::optional<RecordedRead>{read};
  }
  [[nodiscard]] std::uint64_t bytes_read() const override { return 0; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return 77; }

 private:
  int reads_;
  int fails_after_;
  int at_ = 0;
  std::vector<std::uint8_t> bytes_;
};

TEST(SourceAhead, GivesWhatTheSourceGives) {
  MadeSource plain(kReadsOfMany);
  SourceAhead ahead(std::make_unique<MadeSource>(kReadsOfMany));
  std::uint64_t bytes = 0;
  for (int i = 0; i < kReadsOfMany; ++i) {
    const auto expected = plain.next();
    const auto read = ahead.next();
    ASSERT_TRUE(read && *read) << i;
    ASSERT_EQ((*read)->arrival, (*expected)->arrival) << i;
    ASSERT_EQ((*read)->per_byte, (*expected)->per_byte) << i;
    ASSERT_EQ((*read)->received, (*expected)->received) << i;
    ASSERT_TRUE(std::ranges::equal((*read)->bytes, (*expected)->bytes)) << i;
    bytes += (*read)->bytes.size();
    ASSERT_EQ(ahead.bytes_read(), bytes) << "what was handed out, not what was read";
  }
  EXPECT_EQ(ahead.bytes_total(), 77U);
  EXPECT_FALSE(*ahead.next());
  EXPECT_FALSE(*ahead.next()) << "the end stays the end";
}

TEST(SourceAhead, AnErrorComesAfterAllThatWasReadBeforeIt) {
  for (const int good : {0, 3, 1500}) {
    SourceAhead ahead(std::make_unique<MadeSource>(kReadsOfMany, good));
    for (int i = 0; i < good; ++i) {
      const auto read = ahead.next();
      ASSERT_TRUE(read && *read) << i;
    }
    const auto failed = ahead.next();
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error().what, "the disk is gone");
    EXPECT_FALSE(ahead.next()) << "it stays";
  }
}

TEST(SourceAhead, EndsWhereverItIsLeft) {
  for (const int taken : {0, 1, 2000}) {
    SourceAhead ahead(std::make_unique<MadeSource>(1'000'000));
    for (int i = 0; i < taken; ++i) ASSERT_TRUE(*ahead.next());
  }
}

}  // namespace
}  // namespace imuscope
