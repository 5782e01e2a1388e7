#include <set>

#include "files.h"

namespace imuscope::mcap {
namespace {

TEST(Damage, WhatIsNoMcapFileIsRefused) {
  EXPECT_FALSE(Reader::open("/nowhere/at_all.mcap"));
  EXPECT_FALSE(Reader::open("/tmp"));
  const TemporaryFile text("time,value\n1,2\n");
  EXPECT_FALSE(Reader::open(text.path()));
  const TemporaryFile empty("");
  EXPECT_FALSE(Reader::open(empty.path()));
}

/// Whatever one byte becomes, every message that comes is one that was written, in its order, and a loss is
/// told.
TEST(Damage, AChangedByteCostsAtMostItsChunk) {
  constexpr int kMessages = 60;
  const std::string file = written(Compression::kZstd, kMessages);
  const auto whole = read_file(file);
  std::set<std::string> known;
  for (const auto& message : whole.messages) known.insert(message.data);
  for (std::size_t at = kMagic.size(); at < file.size(); at += 3) {
    std::string damaged = file;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x41);
    const auto read = read_file(damaged);
    for (const auto& message : read.messages) ASSERT_TRUE(known.contains(message.data)) << "byte " << at;
    // A chunk has about sixteen messages; the definitions of both topics stand in the first.
    if (at > file.size() / 3) {
      EXPECT_GE(read.messages.size(), kMessages - 20U) << "byte " << at;
    }
    if (read.messages.size() < whole.messages.size()) {
      EXPECT_FALSE(read.losses.empty()) << "byte " << at;
    }
  }
}

std::string with_chunk(std::uint64_t size, const std::string& compression, const std::string& packed,
                       std::uint64_t claims) {
  std::string file(text_of(kMagic));
  RecordWriter writer(file);
  const auto begun = writer.begin(Opcode::kChunk);
  writer.number(std::uint64_t{0});
  writer.number(std::uint64_t{0});
  writer.number(size);
  writer.number(std::uint32_t{0});
  writer.text(compression);
  writer.number(claims);
  writer.bytes(packed);
  writer.end(begun);
  return file;
}

TEST(Damage, ChunksThatClaimTooMuchAreRefusedBeforeMemoryIsMade) {
  constexpr auto kHuge = std::uint64_t{1} << 60U;
  EXPECT_FALSE(read_file(with_chunk(kHuge, "", "abc", 3)).losses.empty());
  EXPECT_FALSE(read_file(with_chunk(3, "", "abc", kHuge)).losses.empty());
  EXPECT_FALSE(read_file(with_chunk(100, "zstd", "no zstd at all", 14)).losses.empty());
  EXPECT_FALSE(read_file(with_chunk(100, "lz4", "no lz4 at all", 13)).losses.empty());
  const auto unknown = read_file(with_chunk(3, "bz2", "abc", 3));
  ASSERT_FALSE(unknown.losses.empty());
  EXPECT_NE(unknown.losses.front().find("'bz2'"), std::string::npos);
}

TEST(Damage, ABombIsRefused) {
  constexpr std::size_t kUnpacked = std::size_t{80} << 20U;
  for (const auto compression : {Compression::kZstd, Compression::kLz4}) {
    std::string packed;
    Packer(compression).pack(std::string(kUnpacked, '\0'), packed);
    const auto read =
        read_file(with_chunk(kUnpacked, std::string(name_of(compression)), packed, packed.size()));
    ASSERT_FALSE(read.losses.empty());
    // lz4 packs 255 to one at most: less than a real chunk of zeros could have.
    if (compression == Compression::kZstd) {
      EXPECT_NE(read.losses.front().find("a thousand times"), std::string::npos) << read.losses.front();
    }
  }
  // Less is claimed than is there: no more than that is unpacked.
  std::string packed;
  Packer(Compression::kZstd).pack(std::string(kUnpacked, '\0'), packed);
  EXPECT_FALSE(read_file(with_chunk(1000, "zstd", packed, packed.size())).losses.empty());
}

TEST(Damage, AMessageLongerThanItsChunkIsLost) {
  std::string inside;
  RecordWriter record(inside);
  record.number(static_cast<std::uint8_t>(Opcode::kMessage));
  record.number(std::uint64_t{1} << 40U);
  const auto read = read_file(with_chunk(inside.size(), "", inside, inside.size()));
  EXPECT_TRUE(read.messages.empty());
  EXPECT_FALSE(read.losses.empty());

  std::string goes_on = with_chunk(inside.size(), "", inside, inside.size());
  RecordWriter writer(goes_on);
  for (int i = 0; i < 3; ++i) {
    const auto begun = writer.begin(Opcode::kMetadata);
    writer.text("note"), writer.texts({});
    writer.end(begun);
  }
  const auto once = read_file(goes_on);
  ASSERT_FALSE(once.losses.empty());
  EXPECT_NE(once.losses.front().find(": 1 messages are damaged"), std::string::npos) << once.losses.front();
}

}  // namespace
}  // namespace imuscope::mcap
