#include <algorithm>

#include "files.h"

namespace imuscope::mcap {
namespace {

class EveryCompression : public testing::TestWithParam<Compression> {};
INSTANTIATE_TEST_SUITE_P(Container, EveryCompression,
                         testing::Values(Compression::kNone, Compression::kZstd, Compression::kLz4));

TEST_P(EveryCompression, WhatIsWrittenIsReadInItsOrder) {
  constexpr int kMessages = 200;
  const auto read = read_file(written(GetParam(), kMessages));
  ASSERT_EQ(read.messages.size(), static_cast<std::size_t>(kMessages));
  for (int i = 0; i < kMessages; ++i) {
    const auto& message = read.messages[static_cast<std::size_t>(i)];
    EXPECT_EQ(message, (Kept{i % 2 == 0 ? "/even" : "/odd", 1000U + static_cast<unsigned>(i), data_of(i)}));
  }
  EXPECT_TRUE(read.losses.empty()) << read.losses.front();
}

TEST_P(EveryCompression, AFileThatEndsAnywhereIsReadToItsEndAndSaysSo) {
  const std::string file = written(GetParam(), 60);
  std::size_t most = 0;
  for (std::size_t size = kMagic.size(); size < file.size(); ++size) {
    const auto read = read_file(file.substr(0, size));
    EXPECT_FALSE(read.losses.empty()) << "cut at " << size;
    for (std::size_t i = 0; i < read.messages.size(); ++i)
      ASSERT_EQ(read.messages[i].data, data_of(static_cast<int>(i))) << "cut at " << size;
    EXPECT_GE(read.messages.size(), most) << "more of a file holds no fewer messages; cut at " << size;
    most = std::max(most, read.messages.size());
  }
  EXPECT_EQ(most, 60U);
}

TEST(Container, APartOfTheLastChunkIsRead) {
  const std::string file = written(Compression::kNone, 10);  // one chunk
  const auto at = file.find(data_of(8));
  const auto read = read_file(file.substr(0, at));
  EXPECT_EQ(read.messages.size(), 8U);
}

TEST(Container, MessagesOutsideOfChunksAreRead) {
  std::string file(text_of(kMagic));
  RecordWriter writer(file);
  const auto record = [&](Opcode opcode, auto&& fields) {
    const auto begun = writer.begin(opcode);
    fields();
    writer.end(begun);
  };
  record(Opcode::kHeader, [&] { writer.text(""), writer.text("by hand"); });
  record(Opcode::kSchema, [&] {
    writer.number(std::uint16_t{3});
    writer.text("sensor_msgs/msg/Imu"), writer.text("ros2msg"), writer.text("");
  });
  record(Opcode::kChannel, [&] {
    writer.number(std::uint16_t{9}), writer.number(std::uint16_t{3});
    writer.text("/imu"), writer.text("cdr"), writer.texts({});
  });
  record(Opcode::kMessage, [&] {
    writer.number(std::uint16_t{9}), writer.number(std::uint32_t{0});
    writer.number(std::uint64_t{12}), writer.number(std::uint64_t{11});
    writer.bytes("hello");
  });
  const TemporaryFile on_disk(file);
  auto reader = Reader::open(on_disk.path());
  ASSERT_TRUE(reader);
  const auto message = reader->next();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->topic->name, "/imu");
  EXPECT_EQ(message->topic->schema, "sensor_msgs/msg/Imu");
  EXPECT_EQ(message->log_time, 12U);
  EXPECT_EQ(message->publish_time, 11U);
  EXPECT_EQ(text_of(message->data), "hello");
  EXPECT_FALSE(reader->next());
}

/// A writer's promises, held against its own file, record by record.
TEST(Container, CrcsOffsetsAndCountsAreRight) {
  const std::string file = written(Compression::kZstd, 60);
  const Bytes all = bytes_of(file);
  Bytes rest = all.subspan(kMagic.size());
  std::map<Opcode, int> counts;
  std::uint64_t summary_start = 0;
  for (auto record = record_at(rest); record; record = record_at(rest)) {
    const auto offset = static_cast<std::size_t>(rest.data() - all.data());
    ++counts[record->opcode];
    RecordReader fields(record->content);
    if (record->opcode == Opcode::kDataEnd) {
      EXPECT_EQ(fields.number<std::uint32_t>(), crc32_of(all.first(offset)));
      summary_start = offset + record->size;
    }
    if (record->opcode == Opcode::kChunkIndex) {
      (void)fields.bytes(16);
      const auto chunk = record_at(all.subspan(fields.number<std::uint64_t>()));
      ASSERT_TRUE(chunk);
      EXPECT_EQ(chunk->opcode, Opcode::kChunk);
      EXPECT_EQ(fields.number<std::uint64_t>(), chunk->size);
    }
    if (record->opcode == Opcode::kSummaryOffset) {
      const auto opcode = static_cast<Opcode>(fields.number<std::uint8_t>());
      const auto first = record_at(all.subspan(fields.number<std::uint64_t>()));
      ASSERT_TRUE(first);
      EXPECT_EQ(first->opcode, opcode);
    }
    if (record->opcode == Opcode::kAttachmentIndex) {
      const auto attachment = record_at(all.subspan(fields.number<std::uint64_t>()));
      ASSERT_TRUE(attachment);
      EXPECT_EQ(attachment->opcode, Opcode::kAttachment);
      const Bytes content = attachment->content;
      EXPECT_EQ(RecordReader(content.last(4)).number<std::uint32_t>(),
                crc32_of(content.first(content.size() - 4)));
    }
    if (record->opcode == Opcode::kStatistics) {
      EXPECT_EQ(fields.number<std::uint64_t>(), 60U);
      EXPECT_EQ(fields.number<std::uint16_t>(), 1U) << "schemas";
      EXPECT_EQ(fields.number<std::uint32_t>(), 2U) << "channels";
      EXPECT_EQ(fields.number<std::uint32_t>(), 1U) << "attachments";
      EXPECT_EQ(fields.number<std::uint32_t>(), 1U) << "metadata";
      EXPECT_EQ(fields.number<std::uint32_t>(), static_cast<std::uint32_t>(counts[Opcode::kChunk]));
      EXPECT_EQ(fields.number<std::uint64_t>(), 1000U) << "the first message's time";
      EXPECT_EQ(fields.number<std::uint64_t>(), 1059U) << "the last message's time";
      // The messages of each channel.
      EXPECT_EQ(fields.number<std::uint32_t>(), 2 * (sizeof(std::uint16_t) + sizeof(std::uint64_t)));
      for (const auto channel : {std::uint16_t{1}, std::uint16_t{2}}) {
        EXPECT_EQ(fields.number<std::uint16_t>(), channel);
        EXPECT_EQ(fields.number<std::uint64_t>(), 30U) << "channel " << channel;
      }
      EXPECT_TRUE(fields.good() && fields.rest().empty());
    }
    if (record->opcode == Opcode::kFooter) {
      EXPECT_EQ(fields.number<std::uint64_t>(), summary_start);
      (void)fields.number<std::uint64_t>();
      const Bytes summed = all.subspan(summary_start, offset + kRecordHead + 16 - summary_start);
      EXPECT_EQ(fields.number<std::uint32_t>(), crc32_of(summed));
    }
    rest = rest.subspan(record->size);
  }
  EXPECT_EQ(text_of(rest), text_of(kMagic));
  EXPECT_EQ(counts[Opcode::kFooter], 1);
  EXPECT_EQ(counts[Opcode::kChunk], counts[Opcode::kChunkIndex]);
  EXPECT_GT(counts[Opcode::kChunk], 1);
  EXPECT_EQ(counts[Opcode::kAttachmentIndex], 1);
  EXPECT_EQ(counts[Opcode::kMetadataIndex], 1);
}

}  // namespace
}  // namespace imuscope::mcap
