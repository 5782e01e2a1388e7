/// Publishes every kind of message ten times a second, with numbers that move: something for viewers to show.
/// Usage: example_bus SECONDS

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "example_messages.h"
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
    navigation.v_n_mps = 10.0 * std::sin(phase);
    navigation.heading_deg = phase;
    bus->publish(navigation, "NAVIGATION");
    bus->publish(test::example_odometry(), "ODOMETRY");
    bus->publish(test::example_pc_clock(), "PC_CLOCK");
    auto calibration = test::example_calibration();
    calibration.psi_x_deg = std::cos(phase);
    bus->publish(calibration, "CALIBRATION", "mtx1");
    auto error = test::example_error();
    error.rows.front().e_gyro_x_radps = 0.02 * std::sin(3.0 * phase);
    bus->publish(error, "ERROR", "mtx1");
    bus->publish(test::example_status(), "STATUS");
    bus->publish(test::example_wavelet_variance(), "WV", "mtx1");
    bus->publish(test::example_noise_model(), "NOISE_MODEL", "mtx1");
    bus->publish(test::example_dynamics(), "DYNAMICS", "mtx1");
    bus->publish(test::example_event(), "EVENT");
    bus->publish(test::example_virtual_imu(), "VIRTUAL");
    bus->publish(pose_t{}, "POSE");
    bus->publish(ins_t{}, "INS");
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return 0;
}
