/// CanSocket against the kernel's CAN stack: virtual interfaces, a serial-line adapter's driver, and
/// can-utils as the peers.

#include "drivers/transport/can_socket.h"

#include <gmock/gmock.h>
#include <linux/can/error.h>
#include <poll.h>
#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <thread>

#include "bus.h"
#include "drivers/can_bus/session.h"
#include "drivers/transport/can_interface.h"
#include "drivers/transport/candump.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

HostTime host_now() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return host_time_from_ns(std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec);
}

/// Reads on as the I/O thread does, until nothing has come for `quiet`.
std::vector<CanFrame> read_all(CanSocket& socket, milliseconds quiet = milliseconds(100)) {
  std::vector<std::uint8_t> buffer(4096);
  std::vector<CanFrame> frames;
  for (;;) {
    pollfd waiting{socket.fd(), POLLIN, 0};
    if (poll(&waiting, 1, static_cast<int>(quiet.count())) <= 0) return frames;
    const auto result = socket.read(buffer);
    if (result.status == IoStatus::kGone) return frames;
    CanFrameReader reader({buffer.data(), result.n});
    CanFrame frame;
    while (reader.next(frame)) frames.push_back(frame);
    EXPECT_EQ(reader.bytes_skipped(), 0U);
  }
}

std::unique_ptr<CanSocket> open(const std::string& interface, std::vector<CanId> ids,
                                int buffer_bytes = 1 << 20) {
  auto socket = CanSocket::open({interface, std::move(ids), buffer_bytes});
  if (!socket) throw std::runtime_error(socket.error().text());
  return std::move(*socket);
}

std::vector<std::uint8_t> counting(std::size_t n) {
  std::vector<std::uint8_t> data(n);
  for (std::size_t i = 0; i < n; ++i) data[i] = static_cast<std::uint8_t>(i + 1);
  return data;
}

std::vector<std::uint8_t> payload(const CanFrame& frame) {
  return {frame.payload().begin(), frame.payload().end()};
}

TEST(CanSocket, ClassicFramesOfEveryLengthArriveAsSent) {
  const Vcan bus("vcan0", CAN_MTU);
  const auto socket = open("vcan0", {{0x123, false}, {0x18FF0100, true}});
  const Sender sender("vcan0");
  for (std::size_t n = 0; n <= 8; ++n) {
    sender.classic(0x123, counting(n));
    sender.classic(0x18FF0100U | CAN_EFF_FLAG, counting(n));
  }
  const auto frames = read_all(*socket);
  ASSERT_EQ(frames.size(), 18U);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const bool extended = i % 2 == 1;
    EXPECT_EQ(frames[i].id, extended ? 0x18FF0100U : 0x123U);
    EXPECT_EQ(frames[i].is_extended, extended);
    EXPECT_FALSE(frames[i].is_fd);
    EXPECT_EQ(payload(frames[i]), counting(i / 2));
  }
}

TEST(CanSocket, FdFramesOfEveryLengthArriveAsSentWithTheirFlags) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x500, false}});
  EXPECT_THAT(socket->describe(), HasSubstr("vcan0 (CAN FD"));
  const Sender sender("vcan0");
  const std::vector<std::size_t> lengths{0, 1, 8, 12, 16, 20, 24, 32, 48, 64};
  for (const auto n : lengths) sender.fd(0x500, counting(n), n % 16 == 0 ? CANFD_BRS | CANFD_ESI : 0);
  sender.classic(0x500, counting(8));
  const auto frames = read_all(*socket);
  ASSERT_EQ(frames.size(), lengths.size() + 1);
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    EXPECT_TRUE(frames[i].is_fd);
    EXPECT_EQ(payload(frames[i]), counting(lengths[i]));
    EXPECT_EQ(frames[i].bit_rate_switched, lengths[i] % 16 == 0);
    EXPECT_EQ(frames[i].sender_error_state, lengths[i] % 16 == 0);
  }
  EXPECT_FALSE(frames.back().is_fd) << "both kinds share a bus";
}

TEST(CanSocket, KernelLetsOnlyTheIdentifiersInUseThrough) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x123, false}, {0x456, true}});
  const Sender sender("vcan0");
  sender.classic(0x123, {1});
  sender.classic(0x123U | CAN_EFF_FLAG, {2});  // the same number in 29 bits
  sender.classic(0x123U | CAN_RTR_FLAG, {});   // asks for it
  sender.classic(0x456, {3});
  sender.classic(0x456U | CAN_EFF_FLAG, {4});
  for (canid_t id = 0; id < 0x700; id += 7) {
    if (id != 0x123 && id != 0x456) sender.classic(id, {5});
  }
  const auto frames = read_all(*socket);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(payload(frames[0]), std::vector<std::uint8_t>{1});
  EXPECT_EQ(payload(frames[1]), std::vector<std::uint8_t>{4});
}

