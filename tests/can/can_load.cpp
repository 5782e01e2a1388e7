/// Loads a CAN interface with counted frames of one identifier, as full as a bus of 1 Mbit/s gets, or as fast
/// as the interface takes them. Usage: can_load INTERFACE ID(hex) FRAMES FRAMES_PER_MS(0: all at once) Data:
/// speed in 0.01 km/h and the frame's count, as load.dbc describes them. Says how many it sent and how fast.

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string>
#include <thread>
#include <vector>

#include "bus.h"

namespace {

constexpr std::uint16_t kSpeed_centi_kmph = 3600;  // 10 m/s

void load(const std::string& interface, canid_t id, std::uint32_t n_frames, std::uint32_t per_ms) {
  using std::chrono::steady_clock;
  const imuscope::test::Sender sender(interface);
  std::vector<std::uint8_t> data(8);
  std::memcpy(data.data(), &kSpeed_centi_kmph, sizeof kSpeed_centi_kmph);
  const auto began = steady_clock::now();
  for (std::uint32_t count = 0; count < n_frames; ++count) {
    // A sender that was held up makes good for it: what counts is the rate over the whole.
    if (per_ms > 0 && count % per_ms == 0)
      std::this_thread::sleep_until(began + std::chrono::milliseconds(count / per_ms));
    std::memcpy(data.data() + 4, &count, sizeof count);
    sender.classic(id, data);
  }
  const double seconds = std::chrono::duration<double>(steady_clock::now() - began).count();
  std::printf("%u frames in %.2f s, %.0f/s\n", n_frames, seconds, n_frames / seconds);
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 5) {
    std::fputs("usage: can_load INTERFACE ID FRAMES FRAMES_PER_MS\n", stderr);
    return 2;
  }
  load(argv[1], static_cast<canid_t>(std::stoul(argv[2], nullptr, 16)),
       static_cast<std::uint32_t>(std::stoul(argv[3])), static_cast<std::uint32_t>(std::stoul(argv[4])));
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "can_load: %s\n", error.what());
  return 1;
}
