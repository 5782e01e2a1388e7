/// The project's ring beside boost::lockfree::spsc_queue: a 128-byte element, 1024 places, two threads.
/// Usage: ring_speed [ROUNDS]      prints medians over interleaved rounds; for reading, no gate

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

#include "rt/spsc_ring.h"

namespace {

constexpr std::size_t kPlaces = 1024;
constexpr int kElements = 1'000'000;
constexpr int kRoundTrips = 100'000;

struct Element {
  std::array<std::uint64_t, 16> words;
};

class Ours {
 public:
  bool push(const Element& element) { return ring_.try_push(element); }
  bool pop(Element& element) { return ring_.try_pop(element); }

 private:
  imuscope::SpscRing<Element, kPlaces> ring_;
};

class Boosts {
 public:
  bool push(const Element& element) { return queue_.push(element); }
  bool pop(Element& element) { return queue_.pop(element); }

 private:
  boost::lockfree::spsc_queue<Element, boost::lockfree::capacity<kPlaces>> queue_;
};

double ns_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - begin).count();
}

/// Tries until it works; a core that has nothing to do gives way, so that one processor is enough.
template <typename Step>
void until(const Step& step) {
  for (int tries = 0; !step(); ++tries) {
    if (tries > 1000) std::this_thread::yield();
  }
}

template <typename Queue>
double throughput_ns() {
  const auto queue = std::make_unique<Queue>();
  std::atomic<bool> wrong{false};
  std::thread consumer([&] {
    Element element{};
    for (std::uint64_t i = 0; i < kElements; ++i) {
      until([&] { return queue->pop(element); });
      if (element.words[0] != i) wrong = true;
    }
  });
  Element element{};
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0; i < kElements; ++i) {
    element.words[0] = i;
    until([&] { return queue->push(element); });
  }
  consumer.join();
  if (wrong) std::abort();
  return ns_since(begin) / kElements;
}

template <typename Queue>
double round_trip_ns() {
  const auto there = std::make_unique<Queue>();
  const auto back = std::make_unique<Queue>();
  std::thread echo([&] {
    Element element{};
    for (int i = 0; i < kRoundTrips; ++i) {
      until([&] { return there->pop(element); });
      until([&] { return back->push(element); });
    }
  });
  Element element{};
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < kRoundTrips; ++i) {
    until([&] { return there->push(element); });
    until([&] { return back->pop(element); });
  }
  const double ns = ns_since(begin) / kRoundTrips;
  echo.join();
  return ns;
}

template <typename Queue>
double one_thread_ns() {
  const auto queue = std::make_unique<Queue>();
  Element element{};
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < kElements; ++i) {
    (void)queue->push(element);
    (void)queue->pop(element);
  }
  return ns_since(begin) / kElements;
}

struct Series {
  std::vector<double> values;
  [[nodiscard]] double median() {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                     values.end());
    return values[values.size() / 2];
  }
};

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::max(1, std::atoi(argv[1])) : 9;
  std::array<Series, 6> series;
  for (int round = 0; round < rounds; ++round) {
    series[0].values.push_back(throughput_ns<Ours>());
    series[1].values.push_back(throughput_ns<Boosts>());
    series[2].values.push_back(round_trip_ns<Ours>());
    series[3].values.push_back(round_trip_ns<Boosts>());
    series[4].values.push_back(one_thread_ns<Ours>());
    series[5].values.push_back(one_thread_ns<Boosts>());
  }
  fmt::print(
      "| ring of {} x {} B, median of {} | throughput, ns | round trip, ns | push + pop, one thread, ns |\n",
      kPlaces, sizeof(Element), rounds);
  fmt::print("|---|---|---|---|\n");
  fmt::print("| imuscope::SpscRing | {:.1f} | {:.0f} | {:.1f} |\n", series[0].median(), series[2].median(),
             series[4].median());
  fmt::print("| boost::lockfree::spsc_queue | {:.1f} | {:.0f} | {:.1f} |\n", series[1].median(),
             series[3].median(), series[5].median());
  return 0;
}
