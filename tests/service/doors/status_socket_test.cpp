/// The socket of `imuscope status`: whom it answers, and what it leaves to whom.

#include "service/doors/status_socket.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <thread>

#include "base/output_folder.h"
#include "example_messages.h"
#include "rt/host_clock.h"

namespace imuscope {
namespace {

using testing::HasSubstr;

constexpr uid_t kNobody = 65534;

/// Whether something holds in a process of another user.
bool holds_for_nobody(const std::function<bool()>& condition) {
  const pid_t child = fork();
  if (child == 0) _exit(setuid(kNobody) == 0 && condition() ? 0 : 1);
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  return WEXITSTATUS(status) == 0;
}

class StatusDoor : public testing::Test {
 protected:
  void SetUp() override {
    // A socket's name holds at most 107 characters, fewer than a scratch folder may have.
    std::string name = "/tmp/imuscope-doors-XXXXXX";
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    unsetenv("RUNTIME_DIRECTORY");
    setenv("XDG_RUNTIME_DIR", name.c_str(), 1);
  }
  void TearDown() override {
    unsetenv("XDG_RUNTIME_DIR");
    std::filesystem::remove_all(folder_);
  }

  std::filesystem::path folder_;
  StatusBoard board_;
};

TEST_F(StatusDoor, GivesTheNewestStatusToItsOwnUser) {
  const auto door = StatusSocket::open(board_);
  ASSERT_TRUE(door) << door.error().text();
  EXPECT_FALSE(ask_status((*door)->path())) << "before the first";
  board_.put(test::example_status(), host_now());
  for (int i = 0; i < 100; ++i) {
    const auto status = ask_status((*door)->path());
    ASSERT_TRUE(status) << status.error().text();
    EXPECT_EQ(status->status.run, "demo");
    EXPECT_EQ(status->status.alarms.size(), 1U);
    EXPECT_GE(status->age_s, 0.0);
    EXPECT_LT(status->age_s, 60.0);
  }
  board_.put(test::example_status(), host_now() - std::chrono::minutes(5));
  const auto old = ask_status((*door)->path());
  ASSERT_TRUE(old);
  EXPECT_GE(old->age_s, 300.0);
  const auto found = find_status_sockets();
  ASSERT_TRUE(found);
  EXPECT_THAT(*found, testing::Contains((*door)->path()));
}

TEST_F(StatusDoor, NobodyElseMayOpenIt) {
  const auto door = StatusSocket::open(board_);
  ASSERT_TRUE(door);
  struct stat folder {};
  struct stat socket {};
  ASSERT_EQ(stat((folder_ / "imuscope").c_str(), &folder), 0);
  ASSERT_EQ(stat((*door)->path().c_str(), &socket), 0);
  EXPECT_EQ(folder.st_mode & 0777U, 0700U);
  EXPECT_EQ(socket.st_mode & 0777U & ~0700U, 0U);
  if (geteuid() != 0) GTEST_SKIP() << "to be another user needs root";
  board_.put(test::example_status(), host_now());
  // Even one to whom the names were opened is not answered.
  std::filesystem::permissions(folder_, std::filesystem::perms::all);
  std::filesystem::permissions(folder_ / "imuscope", std::filesystem::perms::all);
  std::filesystem::permissions((*door)->path(), std::filesystem::perms::all);
  EXPECT_FALSE(holds_for_nobody([&] { return ask_status((*door)->path()).has_value(); }))
      << "a stranger was answered";
}

TEST_F(StatusDoor, AFolderInWhichOthersMayWriteIsRefused) {
  std::filesystem::create_directory(folder_ / "imuscope");
  std::filesystem::permissions(folder_ / "imuscope", std::filesystem::perms::all);
  const auto door = StatusSocket::open(board_);
  ASSERT_FALSE(door);
  EXPECT_THAT(door.error().text(), HasSubstr("is not this user's alone"));
}

TEST_F(StatusDoor, ALinkInPlaceOfTheFolderIsRefused) {
  if (geteuid() != 0) GTEST_SKIP() << "to be another user needs root, whose own links are believed";
  std::filesystem::create_directory(folder_ / "elsewhere");
  std::filesystem::create_symlink(folder_ / "elsewhere", folder_ / "imuscope");
  for (const auto& place : {folder_, folder_ / "elsewhere", folder_ / "imuscope"})
    ASSERT_EQ(lchown(place.c_str(), kNobody, kNobody), 0);
  EXPECT_FALSE(holds_for_nobody([&] { return StatusSocket::open(board_).has_value(); }));
  std::filesystem::remove(folder_ / "imuscope");
  EXPECT_TRUE(holds_for_nobody([&] { return StatusSocket::open(board_).has_value(); }));
}

TEST_F(StatusDoor, WhoeverTakesNoByteHoldsNobodyAndWhatAKilledRunLeftIsRemoved) {
  const auto door = StatusSocket::open(board_);
  ASSERT_TRUE(door);
  status_t large = test::example_status();
  large.last_event = std::string(300'000, 'x');
  board_.put(large, host_now());
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strcpy(address.sun_path, (*door)->path().c_str());
  const Descriptor deaf(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  ASSERT_EQ(connect(deaf.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  bool answered = false;
  for (int i = 0; i < 10 && !answered; ++i) answered = ask_status((*door)->path()).has_value();
  EXPECT_TRUE(answered) << "after its patience with the deaf one";

  const auto left = folder_ / "imuscope" / "99999999.status";
  std::strcpy(address.sun_path, left.c_str());
  {
    const Descriptor killed(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    ASSERT_EQ(bind(killed.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  ASSERT_TRUE(std::filesystem::exists(left));
  EXPECT_FALSE(ask_status(left));
  setenv("RUNTIME_DIRECTORY", (folder_ / "imuscope").c_str(), 1);
  std::filesystem::rename((*door)->path(), folder_ / "imuscope" / "1.status");
  const auto second = StatusSocket::open(board_);
  unsetenv("RUNTIME_DIRECTORY");
  ASSERT_TRUE(second) << second.error().text();
  EXPECT_FALSE(std::filesystem::exists(left));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "imuscope" / "1.status"))
      << "a run that answers keeps its own";
}

TEST_F(StatusDoor, WithoutARunItSaysWhatToDo) {
  const auto found = find_status_sockets();
  if (found) GTEST_SKIP() << "a run of this PC is under way";
  EXPECT_THAT(found.error().text(), HasSubstr("imuscope run"));
}

}  // namespace
}  // namespace imuscope
