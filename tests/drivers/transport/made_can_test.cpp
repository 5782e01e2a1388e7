// What is made of the kernel's words and frames, by a kernel that is made up: the real one is asked in tests/can.
#include <gtest/gtest.h>

#include <fmt/format.h>
// Before the kernel's headers, which leave out what this one has defined.
#include <net/if.h>

#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/if_arp.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <span>

#include "drivers/device/can_frame.h"
#include "drivers/transport/can_interface.h"
#include "drivers/transport/can_socket.h"
#include "made_can_kernel.h"
#include "made_can_link.h"
#include "tests/drivers/support/sample_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using namespace std::chrono_literals;
using test::Bytes;
using test::bytes_as;
using test::join;
using test::link_answer;
using test::MadeLink;

/// A kernel as it is at first, for each test.
test::MadeCanKernel& fresh_kernel() {
  auto& kernel = test::made_can_kernel();
  kernel = {};
  return kernel;
}

Bytes refusal_of(int error) {
  nlmsgerr refusal{};
  refusal.error = -error;
  nlmsghdr head{};
  head.nlmsg_type = NLMSG_ERROR;
  head.nlmsg_len = NLMSG_LENGTH(sizeof refusal);
  Bytes bytes = bytes_as(head);
  join(bytes, bytes_as(refusal));
  return bytes;
}

/// Without the remedy, which names the interfaces of this PC.
std::string first_words(const Error& error) { return error.text().substr(0, error.text().find(';')); }

/// Whatever a damaged answer holds.
std::string letters_of(const std::string& text) {
  std::string letters;
  for (const char c : text) letters += c >= ' ' && c <= '~' ? c : '?';
  return letters;
}

std::string seen(const std::string& name = "can7") {
  const auto looked = look_at_can_interface(name);
  if (!looked)
    return fmt::format("{} {}", static_cast<int>(looked.error().kind), first_words(looked.error()));
  const CanInterface& i = *looked;
  return fmt::format(
      "{} '{}'{}{} {}{} {} {} {} errors {} {} received {} overruns {}", i.name, letters_of(i.kind),
      i.is_up ? " up" : " down", i.takes_fd ? " fd" : "", name_of(i.state), i.listen_only ? " listens" : "",
      i.bit_rate, i.data_bit_rate, i.restart_ms, i.tx_errors ? static_cast<int>(*i.tx_errors) : -1,
      i.rx_errors ? static_cast<int>(*i.rx_errors) : -1, i.frames_received, i.controller_overruns);
}

TEST(MadeCan, WhatNetlinkSaysOfAnInterface) {
  auto& kernel = fresh_kernel();
  std::string text;
  const auto add = [&](const MadeLink& link) {
    kernel.answer = link_answer(link);
    text += seen() + '\n';
  };
  add({});
  text += test::hex_text(kernel.asked) + '\n';
  add({.flags = 0}), add({.mtu = CAN_MTU}), add({.mode = 0}), add({.has_counts = false}),
      add({.has_controller = false}), add({.kind = "vcan"}), add({.type = ARPHRD_ETHER}),
      add({.timing_bytes = 4}), add({.timing_bytes = 2});
  for (std::uint32_t state = 0; state < 8; ++state) add({.state = state});
  for (const std::string& name : {std::string(), std::string(15, 'c'), std::string(16, 'c')})
    text += seen(name) + '\n';
  for (const int error : {ENODEV, EPERM}) {
    kernel.answer = refusal_of(error);
    text += seen() + '\n';
  }
  const Bytes whole = link_answer({});
  std::string before;
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    kernel.answer.assign(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    const std::string now = seen();
    if (now != before) text += fmt::format("{} bytes: {}\n", size, now);
    before = now;
  }
  // Lengths that lie, of each attribute and of the whole.
  for (std::size_t at = 0; at + 1 < whole.size(); at += 4) {
    for (const int by : {-4, 1, 200}) {
      kernel.answer = whole;
      kernel.answer[at] = static_cast<std::uint8_t>(kernel.answer[at] + by);
      const std::string now = seen();
      if (now != before) text += fmt::format("{} by {}: {}\n", at, by, now);
    }
  }
  kernel.receive_error = ENOBUFS;
  text += seen() + '\n';
  kernel.netlink_error = EMFILE;
  text += seen() + '\n';
  test::expect_recorded("drivers/transport/netlink.txt", text);
}

CanSettings settings_of(std::vector<CanId> ids) { return {"can7", std::move(ids), 2048}; }
const std::vector<CanId> kIds{{0x0AA, false}, {0x18FF0100, true}};

TEST(MadeCan, HowASocketIsOpened) {
  auto& kernel = fresh_kernel();
  std::string text;
  const auto add = [&](const CanSettings& settings) {
    kernel.said.clear();
    const auto socket = CanSocket::open(settings);
    text += socket
                ? (*socket)->describe() + '\n'
                : fmt::format("{} {}\n", static_cast<int>(socket.error().kind), first_words(socket.error()));
    text += kernel.said.substr(0, 400);
  };
  kernel.answer = link_answer({});
  add(settings_of(kIds));
  add(settings_of({})), add(settings_of(std::vector<CanId>(512))), add(settings_of(std::vector<CanId>(513)));
  kernel.answer = link_answer({.kind = "vcan", .flags = 0, .mtu = CAN_MTU, .has_controller = false});
  add(settings_of(kIds));
  kernel.answer = link_answer({.mode = 0});
  for (int option = 1; option < 6; ++option) {
    kernel.option_that_fails = option;
    add(settings_of(kIds));
  }
  kernel.option_that_fails = -1;
  kernel.bind_error = ENETDOWN;
  add(settings_of(kIds));
  for (const int error : {EAFNOSUPPORT, EPROTONOSUPPORT, EMFILE}) {
    kernel.socket_error = error;
    add(settings_of(kIds));
  }
  test::expect_recorded("drivers/transport/can_sockets.txt", text);
}

