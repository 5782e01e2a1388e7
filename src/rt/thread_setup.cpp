#include "rt/thread_setup.h"

#include <alloca.h>
#include <linux/capability.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <future>
#include <optional>
#include <utility>

namespace imuscope {
namespace {

constexpr std::size_t kThreadNameMax = 15;          // Linux: 16 bytes with the terminating zero
constexpr unsigned long kShortTimerSlackNs = 1000;  // default is 50 us
constexpr std::size_t kPrefaultedStack =
    128 * 1024;  // what the core's threads use of theirs, with room to spare

Error refusal(std::string what, std::string remedy) {
  return {ErrorKind::kWork, std::move(what), std::move(remedy)};
}

std::string errno_text(int error) { return std::strerror(error); }

std::string fifo_remedy(int priority) {
  const std::string number = std::to_string(priority);
  if (geteuid() == 0) {
    return "root itself is refused, so a container or control group withholds real time: "
           "grant it CAP_SYS_NICE, or run 'sysctl -w kernel.sched_rt_runtime_us=-1' where "
           "RT group scheduling is built in";
  }
  return "put LimitRTPRIO=" + number + " into the systemd unit, or the line '" + std::to_string(geteuid()) +
         " - rtprio " + number +
         "' (with the user's name for the number) into /etc/security/limits.d/imuscope.conf and log in again";
}

std::optional<Error> set_scheduling(const ThreadPlan& plan) {
  sched_param parameters{};
  int policy = SCHED_OTHER;
  if (plan.scheduling == Scheduling::kFifo) {
    policy = SCHED_FIFO;
    parameters.sched_priority = plan.fifo_priority;
  } else if (plan.scheduling == Scheduling::kIdle) {
    policy = SCHED_IDLE;
  }
  const int error = pthread_setschedparam(pthread_self(), policy, &parameters);
  if (error == 0) return std::nullopt;
  if (plan.scheduling != Scheduling::kFifo) {
    return refusal("thread " + plan.name + ": scheduling class refused (" + errno_text(error) + ")",
                   "it runs at normal priority");
  }
  if (error == EINVAL) {
    return refusal(
        "thread " + plan.name + ": priority " + std::to_string(plan.fifo_priority) + " does not exist",
        "choose a number from 1 to 99");
  }
  prctl(PR_SET_TIMERSLACK, kShortTimerSlackNs);
  return refusal("thread " + plan.name + ": SCHED_FIFO priority " + std::to_string(plan.fifo_priority) +
                     " refused (" + errno_text(error) + "), deadlines will be missed under load",
                 fifo_remedy(plan.fifo_priority));
}

std::string core_list(const std::vector<int>& cores) {
  std::string text;
  for (const int core : cores) text += (text.empty() ? "" : ",") + std::to_string(core);
  return text;
}

std::vector<int> cores_of_this_thread() {
  cpu_set_t set;
  CPU_ZERO(&set);
  std::vector<int> cores;
  if (sched_getaffinity(0, sizeof set, &set) != 0) return cores;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (CPU_ISSET(static_cast<std::size_t>(core), &set)) cores.push_back(core);
  }
  return cores;
}

std::optional<Error> set_cores(const ThreadPlan& plan) {
  if (plan.cores.empty()) return std::nullopt;
  const std::vector<int> permitted = cores_of_this_thread();
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int core : plan.cores) {
    if (core >= 0 && core < CPU_SETSIZE) CPU_SET(static_cast<std::size_t>(core), &set);
  }
  pthread_setaffinity_np(pthread_self(), sizeof set, &set);
  // The kernel silently drops the cores that are absent or withheld, as long as one is left: read back.
  const std::vector<int> granted = cores_of_this_thread();
  std::vector<int> missing;
  for (const int core : plan.cores) {
    if (std::find(granted.begin(), granted.end(), core) == granted.end()) missing.push_back(core);
  }
  if (missing.empty()) return std::nullopt;
  return refusal(
      "thread " + plan.name + ": core " + core_list(missing) + " refused, it runs on core " +
          core_list(granted),
      "this process may use cores " + core_list(permitted) + "; name some of these in the configuration");
}

/// Whether memory locking is free of a limit. Under a limit, locking future memory would make a later
/// allocation fail, which is worse than a page fault.
bool memory_lock_is_unlimited(const rlimit& limit) {
  if (limit.rlim_cur == RLIM_INFINITY) return true;
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct data[_LINUX_CAPABILITY_U32S_3] = {};
  if (syscall(SYS_capget, &header, data) != 0) return false;
  return (data[CAP_TO_INDEX(CAP_IPC_LOCK)].effective & CAP_TO_MASK(CAP_IPC_LOCK)) != 0;
}

}  // namespace

std::vector<Error> setup_this_thread(const ThreadPlan& plan) {
  std::vector<Error> refused;
  pthread_setname_np(pthread_self(), plan.name.substr(0, kThreadNameMax).c_str());
  if (auto error = set_cores(plan)) refused.push_back(std::move(*error));
  if (auto error = set_scheduling(plan)) refused.push_back(std::move(*error));
  return refused;
}

void run_as(std::thread& thread, Scheduling scheduling) noexcept {
  const sched_param parameters{};
  const int policy = scheduling == Scheduling::kIdle ? SCHED_IDLE : SCHED_OTHER;
  (void)pthread_setschedparam(thread.native_handle(), policy, &parameters);
}

Result<void> lock_memory() {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  int error = EPERM;
  if (memory_lock_is_unlimited(limit)) {
    if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return {};
    error = errno;
  }
  return work_error("memory is not locked (" + errno_text(error) + "; the limit is " +
                        std::to_string(limit.rlim_cur / 1024) + " kB), a page fault may delay the estimator",
                    "put LimitMEMLOCK=infinity into the systemd unit, or the line '" +
                        std::to_string(geteuid()) +
                        " - memlock unlimited' (with the user's name for the number) into "
                        "/etc/security/limits.d/imuscope.conf and log in again");
}

Result<void> set_thread_stack_size(std::size_t bytes) {
  pthread_attr_t attributes;
  int error = pthread_attr_init(&attributes);
  if (error == 0) {
    error = pthread_attr_setstacksize(&attributes, bytes);
    if (error == 0) error = pthread_setattr_default_np(&attributes);
    pthread_attr_destroy(&attributes);
  }
  if (error == 0) return {};
  return work_error(
      "thread stacks of " + std::to_string(bytes) + " bytes refused (" + errno_text(error) + ")",
      "threads keep the default stack size of 'ulimit -s'");
}

void prefault_stack(std::size_t bytes) noexcept {
  // Through a volatile pointer and from a frame of its own, so that the writes are neither removed nor
  // hoisted.
  auto* const block = static_cast<volatile unsigned char*>(alloca(bytes));
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  for (std::size_t offset = 0; offset < bytes; offset += page) block[offset] = 0;
}

std::thread start_core_thread(const ThreadPlan& plan, std::vector<Error>& refusals,
                              std::function<void()> work) {
  std::promise<std::vector<Error>> ready;
  auto refused = ready.get_future();
  std::thread thread([plan, ready = std::move(ready), work = std::move(work)]() mutable {
    auto errors = setup_this_thread(plan);
    prefault_stack(kPrefaultedStack);
    ready.set_value(std::move(errors));
    work();
  });
  for (auto& error : refused.get()) refusals.push_back(std::move(error));
  return thread;
}

}  // namespace imuscope
