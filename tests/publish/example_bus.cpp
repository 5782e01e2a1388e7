/// Publishes every kind of message ten times a second, with numbers that move: something for viewers to show.
/// Usage: example_bus SECONDS

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "example_reports.h"
#include "publish/lcm_publisher.h"

using namespace imuscope;

int main(int argc, char** argv) {
  const int seconds = argc > 1 ? std::atoi(argv[1]) : 10;
  auto bus = LcmPublisher::open();
  if (!bus) {
    std::cerr << bus.error().text() << "\n";
    return 1;
  }
  for (int i = 0; i < seconds * 10; ++i) {
    const double phase = 0.1 * i;
    auto navigation = test::example_navigation();
    navigation.v_n_mps[0] = 10.0 * std::sin(phase);
    navigation.rpy_rad[2] = phase;
    bus->publish(navigation);
    bus->publish(test::example_odometry());
    auto calibration = test::example_calibration();
    calibration.value.psi_b_rad[0] = 0.01 * std::cos(phase);
    bus->publish(calibration, "mtx1");
    auto error = test::example_error();
    error.gyro_radps[0] = 0.02 * std::sin(3.0 * phase);
    bus->publish(error, "mtx1");
    bus->publish(test::example_status());
    bus->publish(test::example_wavelet_variance());
    bus->publish(test::example_noise_model());
    bus->publish(DynamicsReport{error.utc, phase, "mtx1", i, 2 * i, {}});
    bus->publish(PersonEvent{error.utc, "example_bus", "event"});
    bus->publish(BridgeReport{});
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return 0;
}
