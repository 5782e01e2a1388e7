#include "tests/drivers/all/protocol_streams.h"

#include <algorithm>
#include <bit>
#include <cstdio>

#include "drivers/greis/decoder.h"
#include "drivers/ixblue_stdbin/decoder.h"
#include "drivers/nmea/decoder.h"
#include "drivers/rtklib_pos/decoder.h"
#include "drivers/ubx/decoder.h"
#include "drivers/xsens_mt/decoder.h"
#include "tests/drivers/greis/message_builder.h"
#include "tests/drivers/ixblue_stdbin/telegram_builder.h"
#include "tests/drivers/nmea/sentence_builder.h"
#include "tests/drivers/ubx/message_builder.h"
#include "tests/drivers/xsens_mt/mt_frames.h"

namespace imuscope::test {
namespace {

namespace mt = xsens::test_frames;

constexpr int kImuRate_hz = 100;
constexpr int kGnssRate_hz = 10;
constexpr std::uint32_t kSecondOfDay = 45'296;  // 12:34:56

void append(Bytes& bytes, const Bytes& more) { bytes.insert(bytes.end(), more.begin(), more.end()); }

/// Makes the compiler hold the sum after each byte: without it the sums that are plain additions become sums
/// of sixteen bytes at a time at -O3, which is another algorithm.
template <typename Sum>
void hold(Sum& sum) {
  asm volatile("" : "+r"(sum));
}

std::uint32_t sum_of_bytes(std::span<const std::uint8_t> bytes) {
  std::uint32_t sum = 0;
  for (const std::uint8_t byte : bytes) hold(sum += byte);
  return sum;
}
std::uint32_t sum_of_8_bits(std::span<const std::uint8_t> bytes) {
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : bytes) hold(sum = static_cast<std::uint8_t>(sum + byte));
  return sum;
}
std::uint32_t exclusive_or(std::span<const std::uint8_t> bytes) {
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : bytes) hold(sum = static_cast<std::uint8_t>(sum ^ byte));
  return sum;
}
std::uint32_t rotated_exclusive_or(std::span<const std::uint8_t> bytes) {
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : bytes) hold(sum = static_cast<std::uint8_t>(std::rotl(sum, 2) ^ byte));
  return std::rotl(sum, 2);
}
std::uint32_t fletcher(std::span<const std::uint8_t> bytes) {
  std::uint8_t a = 0;
  std::uint8_t b = 0;
  for (const std::uint8_t byte : bytes) {
    hold(a = static_cast<std::uint8_t>(a + byte));
    hold(b = static_cast<std::uint8_t>(b + a));
  }
  return static_cast<std::uint32_t>(b) << 8U | a;
}

template <typename Decoder, typename Config>
std::function<std::unique_ptr<DeviceDecoder>()> maker(const Config& config) {
  return [config] { return std::make_unique<Decoder>(config); };
}

double noise(int i) { return 0.001 * (i % 97); }

ProtocolStream xsens_mtdata(int n) {
  ProtocolStream stream{"xsens_mt (MTData)", {}, {}, static_cast<std::size_t>(n), {}, sum_of_8_bits};
  for (int i = 0; i < n; ++i) {
    append(stream.bytes,
           mt::mtdata(static_cast<std::uint16_t>(i), {noise(i), -0.2, 9.8}, {0.01, noise(i), -0.03}));
  }
  stream.make_decoder = maker<xsens::MtDecoder>(xsens::MtDecoderConfig{});
  return stream;
}

ProtocolStream xsens_mtdata2(int n) {
  ProtocolStream stream{"xsens_mt (MTData2)", {}, {}, static_cast<std::size_t>(n), {}, sum_of_8_bits};
  for (int i = 0; i < n; ++i) {
    Bytes data;
    mt::append_item(data, 0x1020, mt::u16(static_cast<std::uint16_t>(i)));
    mt::append_item(data, 0x1060, mt::u32(static_cast<std::uint32_t>(100 * i)));
    mt::append_item(data, 0x4020, mt::floats({noise(i), -0.2, 9.8}));
    mt::append_item(data, 0x8020, mt::floats({0.01, noise(i), -0.03}));
    mt::append_item(data, 0xE020, mt::u32(3));
    append(stream.bytes, mt::frame(0x36, data));
  }
  stream.make_decoder = maker<xsens::MtDecoder>(xsens::MtDecoderConfig{});
  return stream;
}

ProtocolStream stdbin(int n) {
  // Two samples a telegram: IMU and attitude.
  ProtocolStream stream{"ixblue_stdbin (V5)", {}, {}, 2 * static_cast<std::size_t>(n), {}, sum_of_bytes};
  const auto floats = [](std::initializer_list<float> values) { return TelegramBuilder::floats(values); };
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::uint32_t>(i);
    const auto moving = static_cast<float>(noise(i));
    TelegramBuilder telegram(5, k, kSecondOfDay * 10'000 + 100 * k);
    telegram.nav(0, floats({10.0F, 2.0F, 3.0F}))
        .nav(1, floats({0.1F, 0.01F, 0.01F}))
        .nav(5, floats({moving, 0.0F, 0.0F}))
        .nav(6, floats({moving, 0.0F, 0.0F}))
        .nav(9, floats({1.0F, 2.0F, 0.0F}))
        .nav(13, TelegramBuilder::date(14, 3, 2026))
        .nav(17, TelegramBuilder::word(1U << 8U))
        .nav(28, floats({0.1F + moving, 0.2F, 9.8F}))
        .extended(2, floats({1.0F + moving, 2.0F, 3.0F}));
    append(stream.bytes, telegram.build());
  }
  stream.make_decoder = maker<ixblue_stdbin::Decoder>(ixblue_stdbin::DecoderConfig{});
  return stream;
}

