#include "rt/thread_setup.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <thread>

namespace imuscope {
namespace {

using testing::HasSubstr;

constexpr uid_t kNobody = 65534;

/// Runs `body` in a child process without privileges; its return value is the exit code (at most 255).
int as_nobody(const std::function<int()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit none{0, 0};
    const rlimit small{65536, 65536};
    if (setrlimit(RLIMIT_RTPRIO, &none) != 0 || setrlimit(RLIMIT_MEMLOCK, &small) != 0) _exit(200);
    if (geteuid() == 0 && (setgid(kNobody) != 0 || setuid(kNobody) != 0)) _exit(201);
    _exit(body());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

bool may_use_fifo() {
  bool granted = false;
  std::thread probe([&] {
    sched_param parameters{};
    parameters.sched_priority = 1;
    granted = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0;
  });
  probe.join();
  return granted;
}

TEST(ThreadSetup, GrantsNamePriorityAndCore) {
  if (!may_use_fifo()) GTEST_SKIP() << "SCHED_FIFO is not permitted here; run as root or with rtprio";
  std::vector<Error> refused;
  std::string name(16, '\0');
  int policy = -1;
  sched_param parameters{};
  int core = -1;
  std::thread thread([&] {
    refused = setup_this_thread({"estimator-of-the-run", Scheduling::kFifo, 7, {0}});
    pthread_getname_np(pthread_self(), name.data(), name.size());
    pthread_getschedparam(pthread_self(), &policy, &parameters);
    core = sched_getcpu();
  });
  thread.join();
  EXPECT_TRUE(refused.empty()) << refused.front().text();
  EXPECT_STREQ(name.c_str(), "estimator-of-th");
  EXPECT_EQ(policy, SCHED_FIFO);
  EXPECT_EQ(parameters.sched_priority, 7);
  EXPECT_EQ(core, 0);
}

TEST(ThreadSetup, IdleIsGrantedToEverybody) {
  EXPECT_EQ(as_nobody([] {
              const auto refused = setup_this_thread({"modeller", Scheduling::kIdle, 0, {}});
              int policy = -1;
              sched_param parameters{};
              pthread_getschedparam(pthread_self(), &policy, &parameters);
              return refused.empty() && policy == SCHED_IDLE ? 0 : 1;
            }),
            0);
}

TEST(ThreadSetup, RefusedFifoNamesThreadPriorityAndTheExactRemedyAndRunsOn) {
  EXPECT_EQ(as_nobody([] {
              const auto refused = setup_this_thread({"io", Scheduling::kFifo, 42, {}});
              if (refused.size() != 1) return 1;
              const std::string text = refused.front().text();
              if (text.find("thread io: SCHED_FIFO priority 42") == std::string::npos) return 2;
              if (text.find("LimitRTPRIO=42") == std::string::npos) return 3;
              if (text.find("65534 - rtprio 42") == std::string::npos) return 4;
              return 0;
            }),
            0);
}

TEST(ThreadSetup, RefusedMemoryLockNamesTheLimitAndTheRemedy) {
  EXPECT_EQ(as_nobody([] {
              const auto locked = lock_memory();
              if (locked.has_value()) return 1;
              const std::string text = locked.error().text();
              if (text.find("64 kB") == std::string::npos) return 2;
              if (text.find("LimitMEMLOCK=infinity") == std::string::npos) return 3;
              // Running on means that memory can still be had.
              const std::vector<char> memory(std::size_t{1} << 20U, 'x');
              return memory.back() == 'x' ? 0 : 4;
            }),
            0);
}

TEST(ThreadSetup, MissingCoresAreNamedTogetherWithThosePermitted) {
  std::vector<Error> partly;
  std::vector<Error> wholly;
  std::thread([&] { partly = setup_this_thread({"io", Scheduling::kNormal, 0, {0, 1023}}); }).join();
  std::thread([&] { wholly = setup_this_thread({"io", Scheduling::kNormal, 0, {-1, 5000}}); }).join();
  ASSERT_EQ(partly.size(), 1U) << "the kernel ignores a missing core beside a present one; we must not";
  EXPECT_THAT(partly.front().what, HasSubstr("core 1023 refused, it runs on core 0"));
  ASSERT_EQ(wholly.size(), 1U);
  EXPECT_THAT(wholly.front().what, HasSubstr("core -1,5000 refused"));
  EXPECT_THAT(wholly.front().remedy, HasSubstr("may use cores 0"));
}

TEST(ThreadSetup, PriorityOutOfRangeSaysSo) {
  std::vector<Error> refused;
  std::thread([&] { refused = setup_this_thread({"io", Scheduling::kFifo, 100, {}}); }).join();
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_THAT(refused.front().text(), HasSubstr("priority 100 does not exist; choose a number from 1 to 99"));
}

TEST(ThreadSetup, AnIdleThreadWhoseEndIsWaitedForIsIdleNoMore) {
  std::atomic<bool> idle{false};
  std::atomic<bool> stop{false};
  std::thread thread([&] {
    idle.store(setup_this_thread({"idler", Scheduling::kIdle, 0, {}}).empty());
    while (!stop.load()) std::this_thread::yield();
  });
  while (!idle.load()) std::this_thread::yield();
  const auto policy = [&] {
    int value = -1;
    sched_param parameters{};
    pthread_getschedparam(thread.native_handle(), &value, &parameters);
    return value;
  };
  EXPECT_EQ(policy(), SCHED_IDLE);
  run_as(thread, Scheduling::kNormal);
  EXPECT_EQ(policy(), SCHED_OTHER);
  stop.store(true);
  thread.join();
}

TEST(ThreadSetup, ACoreThreadIsSetUpWhenItsStartReturnsAndTellsWhatWasRefused) {
  std::vector<Error> refusals{{ErrorKind::kWork, "what was refused before", "stays"}};
  std::atomic<bool> goes_on{false};
  std::string name(16, '\0');
  std::thread thread = start_core_thread({"of-the-core", Scheduling::kNormal, 0, {0, 1023}}, refusals, [&] {
    while (!goes_on.load()) std::this_thread::yield();
    pthread_getname_np(pthread_self(), name.data(), name.size());
  });
  // It has not gone on yet: what is known here was known before its work.
  ASSERT_EQ(refusals.size(), 2U);
  EXPECT_EQ(refusals[0].what, "what was refused before");
  EXPECT_THAT(refusals[1].what, HasSubstr("thread of-the-core: core 1023 refused"));
  goes_on.store(true);
  thread.join();
  EXPECT_STREQ(name.c_str(), "of-the-core");
}

TEST(ThreadSetup, StackSizeHoldsForLaterThreads) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "ThreadSanitizer keeps more of its own for a thread than this stack holds";
#endif
  ASSERT_EQ(as_nobody([] {
              if (!set_thread_stack_size(256 * 1024).has_value()) return 1;
              if (set_thread_stack_size(1).has_value()) return 2;
              std::size_t bytes = 0;
              std::thread([&] {
                prefault_stack(128 * 1024);
                pthread_attr_t attributes;
                pthread_getattr_np(pthread_self(), &attributes);
                pthread_attr_getstacksize(&attributes, &bytes);
                pthread_attr_destroy(&attributes);
              }).join();
              return bytes == 256 * 1024 ? 0 : 3;
            }),
            0);
}

}  // namespace
}  // namespace imuscope
