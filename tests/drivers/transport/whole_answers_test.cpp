// What is read of logs, stamps and clocks, and what is said of interfaces, held whole as it once was.
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <sys/socket.h>

#include <cstring>
#include <fstream>
#include <random>

#include "drivers/transport/can_interface.h"
#include "drivers/transport/candump.h"
#include "drivers/transport/kernel_stamp.h"
#include "drivers/transport/steering_watch.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using namespace std::chrono_literals;
using test::expect_recorded;
using test::in_groups;

/// With a mark between digits: a line is held letter by letter, not as the numbers in it.
std::string by_letters(const std::string& line) {
  std::string text;
  for (const char c : line) {
    const bool is_digit = c >= '0' && c <= '9';
    if (is_digit && !text.empty() && text.back() >= '0' && text.back() <= '9') text += '\'';
    text += c;
  }
  return text;
}

std::string line_text(std::string_view line) {
  const CandumpLine read = read_candump_line(line);
  if (read.kind == CandumpLine::Kind::kRemark) return fmt::format("remark {}", read.drops_total);
  if (read.kind == CandumpLine::Kind::kError) return fmt::format("error {}", read.why);
  const CanFrame& f = read.frame.frame;
  return fmt::format("{} {} {:X} {}{}{}{}{}{} {} {} {} -> {}", in_groups(to_ns(f.stamp)),
                     read.frame.interface, f.id, f.is_extended ? "x" : "-", f.is_remote ? "r" : "-",
                     f.is_error ? "e" : "-", f.is_fd ? "f" : "-", f.bit_rate_switched ? "b" : "-",
                     f.sender_error_state ? "s" : "-", f.length, f.raw_dlc, test::hex_text(f.payload()),
                     by_letters(candump_line(read.frame)));
}

TEST(TransportWhole, LinesOfCandump) {
  std::string text;
  for (const char* line : {"(1772000000.010100) can0 0AA#0102",
                           "(1772000000.010100123) can0 0AA#0102 R",
                           "(1772000000) can0 7FF# T",
                           "(0.5) c 00000001#R",
                           "(9000000000.0) c 1FFFFFFF#R8",
                           "(9000000001.0) c 1FFFFFFF#R8",
                           "(1.0) c 800#",
                           "(1.0) c 20000004#0001020304050607",
                           "(1.0) c 3FFFFFFF#00",
                           "(1.0) c 40000000#00",
                           "(1.0) c 12345678#",
                           "(1.0) c 0A#",
                           "(1.0) c 0AAA#",
                           "(1.0) c 0AG#",
                           "(1.0) c G0000001#",
                           "(1.0) c 0AA",
                           "(1.0) c 0AA 00",
                           "(1.0) c 0AA#0",
                           "(1.0) c 0AA#0G",
                           "(1.0) c 0AA#00.11.22",
                           "(1.0) c 0AA#0011223344556677",
                           "(1.0) c 0AA#001122334455667788",
                           "(1.0) c 0AA#0011223344556677_9",
                           "(1.0) c 0AA#0011223344556677_F",
                           "(1.0) c 0AA#0011223344556677_8",
                           "(1.0) c 0AA#0011223344556677_",
                           "(1.0) c 0AA#00112233445566_9",
                           "(1.0) c 0AA#R8_A",
                           "(1.0) c 0AA#R9",
                           "(1.0) c 0AA#R0",
                           "(1.0) c 0AA##0",
                           "(1.0) c 0AA##1001122",
                           "(1.0) c 0AA##200112233445566778899AABB",
                           "(1.0) c 0AA##3001122334455667788",
                           "(1.0) c 0AA##",
                           "(1.0) c 0AA##G",
                           "(1.0) c 0AA##F00 X",
                           "(1.0) c 0AA#00 X",
                           "(1.0) c 0AA#00 R T",
                           "(1.0)  0AA#00",
                           "(1.0) fifteen_letters 0AA#00",
                           "(1.0) sixteen__letters 0AA#00",
                           "(1.0)c 0AA#00",
                           "1.0) c 0AA#00",
                           "(1.0 c 0AA#00",
                           "(x.0) c 0AA#00",
                           "(1.x) c 0AA#00",
                           "(1.0123456789) c 0AA#00",
                           "(1.012345678) c 0AA#00",
                           "(-1.0) c 0AA#00",
                           "() c 0AA#00",
                           "",
                           " \r ",
                           "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 17)",
                           "DROPCOUNT",
                           "DROPCOUNT total drops x)",
                           "(1.0) can0",
                           "(1.0) can0 0AA#00\r",
                           "(1.0) c 0aa#aBcD"}) {
    text += fmt::format("{} | {}\n", line, line_text(line));
  }
  const std::string whole = "(1772000000.010100) can0 18FF0100##10102030405060708090A0B0C R";
  for (const char other : {'0', 'G', ' '}) {
    text += test::at_every_place(
        whole.size(),
        [&](std::size_t at) {
          std::string changed = whole;
          changed[at] = other;
          return changed;
        },
        [](const std::string& line) { return line_text(line); });
  }
  for (int n = 0; n <= 66; ++n) {
    std::string line = "(1.0) c 0AA##0";
    for (int i = 0; i < n; ++i) line += "5A";
    text += fmt::format("{} {}\n", n, line_text(line).substr(0, 30));
  }
  for (const std::int64_t ns : {std::int64_t{0}, std::int64_t{999}, std::int64_t{1000},
                                std::int64_t{1'234'567'891'000}, std::int64_t{1'234'567'891'001}}) {
    CandumpFrame frame;
    frame.interface = "can0";
    frame.frame.stamp = host_time_from_ns(ns);
    text += by_letters(candump_line(frame)) + '\n';
  }
  expect_recorded("drivers/transport/candump.txt", text);
}