test::MadeFrame made(canid_t id, std::uint8_t length, bool is_fd = false, std::uint8_t flags = 0,
                     std::uint8_t raw_dlc = 0) {
  test::MadeFrame frame;
  frame.frame.can_id = id;
  frame.frame.len = length;
  frame.frame.flags = flags;
  frame.frame.__res1 = raw_dlc;
  frame.n_bytes = is_fd ? CANFD_MTU : CAN_MTU;
  for (std::size_t i = 0; i < sizeof frame.frame.data; ++i)
    frame.frame.data[i] = static_cast<std::uint8_t>(i + 1);
  return frame;
}

Bytes overflow_told(std::uint32_t total, int level = SOL_SOCKET, int type = SO_RXQ_OVFL) {
  cmsghdr head{};
  head.cmsg_len = CMSG_LEN(sizeof total);
  head.cmsg_level = level;
  head.cmsg_type = type;
  Bytes bytes(CMSG_SPACE(sizeof total));
  std::memcpy(bytes.data(), &head, sizeof head);
  std::memcpy(bytes.data() + CMSG_LEN(0), &total, sizeof total);
  return bytes;
}

TEST(MadeCan, FramesOfEveryKind) {
  auto& kernel = fresh_kernel();
  kernel.answer = link_answer({});
  const auto socket = CanSocket::open(settings_of(kIds));
  ASSERT_TRUE(socket);
  kernel.said.clear();
  std::string text;
  const auto read = [&](std::size_t room) {
    Bytes buffer(room);
    const IoResult got = (*socket)->read(buffer);
    text += fmt::format("status {} bytes {} more {}\n", static_cast<int>(got.status), got.n, got.more);
    const std::span<const std::uint8_t> moved(buffer.data(), got.n);
    CanFrameReader frames(moved);
    for (CanFrame f; frames.next(f);) {
      text +=
          fmt::format("{:X} {}{}{}{}{}{} {} {}{}\n", f.id, f.is_extended ? "x" : "-", f.is_remote ? "r" : "-",
                      f.is_error ? "e" : "-", f.is_fd ? "f" : "-", f.bit_rate_switched ? "b" : "-",
                      f.sender_error_state ? "s" : "-", f.length, f.raw_dlc, test::hex_text(f.payload()));
    }
    const LineHealth health = (*socket)->health();
    text += fmt::format("up {} dropped {} impossible {} hardware {}\n", health.is_up, health.frames_dropped,
                        (*socket)->impossible_frames(), (*socket)->hardware_stamps()) +
            std::exchange(kernel.said, {});
  };
  kernel.frames = {made(0x0AA, 8),
                   made(0x7FF, 3),
                   made(0x18FF0100U | CAN_EFF_FLAG, 8, false, 0, 9),
                   made(0x0AAU | CAN_RTR_FLAG, 5),
                   made(0x204U | CAN_ERR_FLAG, 8),
                   made(0x0AA, 8, false, 3, 15),
                   made(0x0AA, 8, false, 0, 16),
                   made(0x0AA, 7, false, 0, 9),
                   made(0x0AA, 64, true, CANFD_BRS),
                   made(0x0AA, 12, true, CANFD_ESI, 9),
                   made(0x0AA, 8, true, CANFD_BRS | CANFD_ESI, 9),
                   made(0xFFFF0AAU, 2),
                   made(0x0AA, 9),
                   made(0x0AA, 13, true),
                   made(0x0AA, 12)};
  kernel.frames[1].control = overflow_told(5);
  kernel.frames[2].control = overflow_told(8);
  kernel.frames[3].control = overflow_told(100, SOL_CAN_RAW),
  join(kernel.frames[3].control, overflow_told(100, SOL_SOCKET, SO_TIMESTAMP)),
  join(kernel.frames[3].control, overflow_told(9));
  auto odd = made(0x0AA, 8);
  odd.n_bytes = 15;
  kernel.frames.push_back(odd);
  kernel.interrupted = 2;
  read(100 * kCanRecordMaxBytes);
  kernel.frames = std::vector<test::MadeFrame>(70, made(0x123, 1));
  kernel.frames[0].control = overflow_told(2);  // the count has wrapped
  read(kCanRecordMaxBytes);
  read(3 * kCanRecordMaxBytes + 7);
  read(100 * kCanRecordMaxBytes);
  read(100 * kCanRecordMaxBytes);
  for (const int error : {EAGAIN, ENETDOWN, ENODEV, ENXIO, EBADF}) {
    kernel.receive_error = error;
    read(kCanRecordMaxBytes);
  }
  kernel.interface_flags = IFF_RUNNING;
  read(kCanRecordMaxBytes);
  kernel.flags_error = ENODEV;
  kernel.interface_flags = IFF_UP;
  read(kCanRecordMaxBytes);
  kernel.flags_error = 0;
  read(kCanRecordMaxBytes);
  kernel.receive_error = ENETDOWN;
  kernel.flags_error = ENODEV;
  read(kCanRecordMaxBytes);
  kernel.receive_error = 0;
  kernel.frames = {made(0x0AA, 1)};
  read(kCanRecordMaxBytes);
  test::expect_recorded("drivers/transport/can_frames.txt", text);
}

}  // namespace
}  // namespace imuscope