TEST(CanSocket, StampIsWhenTheKernelReceivedNotWhenTheFrameWasRead) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x123, false}});
  const Sender sender("vcan0");
  for (int i = 0; i < 5; ++i) {
    const HostTime before = host_now();
    sender.classic(0x123, {1});
    const HostTime after = host_now();
    std::this_thread::sleep_for(milliseconds(60));
    const auto frames = read_all(*socket, milliseconds(10));
    ASSERT_EQ(frames.size(), 1U);
    // Two clocks read one after the other: a preemption in between is off by its length.
    EXPECT_GT(frames[0].stamp, before - milliseconds(5));
    EXPECT_LT(frames[0].stamp, after + milliseconds(5)) << "60 ms were slept before the read";
  }
  EXPECT_EQ(socket->hardware_stamps(), 0U) << "a virtual bus has no clock of its own";
}

TEST(CanSocket, FramesThatFoundNoRoomAreCountedToTheLastOne) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x123, false}}, 4096);
  const Sender sender("vcan0");
  constexpr std::size_t kSent = 2000;
  for (std::size_t i = 0; i < kSent; ++i) sender.classic(0x123, counting(8));
  auto received = read_all(*socket).size();
  EXPECT_LT(received, kSent) << "4 kB hold no 2000 frames";
  // The count comes with the next frame that is delivered.
  sender.classic(0x123, {1});
  received += read_all(*socket).size();
  EXPECT_EQ(received + socket->health().frames_dropped, kSent + 1);
  std::printf("full buffer: %zu sent = %zu received + %zu counted as dropped\n", kSent + 1, received,
              static_cast<std::size_t>(socket->health().frames_dropped));
}

TEST(CanSocket, LengthThatNoFrameCanHaveIsCountedAndNotHandedOn) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x123, false}});
  const Sender sender("vcan0");
  sender.fd(0x123, counting(13));  // a virtual bus lets it pass
  sender.fd(0x123, counting(16));
  EXPECT_EQ(read_all(*socket).size(), 1U);
  EXPECT_EQ(socket->impossible_frames(), 1U);
}

TEST(CanSocket, RawDlcOfAClassicFrameIsKept) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x123, false}});
  Sender("vcan0").classic(0x123, counting(8), 11);
  const auto frames = read_all(*socket);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].raw_dlc, 11);
}

TEST(CanSocket, ErrorFramesAreHeardWhateverTheFilter) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x123, false}});
  Sender("vcan0").classic(CAN_ERR_FLAG | CAN_ERR_BUSOFF, std::vector<std::uint8_t>(8));
  const auto frames = read_all(*socket);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_TRUE(frames[0].is_error);
  EXPECT_EQ(read_can_error(frames[0]).state, CanBusState::kOff);
}

TEST(CanSocket, InterfaceThatGoesDownAndComesUpKeepsItsSocket) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x123, false}});
  EXPECT_TRUE(socket->health().is_up);
  bus.down();
  std::vector<std::uint8_t> buffer(4096);
  EXPECT_EQ(socket->read(buffer).status, IoStatus::kNothing);
  EXPECT_FALSE(socket->health().is_up);
  EXPECT_EQ(explain_can_trouble(*look_at_can_interface("vcan0"), {}),
            "vcan0 is down; sudo ip link set vcan0 up");
  bus.up();
  EXPECT_TRUE(socket->health().is_up) << "before any frame";
  Sender("vcan0").classic(0x123, {7});
  EXPECT_EQ(read_all(*socket).size(), 1U);
}

TEST(CanSocket, InterfaceThatIsDownCanBeOpenedAndIsHeardOnceItIsUp) {
  const Vcan bus("vcan0");
  bus.down();
  const auto socket = open("vcan0", {{0x123, false}});
  EXPECT_FALSE(socket->health().is_up);
  EXPECT_THAT(socket->describe(), HasSubstr("down"));
  bus.up();
  (void)read_all(*socket);  // the error that told of being down
  EXPECT_TRUE(socket->health().is_up);
  Sender("vcan0").classic(0x123, {7});
  EXPECT_EQ(read_all(*socket).size(), 1U);
}