TEST(TransportWhole, FilesOfCandump) {
  std::string text;
  const auto file = test::scratch_folder() / "some.log";
  const std::string good = "(1.0) can0 0AA#01\n";
  std::string junk;
  for (int i = 0; i < 99; ++i) junk += "junk\n";
  const auto after = [&](std::string before) { return before.append(good); };
  const auto after_line_of = [&](std::size_t length) { return after(std::string(length, 'x').append("\n")); };
  for (const std::string& content :
       {std::string(), good,
        after(good + "junk\n\nmore junk\n")
            .append("DROPCOUNT (total drops 5)\nDROPCOUNT (total drops 3)\n(2.0) can0 0AA#01"),
        std::string("junk\n"), std::string("\n\n"), after(junk), after(junk + "junk\n"), after_line_of(510),
        after_line_of(511), after_line_of(512), after_line_of(600), good + after_line_of(600),
        std::string("(1.0) can0 0AA#01"), std::string("(1.0) can0 0AA#01").append(600, ' ').append("\n")}) {
    std::ofstream(file, std::ios::binary) << content;
    auto log = CandumpLog::open(file);
    text += fmt::format("{} looks {}: ", content.size(), CandumpLog::looks_like_one(file));
    if (!log) {
      text += log.error().text().substr(file.string().size()) + '\n';
      continue;
    }
    int n = 0;
    while (log->next() != nullptr) ++n;
    text += fmt::format("{} frames, line {}, {} bytes, {} bad, '{}', {} drops\n", n, log->line(),
                        log->bytes_read(), log->bad_lines(), log->first_problem(), log->drops_total());
  }
  for (const auto& other : {file.parent_path(), file.parent_path() / "none.log"})
    text += CandumpLog::open(other).error().text().substr(other.string().size()) + '\n';
  expect_recorded("drivers/transport/candump_files.txt", text);
}

