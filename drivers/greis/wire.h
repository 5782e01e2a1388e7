#pragma once

/// Javad / Topcon GREIS as it stands on the wire: two id characters, three upper-case hex digits of body
/// length, body. Numbers in bodies least significant byte first. Bodies may grow with the firmware: known
/// fields are read from the front, the checksum always from the end.

#include <cstddef>
#include <cstdint>

namespace imuscope::greis {

inline constexpr std::size_t kIdSize = 2;
inline constexpr std::size_t kHeaderSize = 5;
inline constexpr std::size_t kBodyMax = 0xFFF;
inline constexpr std::size_t kMessageMax = kHeaderSize + kBodyMax;
/// Range of the two id characters; a byte from kTextMin to kTextMax in place of an id opens a line of text.
inline constexpr std::uint8_t kIdMin = 48;
inline constexpr std::uint8_t kIdMax = 126;
inline constexpr std::uint8_t kTextMin = 33;
inline constexpr std::uint8_t kTextMax = 47;
/// Lines of text (NMEA of an RTK receiver included) are shorter.
inline constexpr std::size_t kTextLineMax = 256;

/// A message id as one number, to compare and to switch on.
constexpr std::uint16_t id_of(char first, char second) noexcept {
  return static_cast<std::uint16_t>(static_cast<unsigned char>(first) << 8U |
                                    static_cast<unsigned char>(second));
}

inline constexpr std::uint16_t kReceiverTime = id_of('~', '~');  // RT: opens an epoch
inline constexpr std::uint16_t kEpochTime = id_of(':', ':');     // ET: closes it
inline constexpr std::uint16_t kReceiverDate = id_of('R', 'D');
inline constexpr std::uint16_t kGpsTime = id_of('G', 'T');
inline constexpr std::uint16_t kTimeOffset = id_of('T', 'O');
inline constexpr std::uint16_t kUtcOffset = id_of('U', 'O');
inline constexpr std::uint16_t kSolutionTime = id_of('S', 'T');
inline constexpr std::uint16_t kPositionEcef = id_of('P', 'O');
inline constexpr std::uint16_t kVelocityEcef = id_of('V', 'E');
inline constexpr std::uint16_t kPositionVelocityEcef = id_of('P', 'V');
inline constexpr std::uint16_t kPositionGeodetic = id_of('P', 'G');
inline constexpr std::uint16_t kVelocityGeodetic = id_of('V', 'G');
inline constexpr std::uint16_t kSigmas = id_of('S', 'G');
inline constexpr std::uint16_t kDop = id_of('D', 'P');
inline constexpr std::uint16_t kPositionCovariance = id_of('S', 'P');
inline constexpr std::uint16_t kVelocityCovariance = id_of('S', 'V');
// Messages that are text and carry no binary checksum.
inline constexpr std::uint16_t kFileIdentifier = id_of('J', 'P');
inline constexpr std::uint16_t kReply = id_of('R', 'E');
inline constexpr std::uint16_t kErrorReply = id_of('E', 'R');
// Messages that are text and end with their checksum in two hex digits.
inline constexpr std::uint16_t kMessagesFormat = id_of('M', 'F');
inline constexpr std::uint16_t kParameter = id_of('P', 'M');

// Messages that end with a CRC-16.
inline constexpr std::uint16_t kReferenceEpoch = id_of('r', 'E');
inline constexpr std::uint16_t kReferenceMeasurements = id_of('r', 'M');
inline constexpr std::uint16_t kReferenceVelocity = id_of('r', 'V');
inline constexpr std::size_t kCrcSize = 2;

/// Shortest body, checksum included, of the messages that are read. 0: not one of them.
constexpr std::size_t body_min(std::uint16_t id) noexcept {
  switch (id) {
    case kReceiverTime:
    case kEpochTime:
      return 5;
    case kReceiverDate:
    case kSolutionTime:
      return 6;
    case kGpsTime:
      return 7;
    case kTimeOffset:
      return 17;
    case kUtcOffset:
      return 24;
    case kPositionEcef:
    case kPositionGeodetic:
      return 30;
    case kPositionVelocityEcef:
      return 46;
    case kVelocityEcef:
    case kVelocityGeodetic:
    case kSigmas:
      return 18;
    case kDop:
      return 14;  // of old firmware, without the east DOP
    case kPositionCovariance:
    case kVelocityCovariance:
      return 42;
    default:
      return 0;
  }
}
/// A known message that has grown by more than this is taken for a damaged length.
inline constexpr std::size_t kBodyGrowthMax = 32;

/// Time base of [RD].
enum class TimeBase : std::uint8_t { kGps = 0, kUtcUsno = 1, kGlonass = 2, kUtcSu = 3 };

/// GLONASS time is UTC(SU) plus three hours.
inline constexpr std::int64_t kGlonassMinusUtcMs = 3LL * 3600 * 1000;

inline constexpr std::int64_t kMsPerDay = 86'400'000;
inline constexpr std::int64_t kWeeksPerRollover = 1024;
/// [GT] gives the GPS week modulo 1024. Weeks are taken from this one on, that of 2017-01-01: right until
/// August 2036.
inline constexpr std::int64_t kFirstWeek = 1930;

/// The position sigma is a spherical error probable: radius of the sphere that holds half of the errors. For
/// equal sd in three axes it is this many times the sd (median of the chi distribution with 3 degrees).
inline constexpr double kSepPerSd = 1.5381722544550522;

}  // namespace imuscope::greis