ProtocolStream greis_epochs(int n) {
  ProtocolStream stream{"greis", {}, {}, static_cast<std::size_t>(n), {}, rotated_exclusive_or};
  for (int i = 0; i < n; ++i) {
    const auto tod_ms = static_cast<U32>(1000 * kSecondOfDay + 100 * static_cast<U32>(i));
    append(stream.bytes, lines({rt(tod_ms), rd(2026, 3, 14, 0), st(tod_ms, 4),
                                pg(0.85, 0.04, 106.5 + noise(i), 0.02F, 4), vg(1.5F, -0.5F, 0.25F, 0.05F, 4),
                                sg(0.01F, 0.015F, 0.02F, 0.03F, 4), to(1e-4), et(tod_ms)}));
  }
  stream.make_decoder = maker<greis::Decoder>(greis::DecoderConfig{});
  return stream;
}

ProtocolStream nmea_epochs(int n) {
  ProtocolStream stream{"nmea (GGA RMC GST)", {}, {}, static_cast<std::size_t>(n), {}, exclusive_or};
  for (int i = 0; i < n; ++i) {
    char time[16];
    const int tenths = i % 600;
    std::snprintf(time, sizeof time, "12%02d%02d.%d0", (i / 600) % 60, tenths / 10, tenths % 10);
    const std::string t(time);
    append(
        stream.bytes,
        bytes_of(sentence("GNGGA," + t + ",4851.39684,N,00221.13314,E,4,18,0.7,35.250,M,46.250,M,1.0,0123") +
                 sentence("GNRMC," + t + ",A,4851.39684,N,00221.13314,E,2.617,338.17,140326,,,R,V") +
                 sentence("GNGST," + t + ",0.010,0.014,0.011,45.0,0.012,0.013,0.020")));
  }
  stream.make_decoder = maker<nmea::Decoder>(nmea::DecoderConfig{});
  return stream;
}

ProtocolStream ubx_epochs(int n) {
  ProtocolStream stream{"ubx (NAV-PVT)", {}, {}, static_cast<std::size_t>(n), {}, fletcher};
  for (int i = 0; i < n; ++i) {
    append(stream.bytes, ubx_nav_pvt(400'000'000 + 100 * static_cast<std::uint32_t>(i)));
  }
  stream.make_decoder = maker<ubx::Decoder>(ubx::DecoderConfig{});
  return stream;
}

ProtocolStream rtklib_lines(int n) {
  ProtocolStream stream{"rtklib_pos (LLH)", {}, {}, static_cast<std::size_t>(n), {}, {}};
  append(
      stream.bytes,
      bytes_of("%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   "
               "sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n"));
  for (int i = 0; i < n; ++i) {
    char line[200];
    const int tenths = i % 600;
    std::snprintf(line, sizeof line,
                  "2026/03/14 12:%02d:%02d.%d00   48.856614000    2.352219000    81.5000   1  12   0.0100   "
                  "0.0110   0.0200  -0.0010   0.0020   0.0030   0.10   12.3\n",
                  (i / 600) % 60, tenths / 10, tenths % 10);
    append(stream.bytes, bytes_of(line));
  }
  stream.make_decoder = maker<rtklib_pos::Decoder>(rtklib_pos::DecoderConfig{});
  return stream;
}

}  // namespace

std::vector<ProtocolStream> protocol_streams(int seconds) {
  std::vector<ProtocolStream> streams{
      xsens_mtdata(kImuRate_hz * seconds), xsens_mtdata2(kImuRate_hz * seconds),
      stdbin(kImuRate_hz * seconds),       greis_epochs(kGnssRate_hz * seconds),
      nmea_epochs(kGnssRate_hz * seconds), ubx_epochs(kGnssRate_hz * seconds),
      rtklib_lines(kGnssRate_hz * seconds)};
  for (auto& stream : streams) stream.lasts = std::chrono::seconds(seconds);
  return streams;
}

void push_in_reads(const ProtocolStream& stream, std::size_t read_size, DeviceDecoder& decoder,
                   SampleSink& sink) {
  const double ns_per_byte =
      static_cast<double>(stream.lasts.count()) / static_cast<double>(stream.bytes.size());
  const std::span<const std::uint8_t> bytes(stream.bytes);
  for (std::size_t at = 0; at < bytes.size(); at += read_size) {
    const auto read = bytes.subspan(at, std::min(read_size, bytes.size() - at));
    const auto end = static_cast<double>(at + read.size());
    decoder.push(read, host_time_from_ns(static_cast<std::int64_t>(end * ns_per_byte)), sink);
  }
}

}  // namespace imuscope::test