TEST(TransportWhole, SentencesAboutCanInterfaces) {
  std::string text;
  for (const char* kind : {"can", "vcan"}) {
    for (const bool is_up : {true, false}) {
      for (const std::uint32_t bit_rate : {0U, 250'000U}) {
        for (int state = 0; state < 7; ++state) {
          for (const auto& [silent_s, other, errors, dropped] :
               std::vector<std::tuple<double, std::uint64_t, std::uint64_t, std::uint64_t>>{{0.0, 0, 0, 0},
                                                                                            {0.99, 5, 5, 7},
                                                                                            {1.0, 0, 0, 7},
                                                                                            {1.0, 5, 0, 0},
                                                                                            {1.0, 5, 5, 0},
                                                                                            {1.0, 6, 5, 0},
                                                                                            {2.0, 0, 1, 0}}) {
            if (!is_up && silent_s > 0.0) continue;
            CanInterface interface;
            interface.name = "can7";
            interface.kind = kind;
            interface.is_up = is_up;
            interface.bit_rate = bit_rate;
            interface.restart_ms = static_cast<std::uint32_t>(state == 4 ? errors : 0);
            interface.state = static_cast<CanControllerState>(state);
            CanObservation seen;
            seen.silent_s = silent_s;
            seen.other_frames = other;
            seen.error_frames = errors;
            seen.frames_dropped = dropped;
            seen.ids = "0AA";
            text += fmt::format("{} {}\n", name_of(interface.state), explain_can_trouble(interface, seen));
          }
        }
      }
    }
  }
  // Lines that were said before say no more.
  std::string once;
  std::vector<std::string> known;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    const std::string line = text.substr(at, end - at);
    const auto found = std::find(known.begin(), known.end(), line);
    if (found == known.end()) {
      once += line + '\n';
      known.push_back(line);
    } else {
      once += fmt::format("as {}\n", found - known.begin());
    }
    at = end + 1;
  }
  expect_recorded("drivers/transport/can_interfaces.txt", once);
}

TEST(TransportWhole, ASteeredClockLookedAtFiftyTimesASecond) {
  std::string text;
  const HostTime begin = host_time_from_ns(1'000'000'000'000);
  // Gained by the host's clock over its quartz, s after t_s.
  const auto gained_s = [](double t_s) {
    double gained = 1.2e-5 * t_s;
    if (t_s > 6.0) gained += 2.5e-6 * (t_s - 6.0);
    if (t_s > 9.0) gained += 3e-4 * (t_s - 9.0);
    if (t_s > 9.3) gained -= 3e-4 * (t_s - 9.3);
    if (t_s > 12.0) gained += 1e-7 * (t_s - 12.0);
    return gained;
  };
  for (const double noise_s : {0.0, 0.1e-6}) {
    SteeringWatch watch;
    for (int k = 0; k < 900; ++k) {
      const double t_s = 0.02 * k;
      const double noise = noise_s * ((k * 37) % 21 - 10) / 10.0;
      const Duration apart{k % 50 == 7 ? 2001 : k % 50 == 8 ? 2000 : 100};
      const double stands_out = k % 50 == 7 ? 5e-6 : 0.0;
      const ClockSteering reading{begin + from_seconds(t_s + gained_s(t_s)),
                                  begin + from_seconds(70.0 + t_s + noise + stands_out), 0.0, apart};
      if (const auto told = watch.look(reading)) {
        text += fmt::format("{}: {} {} {:.6g} {}\n", k, in_groups(to_ns(told->time)),
                            in_groups(to_ns(told->unsteered)), 1e9 * told->rate, told->apart.count());
      }
      if (k % 100 == 3) text += watch.look(reading) ? "again\n" : "";
    }
    text += "--\n";
  }
  // How far off a reading may be, and how wide its two clocks apart.
  for (const int off_ns : {500, 501, 549, 550, 551, 600}) {
    SteeringWatch watch;
    for (int k = 0; k < 4; ++k) {
      const ClockSteering reading{begin + k * 1s, begin + k * 1s + Duration{k == 3 ? off_ns : 0}, 0.0,
                                  Duration{k == 3 ? 100 : 0}};
      if (const auto told = watch.look(reading))
        text +=
            fmt::format("{} {}: {} {:.6g}\n", off_ns, k, in_groups(to_ns(told->unsteered)), 1e9 * told->rate);
    }
  }
  expect_recorded("drivers/transport/steering.txt", text);
}

/// A message with the kernel's words after it.
struct Told {
  alignas(cmsghdr) std::array<std::uint8_t, 256> control{};
  msghdr message{};

  Told() { message.msg_control = control.data(); }
  template <typename T>
  void add(int level, int type, const T& value, std::size_t size = sizeof(T)) {
    auto* header = reinterpret_cast<cmsghdr*>(control.data() + message.msg_controllen);
    header->cmsg_level = level;
    header->cmsg_type = type;
    header->cmsg_len = CMSG_LEN(size);
    std::memcpy(CMSG_DATA(header), &value, size);
    message.msg_controllen += CMSG_SPACE(size);
  }
  [[nodiscard]] std::string text() const {
    const KernelStamps stamps = stamps_of(message);
    return fmt::format("{} {} {}\n", in_groups(stamps.software_ns), in_groups(stamps.hardware_ns),
                       stamps.interface);
  }
};

