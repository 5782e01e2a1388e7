#pragma once

/// What threads ask of the operating system: scheduling, cores, locked memory. Every wish may be refused on a
/// PC that has not been prepared; a refusal is a value that names the exact remedy, and the service runs on.
/// Called at start, before the real-time line; none of this is for the core's loop.

#include <cstddef>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "base/result.h"

namespace imuscope {

enum class Scheduling {
  kNormal,  ///< SCHED_OTHER
  kFifo,    ///< SCHED_FIFO: runs before everything normal until it sleeps
  kIdle,    ///< SCHED_IDLE: runs only when a core has nothing else to do
};

/// What one thread wishes for; see setup_this_thread().
struct ThreadPlan {
  std::string name;  ///< shown by top and ps; at most 15 characters, cut beyond
  Scheduling scheduling = Scheduling::kNormal;
  int fifo_priority = 0;   ///< 1..99, with kFifo only
  std::vector<int> cores;  ///< empty: any core
};

/// Applies the plan to the calling thread as far as the system permits. Where SCHED_FIFO is refused the
/// thread gets a timer slack of 1 us instead of the default 50 us, which is what remains to be had.
/// @return one Error for each wish that was refused; empty when all is granted
[[nodiscard]] std::vector<Error> setup_this_thread(const ThreadPlan& plan);

/// Makes an idle thread one like any other, so that it gets on where somebody waits for it, or idle again. A
/// system that refuses leaves it as it is.
/// @param scheduling  kNormal or kIdle
void run_as(std::thread& thread, Scheduling scheduling) noexcept;

/// Locks present and future memory of the process (mlockall), so that the core never waits for a page. Locked
/// memory counts whole thread stacks: call set_thread_stack_size() first.
[[nodiscard]] Result<void> lock_memory();

/// Stack size of all threads created from now on. The default of 8 MB each would be locked in full.
[[nodiscard]] Result<void> set_thread_stack_size(std::size_t bytes);

/// Touches this much of the calling thread's stack, so that no page fault is left for the core's loop. Must
/// be well below the thread's stack size.
void prefault_stack(std::size_t bytes) noexcept;

/// Starts a thread of the real-time line. It has been set up as planned, and its stack touched, when this returns;
/// what was refused is then among `refusals`.
/// @param work  what it does then; the thread ends with it
[[nodiscard]] std::thread start_core_thread(const ThreadPlan& plan, std::vector<Error>& refusals,
                                            std::function<void()> work);

}  // namespace imuscope
