/// Does in a thread that bears a core thread's name what the core must not do, so that the guard can be seen
/// to see it. Usage: core_guard_offender nothing|allocate|lock|call|block

#include <fcntl.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <unistd.h>
#include <cstdlib>
#include <ctime>
#include <mutex>
#include <string>
#include <thread>

namespace {

void nap() {
  timespec t{0, 100'000};
  clock_nanosleep(CLOCK_MONOTONIC, 0, &t, nullptr);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "nothing";
  const bool as_io = what == "block";
  int pipe_ends[2] = {};
  if (pipe(pipe_ends) != 0 || write(pipe_ends[1], "x", 1) != 1) return 1;
  const int epoll = epoll_create1(0);
  static std::mutex mutex;
  std::thread([&] {
    pthread_setname_np(pthread_self(), as_io ? "imuscope-io" : "imuscope-est");
    epoll_event event{};
    const auto wait = [&] { as_io ? (void)epoll_wait(epoll, &event, 1, 0) : nap(); };
    void* volatile first = std::malloc(100);  // its heap is made now, as every real thread's is at its start
    std::free(first);
    for (int i = 0; i < 200; ++i) wait();
    if (what == "allocate") {
      void* volatile block = std::malloc(100);
      std::free(block);
    } else if (what == "lock") {
      const std::lock_guard lock(mutex);
    } else if (what == "call") {
      (void)open("/dev/null", O_RDONLY);
    } else if (what == "block") {
      char c = 0;
      if (read(pipe_ends[0], &c, 1) != 1) return;
    }
    wait();
  }).join();
  return 0;
}
