// The scanner against headers that lie and blocks that nobody knows.
#include <gtest/gtest.h>

#include "drivers/ixblue_stdbin/messages.h"
#include "drivers/ixblue_stdbin/scanner.h"
#include "tests/drivers/ixblue_stdbin/telegram_builder.h"

namespace imuscope::ixblue_stdbin {
namespace {

using test::Bytes;
using test::TelegramBuilder;

std::vector<Bytes> scan(std::span<const Bytes> reads) {
  Scanner scanner;
  std::vector<Bytes> frames;
  Frame frame;
  for (const Bytes& read : reads) {
    std::span<const std::uint8_t> rest(read);
    while (!rest.empty()) {
      rest = rest.subspan(scanner.append(rest, {}));
      while (scanner.next(frame)) frames.emplace_back(frame.bytes.begin(), frame.bytes.end());
    }
  }
  while (scanner.next(frame, true)) frames.emplace_back(frame.bytes.begin(), frame.bytes.end());
  return frames;
}

TEST(StdBinStream, EveryByteBelongsToATelegramOrIsSkipped) {
  Bytes all{'I', 'X', 9, 1, 2, 3};
  for (std::uint8_t version = 2; version <= 5; ++version) {
    const Bytes frame =
        TelegramBuilder(version, version, 1).nav(0, TelegramBuilder::floats({1, 2, 3})).build();
    all.insert(all.end(), frame.begin(), frame.end());
  }
  all.push_back('I');
  Scanner scanner;
  Frame frame;
  std::size_t in_frames = 0;
  ASSERT_EQ(scanner.append(all, {}), all.size());
  while (scanner.next(frame, true)) in_frames += frame.bytes.size();
  EXPECT_EQ(in_frames + scanner.counters().bytes_skipped, all.size());
  EXPECT_EQ(scanner.counters().bytes_skipped, 7U);
}

TEST(StdBinStream, AHeaderThatContradictsItselfIsRefusedWithoutWaitingForItsBytes) {
  const auto telegram = [](std::uint32_t counter) {
    return TelegramBuilder(3, counter, counter).nav(0, TelegramBuilder::floats({1, 2, 3})).build();
  };
  Bytes bytes = telegram(0);
  const std::size_t changed = bytes.size() + 15;
  for (const std::uint32_t counter : {1U, 2U}) {
    const Bytes next = telegram(counter);
    bytes.insert(bytes.end(), next.begin(), next.end());
  }
  bytes[changed] = 7;  // announces 1800 bytes more than its blocks need
  Scanner scanner;
  Frame frame;
  ASSERT_EQ(scanner.append(bytes, {}), bytes.size());
  ASSERT_TRUE(scanner.next(frame));
  ASSERT_TRUE(scanner.next(frame));
  EXPECT_EQ(parse_telegram(frame.bytes).counter, 2U);
  EXPECT_EQ(scanner.counters().bad_lengths, 1U);
}

TEST(StdBinStream, AnUnknownExternalBlockLeavesTheRestUnreadAndTheFirstBlocksReadable) {
  const Bytes bytes = TelegramBuilder(4, 1, 1)
                          .nav(0, TelegramBuilder::floats({1, 2, 3}))
                          .external(13, Bytes(8, 1))
                          .external(23, Bytes(11, 2))
                          .external(25, Bytes(17, 3))
                          .build();
  const Bytes reads[] = {bytes};
  const auto frames = scan(reads);
  ASSERT_EQ(frames.size(), 1U);
  const Telegram telegram = parse_telegram(frames[0]);
  EXPECT_TRUE(telegram.rest_unread);
  EXPECT_FALSE(telegram.block(Nav::kAttitude).empty());
  EXPECT_NE(telegram.external_at[13], 0);
  EXPECT_EQ(telegram.external_at[25], 0);
}

TEST(StdBinStream, AnUnknownNavBlockIsJumpedOverByTheNavSizeOfV4) {
  const Bytes bytes = TelegramBuilder(4, 1, 1)
                          .nav(0, TelegramBuilder::floats({1, 2, 3}))
                          .nav(31, Bytes(9, 7))
                          .external(13, Bytes(8, 1))
                          .build();
  const Bytes reads[] = {bytes};
  const auto frames = scan(reads);
  ASSERT_EQ(frames.size(), 1U);
  const Telegram telegram = parse_telegram(frames[0]);
  EXPECT_TRUE(telegram.rest_unread);
  EXPECT_EQ(telegram.external_at[13], 27 + 12 + 9);
}

}  // namespace
}  // namespace imuscope::ixblue_stdbin