TEST(CanSocket, InterfaceThatIsRemovedIsGoneAndCanBeOpenedAgain) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x123, false}});
  bus.remove();
  std::vector<std::uint8_t> buffer(4096);
  // Removal begins with going down.
  auto status = socket->read(buffer).status;
  for (int i = 0; i < 3 && status == IoStatus::kNothing; ++i) status = socket->read(buffer).status;
  EXPECT_EQ(status, IoStatus::kGone);
  const auto missing = CanSocket::open({"vcan0", {{0x123, false}}});
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().text(), HasSubstr("vcan0 does not exist"));
  const Vcan again("vcan0");
  const auto reopened = open("vcan0", {{0x123, false}});
  Sender("vcan0").classic(0x123, {7});
  EXPECT_EQ(read_all(*reopened).size(), 1U);
}

TEST(CanSocket, MissingInterfaceNamesThoseThereAre) {
  const Vcan one("vcan0");
  const Vcan two("vcan1");
  const auto missing = CanSocket::open({"can7", {{0x123, false}}});
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().text(),
              testing::AllOf(HasSubstr("can7 does not exist"), HasSubstr("vcan0, vcan1")));
}

TEST(CanSocket, ImpossibleIdentifiersAreRefused) {
  const Vcan bus("vcan0");
  EXPECT_FALSE(CanSocket::open({"vcan0", {}}));
  EXPECT_FALSE(CanSocket::open({"vcan0", std::vector<CanId>(513)}));
}

/// The bus as full as 1 Mbit/s allows, every frame filtered in.
TEST(CanSocket, FullBusLosesNothingOrCountsIt) {
  const Vcan bus("vcan0");
  const auto socket = open("vcan0", {{0x100, false}, {0x101, false}}, 8 * 1024 * 1024);
  constexpr int kFramesPerMs = 8;
  constexpr int kMs = 5000;
  constexpr std::uint64_t kSent = std::uint64_t{kFramesPerMs} * kMs;
  std::atomic<bool> sending{true};
  std::thread peer([&] {
    const Sender sender("vcan0");
    std::vector<std::uint8_t> data(8);
    auto next = std::chrono::steady_clock::now();
    std::uint32_t count = 0;
    for (int ms = 0; ms < kMs; ++ms) {
      for (int i = 0; i < kFramesPerMs; ++i, ++count) {
        std::memcpy(data.data(), &count, sizeof count);
        sender.classic(0x100 + count % 2, data);
      }
      next += milliseconds(1);
      std::this_thread::sleep_until(next);
    }
    sending = false;
  });
  // As the I/O thread: wakes for frames, at the latest every 5 ms, and takes four buffers of 4 kB at most.
  std::vector<std::uint8_t> buffer(4096);
  std::uint64_t received = 0;
  std::uint64_t out_of_order = 0;
  std::uint32_t expected = 0;
  Duration waited_longest{0};
  std::uint64_t reads = 0;
  rusage before{};
  getrusage(RUSAGE_THREAD, &before);
  const HostTime began = host_now();
  HostTime ended = began;
  for (bool more = true; more;) {
    more = sending;
    pollfd waiting{socket->fd(), POLLIN, 0};
    if (poll(&waiting, 1, 5) <= 0) continue;
    more = true;
    for (int i = 0; i < 4; ++i) {
      const auto result = socket->read(buffer);
      if (result.status != IoStatus::kDone) break;
      ++reads;
      const HostTime now = host_now();
      CanFrameReader reader({buffer.data(), result.n});
      CanFrame frame;
      while (reader.next(frame)) {
        std::uint32_t count = 0;
        std::memcpy(&count, frame.data.data(), sizeof count);
        if (count < expected) ++out_of_order;
        expected = count + 1;
        ++received;
        waited_longest = std::max(waited_longest, Duration{now - frame.stamp});
        ended = now;
      }
      if (!result.more) break;
    }
  }
  peer.join();
  // Were the last frames lost, the count of it would wait for one more.
  Sender("vcan0").classic(0x100, {0, 0, 0, 0xFF});
  received += read_all(*socket).size() - 1;
  rusage after{};
  getrusage(RUSAGE_THREAD, &after);
  const auto cpu_s = [](const rusage& usage) {
    return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
  };
  const double seconds = to_seconds(ended - began);
  EXPECT_EQ(received + socket->health().frames_dropped, kSent);
  EXPECT_EQ(out_of_order, 0U);
  std::printf(
      "full bus: %llu frames sent in %.2f s (%.0f/s), %llu received, %llu counted as dropped, %llu reads, "
      "longest wait from stamp to read %.1f ms, reader %.0f %% of a core\n",
      static_cast<unsigned long long>(kSent), seconds, static_cast<double>(kSent) / seconds,
      static_cast<unsigned long long>(received),
      static_cast<unsigned long long>(socket->health().frames_dropped),
      static_cast<unsigned long long>(reads), 1e3 * to_seconds(waited_longest),
      100.0 * (cpu_s(after) - cpu_s(before)) / seconds);
}