TEST(TransportWhole, WhatTheKernelTellsOfAMessage) {
  std::string text;
  scm_timestamping times{};
  times.ts[0] = {12, 345};
  times.ts[1] = {13, 346};
  times.ts[2] = {14, 347};
  scm_ts_pktinfo info{};
  info.if_index = 7;
  Told nothing;
  text += nothing.text();
  Told both;
  both.add(SOL_SOCKET, SO_TIMESTAMPING, times), both.add(SOL_SOCKET, SCM_TIMESTAMPING_PKTINFO, info);
  text += both.text();
  Told of_others;
  of_others.add(SOL_SOCKET, SCM_RIGHTS, times), of_others.add(1234, SO_TIMESTAMPING, times),
      of_others.add(1234, SCM_TIMESTAMPING_PKTINFO, info),
      of_others.add(SOL_SOCKET, SCM_TIMESTAMPING_PKTINFO, info);
  text += of_others.text();
  Told too_short;
  too_short.add(SOL_SOCKET, SO_TIMESTAMPING, times, sizeof times - 1),
      too_short.add(SOL_SOCKET, SCM_TIMESTAMPING_PKTINFO, info, sizeof info - 1);
  text += too_short.text();
  expect_recorded("drivers/transport/kernel_words.txt", text);
}

TEST(TransportWhole, StampsOfEveryKindThroughStepsOfTheWallClock) {
  std::string text;
  KernelStampMap map;
  const UtcTime wall_begin = utc_time_from_ns(1'772'000'000'000'000'000);
  HostTime host = host_time_from_ns(50'000'000'000);
  Duration offset{};
  const auto frame = [&](Duration waited, bool software, std::int64_t hardware_ns, std::uint32_t interface) {
    const HostTime came = host - waited;
    const HostTime at = map.map(
        {software ? to_ns(wall_begin + came.time_since_epoch() + offset) : 0, hardware_ns, interface});
    const StampQuality quality = map.quality();
    text += fmt::format("{} by {} {:.9g} {:.9g} steps {} hardware {}\n", in_groups(to_ns(at)),
                        static_cast<int>(quality.by), 1e3 * quality.lead_s, 1e3 * quality.lead_sd_s,
                        map.clock_steps(), map.hardware_stamps());
  };
  const auto read = [&](Duration after) {
    host += after;
    map.begin_read(wall_begin + host.time_since_epoch() + offset, host);
  };
  for (int i = 0; i < 4; ++i) read(10ms), frame(1ms * i, true, 0, 0);
  read(10ms), frame(20ms, true, 0, 0), frame(0ms, false, 0, 0), frame(-5ms, true, 0, 0);
  offset += 999us, read(10ms), frame(1ms, true, 0, 0);
  offset += 1'005us, read(10ms), frame(1ms, true, 0, 0);
  offset += 1'006us, read(10ms), frame(1ms, true, 0, 0);
  offset -= 2s, read(10ms), frame(1ms, true, 0, 0), read(10ms), frame(1ms, true, 0, 0);
  offset += 6ms, read(10s), frame(1ms, true, 0, 0);
  offset += 6'001us, read(10s), frame(1ms, true, 0, 0);
  for (int i = 0; i < 6; ++i)
    read(10ms), frame(1ms, true, 700'000'000 + 10'000'000LL * i, 2), frame(500us, true, 900'000'000 + i, 3),
        frame(200us, i % 2 == 0, 0, 2);
  for (int i = 0; i < 260; ++i) {
    read(10ms);
    if (i % 20 == 0) {
      frame(Duration{100us} * (i % 7), true, 0, 0);
    } else {
      static_cast<void>(
          map.map({to_ns(wall_begin + host.time_since_epoch() + offset - Duration{100us} * (i % 7)), 0, 0}));
    }
  }
  expect_recorded("drivers/transport/kernel_stamps.txt", text);
}

}  // namespace
}  // namespace imuscope
