#pragma once

/// The MCAP container as its specification has it (mcap.dev/spec, version 0): magic, kinds of records, limits
/// of ours.

#include <array>
#include <cstddef>
#include <cstdint>

namespace imuscope::mcap {

inline constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

/// Opcode and length before every record.
inline constexpr std::size_t kRecordHead = 1 + sizeof(std::uint64_t);
/// Content of a footer: summary_start, summary_offset_start, summary_crc.
inline constexpr std::size_t kFooterContent = 8 + 8 + 4;

/// Largest chunk, as it stands in the file and as it is unpacked, and largest message, that is read. Writers
/// make chunks of one to some megabytes.
inline constexpr std::uint64_t kChunkMost = std::uint64_t{256} << 20U;
/// All schemas and channels of a file together.
inline constexpr std::uint64_t kDefinitionsMost = std::uint64_t{64} << 20U;
/// Largest summary that is looked at.
inline constexpr std::uint64_t kSummaryMost = std::uint64_t{256} << 20U;
/// A file unpacks to so many times its size and kUnpackedFree: what unpacks to more is no recording but a
/// bomb.
inline constexpr std::uint64_t kUnpackedShare = 1000;
inline constexpr std::uint64_t kUnpackedFree = std::uint64_t{64} << 20U;

}  // namespace imuscope::mcap