/// What cangen sends is what candump logs and what the socket hears; what canplayer sends again, too.
TEST(CanUtils, GeneratorLoggerAndPlayerAgreeWithTheSocketOnEveryFrame) {
  const Vcan bus("vcan0");
  const auto folder = scratch_folder();
  const auto socket = open("vcan0", {{0x100, false}, {0x18FF0100, true}, {0x102, false}});
  constexpr std::size_t kFramesOfAKind = 100;
  const std::string log = (folder / "generated.log").string();
  std::thread logger([&] { shell("candump -L -n 400 vcan0 >" + log); });
  std::this_thread::sleep_for(milliseconds(500));
  shell(
      "generate() { cangen vcan0 -g 1 -n 100 -D r \"$@\"; }; generate -L i -I 100; generate -L i -e -I "
      "18FF0100; generate -f -b -L r -I 102; generate -L i -I 103");
  logger.join();
  const auto heard = read_all(*socket);
  auto file = CandumpLog::open(log);
  ASSERT_TRUE(file) << file.error().text();
  std::vector<CanFrame> logged;
  std::size_t all = 0;
  for (const CandumpFrame* entry = file->next(); entry != nullptr; entry = file->next(), ++all) {
    if (entry->frame.id != 0x103) logged.push_back(entry->frame);
  }
  EXPECT_EQ(all, 4 * kFramesOfAKind);
  EXPECT_EQ(logged.size(), 3 * kFramesOfAKind);
  EXPECT_TRUE(
      std::any_of(logged.begin(), logged.end(), [](const CanFrame& f) { return f.is_fd && f.length == 64; }));
  const auto same = [](const std::vector<CanFrame>& a, const std::vector<CanFrame>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const CanFrame& x, const CanFrame& y) {
      return x.id == y.id && x.length == y.length && x.data == y.data && x.is_fd == y.is_fd;
    });
  };
  EXPECT_TRUE(same(heard, logged)) << heard.size() << " heard, " << logged.size() << " logged";
  shell("canplayer -t -I " + log + " vcan0=vcan0");
  EXPECT_TRUE(same(read_all(*socket), logged));
}

class SerialLineCan : public testing::Test {
 protected:
  /// What the session makes of what comes after `line`.
  void hear(const std::string& line) {
    adapter_.say(line);
    std::vector<std::uint8_t> buffer(4096);
    pollfd waiting{socket_->fd(), POLLIN, 0};
    ASSERT_EQ(poll(&waiting, 1, 2000), 1) << "nothing after " << line;
    const auto result = socket_->read(buffer);
    ASSERT_EQ(result.status, IoStatus::kDone);
    session_.on_bytes({buffer.data(), result.n}, host_now());
  }

  SerialLineAdapter adapter_;
  std::unique_ptr<CanSocket> socket_ = open(adapter_.interface(), {{0x123, false}, {0x18FF0100, true}});
  CanSession session_;
};

TEST_F(SerialLineCan, FramesOfTheAdapterArrive) {
  hear("t1233AABBCC");
  EXPECT_EQ(session_.state(), SessionState::kStreaming);
  adapter_.say("T18FF01008CDCCCC3D1E3CE508");
  const auto frames = read_all(*socket_);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].id, 0x18FF0100U);
  EXPECT_EQ(payload(frames[0]), (std::vector<std::uint8_t>{0xCD, 0xCC, 0xCC, 0x3D, 0x1E, 0x3C, 0xE5, 0x08}));
}

TEST_F(SerialLineCan, WarningPassiveAndActiveAreTold) {
  hear("sw100120");
  EXPECT_EQ(session_.bus_state(), CanBusState::kWarning);
  hear("sp130140");
  EXPECT_EQ(session_.bus_state(), CanBusState::kPassive);
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("only error frames"));
  hear("t1231AA");
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("error-passive"));
  hear("sa000000");
  EXPECT_EQ(session_.bus_state(), CanBusState::kActive);
  EXPECT_EQ(session_.problem(), "");
}

TEST_F(SerialLineCan, BusOffIsToldWithTheRemedy) {
  hear("t1231AA");
  hear("sb255255");
  EXPECT_EQ(session_.bus_state(), CanBusState::kOff);
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("type can restart"));
  const auto interface = look_at_can_interface(adapter_.interface());
  ASSERT_TRUE(interface);
  EXPECT_EQ(interface->state, CanControllerState::kBusOff);
  EXPECT_THAT(explain_can_trouble(*interface, {}), HasSubstr("is bus-off"));
}

