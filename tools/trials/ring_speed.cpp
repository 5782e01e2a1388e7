/// The project's ring beside boost::lockfree::spsc_queue: a 128-byte element, 1024 places, two threads.
/// Medians over interleaved rounds; for reading, no gate.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "rt/spsc_ring.h"
#include "tools/benchmarks/bench_report.h"

namespace {

constexpr std::size_t kPlaces = 1024;
/// A round trip waits for the other thread twice; so many fewer are made of them.
constexpr std::uint64_t kElementsPerRoundTrip = 10;

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
double throughput_ns(std::uint64_t elements) {
  const auto queue = std::make_unique<Queue>();
  std::atomic<bool> wrong{false};
  std::thread consumer([&] {
    Element element{};
    for (std::uint64_t i = 0; i < elements; ++i) {
      until([&] { return queue->pop(element); });
      if (element.words[0] != i) wrong = true;
    }
  });
  Element element{};
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0; i < elements; ++i) {
    element.words[0] = i;
    until([&] { return queue->push(element); });
  }
  consumer.join();
  if (wrong) std::abort();
  return ns_since(begin) / static_cast<double>(elements);
}

template <typename Queue>
double round_trip_ns(std::uint64_t elements) {
  const auto there = std::make_unique<Queue>();
  const auto back = std::make_unique<Queue>();
  const std::uint64_t trips = std::max<std::uint64_t>(1, elements / kElementsPerRoundTrip);
  std::thread echo([&] {
    Element element{};
    for (std::uint64_t i = 0; i < trips; ++i) {
      until([&] { return there->pop(element); });
      until([&] { return back->push(element); });
    }
  });
  Element element{};
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0; i < trips; ++i) {
    until([&] { return there->push(element); });
    until([&] { return back->pop(element); });
  }
  const double ns = ns_since(begin) / static_cast<double>(trips);
  echo.join();
  return ns;
}

template <typename Queue>
double one_thread_ns(std::uint64_t elements) {
  const auto queue = std::make_unique<Queue>();
  Element element{};
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0; i < elements; ++i) {
    (void)queue->push(element);
    (void)queue->pop(element);
  }
  return ns_since(begin) / static_cast<double>(elements);
}

/// One way to use a queue, timed in both.
struct Use {
  const char* what;
  double (*ours)(std::uint64_t elements);
  double (*boosts)(std::uint64_t elements);
  double goal_ns;  ///< measured of a good ring of this kind on two virtual cores; 0: none
  std::vector<double> ours_ns{};
  std::vector<double> boosts_ns{};
};

bench::Row row_of(const Use& use) {
  bench::Row row;
  row.group = "ring";
  row.what = use.what;
  row.value = bench::median(use.ours_ns);
  row.reference = bench::median(use.boosts_ns);
  row.ratio = row.value / *row.reference;
  row.against = "x boost::lockfree::spsc_queue";
  row.unit = "ns";
  if (use.goal_ns > 0.0)
    row.goal = bench::Goal{bench::Goal::Side::kAtMost, use.goal_ns, bench::Goal::Of::kValue};
  return row;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "The project's ring beside boost::lockfree::spsc_queue: 1024 places of 128 bytes, two threads"};
  int rounds = 9;
  std::uint64_t elements = 1'000'000;
  std::string json;
  app.add_option("--rounds", rounds, "interleaved rounds of which the median counts")
      ->check(CLI::Range(1, 1000));
  app.add_option("--elements", elements, "through each queue a round, and a tenth as many round trips")
      ->check(CLI::Range(1, 1'000'000'000));
  app.add_option("--json", json, "write the rows here")->type_name("FILE");
  CLI11_PARSE(app, argc, argv);

  std::array<Use, 3> uses{
      {{"an element from thread to thread", throughput_ns<Ours>, throughput_ns<Boosts>, 50.0},
       {"round trip through two", round_trip_ns<Ours>, round_trip_ns<Boosts>, 450.0},
       {"push and pop, one thread", one_thread_ns<Ours>, one_thread_ns<Boosts>, 0.0}}};
  for (int round = 0; round < rounds; ++round) {
    for (Use& use : uses) {
      use.ours_ns.push_back(use.ours(elements));
      use.boosts_ns.push_back(use.boosts(elements));
    }
  }
  std::vector<bench::Row> rows;
  for (const Use& use : uses) rows.push_back(row_of(use));
  rows.front().memory_mb = bench::peak_memory_mb([&] { (void)throughput_ns<Ours>(elements); });
  return bench::finish(rows, json);
}