TEST_F(SerialLineCan, BusErrorsWithoutFramesAreAWrongBitRate) {
  hear("e1a");
  hear("e2bO");
  EXPECT_EQ(session_.error_frames(), 2U);
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("bit rate"));
  CanObservation seen;
  seen.silent_s = 3.0;
  seen.error_frames = session_.error_frames();
  const auto interface = look_at_can_interface(adapter_.interface());
  ASSERT_TRUE(interface);
  EXPECT_THAT(explain_can_trouble(*interface, seen), HasSubstr("hears only errors"));
}

TEST_F(SerialLineCan, OverflowOfTheAdapterIsTold) {
  hear("t1231AA");
  hear("e1o");
  EXPECT_EQ(session_.overflows(), 1U);
  EXPECT_THAT(std::string(session_.problem()), HasSubstr("no room for frames"));
}

TEST_F(SerialLineCan, AdapterThatIsUnpluggedIsGone) {
  hear("t1231AA");
  adapter_.unplug();
  std::vector<std::uint8_t> buffer(4096);
  auto status = IoStatus::kNothing;
  for (int i = 0; i < 50 && status != IoStatus::kGone; ++i) {
    pollfd waiting{socket_->fd(), POLLIN, 0};
    (void)poll(&waiting, 1, 100);
    status = socket_->read(buffer).status;
  }
  EXPECT_EQ(status, IoStatus::kGone);
}

/// Two controllers with the kernel's driver for a real chip (SJA1000), on one bus. Only the emulated PC has
/// them.
class TwoControllers : public testing::Test {
 protected:
  void SetUp() override {
    if (std::getenv("CAN_VM") == nullptr)
      GTEST_SKIP() << "two CAN controllers on one bus: tools/can_vm --vm has them";
    for (const char* name : {"can0", "can1"}) {
      shell(std::string("ip link set ") + name + " up type can bitrate 1000000 restart-ms 100");
    }
  }
  void TearDown() override {
    for (const char* name : {"can0", "can1"})
      (void)shell_status(std::string("ip link set ") + name + " down");
  }
};

TEST_F(TwoControllers, FramesOfOneAreHeardByTheOther) {
  const auto socket = open("can1", {{0x123, false}, {0x18FF0100, true}});
  EXPECT_THAT(socket->describe(), HasSubstr("1000000 bit/s"));
  const Sender sender("can0");
  for (std::size_t n = 0; n <= 8; ++n) {
    sender.classic(0x123, counting(n));
    sender.classic(0x18FF0100U | CAN_EFF_FLAG, counting(n));
    sender.classic(0x124, counting(n));
  }
  const auto frames = read_all(*socket);
  ASSERT_EQ(frames.size(), 18U);
  for (std::size_t i = 0; i < frames.size(); ++i) EXPECT_EQ(payload(frames[i]), counting(i / 2));
}

TEST_F(TwoControllers, BitRateStateAndTrafficAreReadFromTheDriver) {
  const auto before = look_at_can_interface("can1");
  ASSERT_TRUE(before);
  EXPECT_EQ(before->kind, "can");
  EXPECT_EQ(before->bit_rate, 1'000'000U);
  EXPECT_EQ(before->restart_ms, 100U);
  EXPECT_EQ(before->state, CanControllerState::kActive);
  const auto socket = open("can1", {{0x123, false}});
  const Sender sender("can0");
  for (int i = 0; i < 20; ++i) sender.classic(0x124, {1});
  EXPECT_EQ(read_all(*socket).size(), 0U);
  const auto after = look_at_can_interface("can1");
  ASSERT_TRUE(after);
  CanObservation seen;
  seen.silent_s = 2.0;
  seen.other_frames = after->frames_received - before->frames_received;
  seen.ids = "123";
  EXPECT_THAT(explain_can_trouble(*after, seen), HasSubstr("none with the identifiers in use (123)"));
}

TEST_F(TwoControllers, DownAndUpOfARealDriverIsSurvived) {
  const auto socket = open("can1", {{0x123, false}});
  shell("ip link set can1 down");
  std::vector<std::uint8_t> buffer(4096);
  EXPECT_EQ(socket->read(buffer).status, IoStatus::kNothing);
  EXPECT_FALSE(socket->health().is_up);
  shell("ip link set can1 up");
  EXPECT_TRUE(socket->health().is_up);
  Sender("can0").classic(0x123, {9});
  EXPECT_EQ(read_all(*socket).size(), 1U);
}

}  // namespace
}  // namespace imuscope::test
