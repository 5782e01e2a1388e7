#include "planted_mistakes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "base/units.h"
#include "check/check.h"

namespace imuscope::test {

namespace {

using Samples = std::vector<Sample>;

void each(Samples& samples, const std::function<void(Sample&)>& change) {
  for (Sample& sample : samples) change(sample);
}

auto scaled(std::size_t device, double gyro, double accel) {
  return [=](DriveInMemory& drive) {
    each(drive.samples[device], [=](Sample& sample) {
      for (double& w : sample.imu.omega_radps) w *= gyro;
      for (double& f : sample.imu.f_mps2) f *= accel;
    });
  };
}

using Rows = std::array<std::array<int, 3>, 3>;

Vector3 turned(const Rows& rows, const Vector3& v) {
  Vector3 out{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) out[i] += rows[i][k] * v[k];
  }
  return out;
}

auto axes(std::size_t device, const Rows& gyro, const Rows& accel) {
  return [=](DriveInMemory& drive) {
    each(drive.samples[device], [&](Sample& sample) {
      sample.imu.omega_radps = turned(gyro, sample.imu.omega_radps);
      sample.imu.f_mps2 = turned(accel, sample.imu.f_mps2);
    });
  };
}

constexpr Rows kSame{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
constexpr Rows kSwapXy{{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}};
constexpr Rows kSwapYz{{{1, 0, 0}, {0, 0, 1}, {0, 1, 0}}};
constexpr Rows kSwapXz{{{0, 0, 1}, {0, 1, 0}, {1, 0, 0}}};
constexpr Rows kCycle{{{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}};
constexpr Rows kMinusX{{{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
constexpr Rows kMinusY{{{1, 0, 0}, {0, -1, 0}, {0, 0, 1}}};
constexpr Rows kMinusZ{{{1, 0, 0}, {0, 1, 0}, {0, 0, -1}}};
constexpr Rows kMinusXyz{{{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
constexpr Rows kForwardLeftUp{{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
constexpr Rows kYawRight{{{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}}};
constexpr Rows kYawLeft{{{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}};
constexpr Rows kBackwards{{{-1, 0, 0}, {0, -1, 0}, {0, 0, 1}}};
constexpr Rows kXDown{{{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}}};
constexpr Rows kYDown{{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}};
constexpr Rows kRightForwardUp{{{0, 1, 0}, {1, 0, 0}, {0, 0, -1}}};

auto configured_rate(std::size_t device, double factor) {
  return [=](DriveInMemory& drive) { drive.configuration.devices[device].rate_hz *= factor; };
}

auto times(std::size_t device, double factor, double shift_s) {
  return [=](DriveInMemory& drive) {
    const HostTime first = drive.samples[device].front().time;
    each(drive.samples[device], [&](Sample& sample) {
      sample.time = first + from_seconds(to_seconds(sample.time - first) * factor + shift_s);
    });
  };
}

template <typename Keep>
auto kept(std::size_t device, Keep keep) {
  return [=](DriveInMemory& drive) {
    Samples& samples = drive.samples[device];
    Samples out;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (keep(i, samples.size())) out.push_back(samples[i]);
    }
    samples = std::move(out);
  };
}

double& axis_of(Sample& sample, std::size_t axis) {
  return axis < 3 ? sample.imu.omega_radps[axis] : sample.imu.f_mps2[axis - 3];
}

/// Cut off so that `share` of the samples are at the end.
auto clipped(std::size_t device, std::size_t axis, double share) {
  return [=](DriveInMemory& drive) {
    std::vector<double> values;
    for (Sample& sample : drive.samples[device]) values.push_back(axis_of(sample, axis));
    const auto at =
        values.begin() + static_cast<std::ptrdiff_t>((1.0 - share) * static_cast<double>(values.size()));
    std::nth_element(values.begin(), at, values.end());
    const double end = *at;
    each(drive.samples[device],
         [=](Sample& sample) { axis_of(sample, axis) = std::min(axis_of(sample, axis), end); });
  };
}

auto rounded(std::size_t device, std::size_t first_axis, double step) {
  return [=](DriveInMemory& drive) {
    each(drive.samples[device], [=](Sample& sample) {
      for (std::size_t axis = first_axis; axis < first_axis + 3; ++axis)
        axis_of(sample, axis) = step * std::round(axis_of(sample, axis) / step);
    });
  };
}

auto stuck(std::size_t device, std::size_t axis, double from, double to) {
  return [=](DriveInMemory& drive) {
    Samples& samples = drive.samples[device];
    const auto begin = static_cast<std::size_t>(from * static_cast<double>(samples.size()));
    const auto end = static_cast<std::size_t>(to * static_cast<double>(samples.size()));
    for (std::size_t i = begin; i < end; ++i) axis_of(samples[i], axis) = axis_of(samples[begin], axis);
  };
}

auto repeated(std::size_t device, std::size_t times) {
  return [=](DriveInMemory& drive) {
    Samples& samples = drive.samples[device];
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i].imu = samples[i - i % times].imu;
  };
}

void copy_of_reference(DriveInMemory& drive) {
  drive.samples[kStudy] = drive.samples[kReference];
  each(drive.samples[kStudy], [](Sample& sample) { sample.device = kStudy; });
  drive.configuration.devices[kStudy].rate_hz = drive.configuration.devices[kReference].rate_hz;
}

/// The second half of the drive before the first, as of another day.
void another_drive(DriveInMemory& drive) {
  Samples& samples = drive.samples[kStudy];
  Samples out = samples;
  for (std::size_t i = 0; i < samples.size(); ++i) out[i].imu = samples[samples.size() - 1 - i].imu;
  samples = std::move(out);
}

void noise_alone(DriveInMemory& drive) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise;
  each(drive.samples[kStudy], [&](Sample& sample) {
    for (double& w : sample.imu.omega_radps) w = 0.05 * noise(random);
  });
}

auto scattered(double sd_m) {
  return [=](DriveInMemory& drive) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> noise(0.0, sd_m);
    constexpr double kEarth_m = 6.371e6;
    each(drive.samples[kGnss], [&](Sample& sample) {
      sample.gnss.latitude_rad += noise(random) / kEarth_m;
      sample.gnss.longitude_rad += noise(random) / (kEarth_m * std::cos(sample.gnss.latitude_rad));
    });
  };
}

auto jumps(double size_m, std::size_t every) {
  return [=](DriveInMemory& drive) {
    constexpr double kEarth_m = 6.371e6;
    Samples& samples = drive.samples[kGnss];
    for (std::size_t i = every; i < samples.size(); i += every)
      samples[i].gnss.latitude_rad += size_m / kEarth_m;
  };
}

/// The receiver repeats a position for some seconds, from where the vehicle is at its fastest.
auto frozen(double seconds) {
  return [=](DriveInMemory& drive) {
    Samples& samples = drive.samples[kGnss];
    std::size_t fastest = 1;
    double most = 0.0;
    for (std::size_t i = 1; i + 20 < samples.size(); ++i) {
      const double north = samples[i].gnss.latitude_rad - samples[i - 1].gnss.latitude_rad;
      const double moved = std::abs(north) / to_seconds(samples[i].time - samples[i - 1].time);
      if (moved < most) continue;
      most = moved;
      fastest = i;
    }
    for (std::size_t i = fastest; i < samples.size(); ++i) {
      if (to_seconds(samples[i].time - samples[fastest].time) > seconds) break;
      samples[i].gnss = samples[fastest].gnss;
    }
  };
}

/// Several samples of one batch with the time of the last one.
auto packed(std::size_t device, std::size_t size) {
  return [=](DriveInMemory& drive) {
    Samples& samples = drive.samples[device];
    for (std::size_t i = 0; i < samples.size(); ++i)
      samples[i].time = samples[std::min(i - i % size + size - 1, samples.size() - 1)].time;
  };
}

/// What a phone calls linear acceleration.
auto without_gravity(std::size_t device) {
  return [=](DriveInMemory& drive) {
    Vector3 mean{};
    for (const Sample& sample : drive.samples[device]) {
      for (std::size_t k = 0; k < 3; ++k)
        mean[k] += sample.imu.f_mps2[k] / static_cast<double>(drive.samples[device].size());
    }
    each(drive.samples[device], [&](Sample& sample) {
      for (std::size_t k = 0; k < 3; ++k) sample.imu.f_mps2[k] -= mean[k];
    });
  };
}

/// One sample in `every` says of itself that it is at the end of its range.
auto says_clipped(std::size_t device, std::uint32_t flag, std::size_t every) {
  return [=](DriveInMemory& drive) {
    for (std::size_t i = 0; i < drive.samples[device].size(); i += every)
      drive.samples[device][i].imu.flags |= flag;
  };
}

/// Only the `length_s` of the drive that begin `begin_s` behind its first sample, of every device.
void cut(DriveInMemory& drive, double begin_s, double length_s) {
  HostTime first = drive.samples[kReference].front().time;
  for (std::size_t device = 0; device < drive.samples.size(); ++device) {
    Samples& samples = drive.samples[device];
    // A clock of its own begins anywhere.
    const HostTime zero = drive.has_own_clock[device] ? samples.front().time : first;
    Samples out;
    for (const Sample& sample : samples) {
      const double time_s = to_seconds(sample.time - zero) - begin_s;
      if (time_s >= 0.0 && time_s < length_s) out.push_back(sample);
    }
    samples = std::move(out);
  }
}

double turned_rad(const Samples& samples, double begin_s, double length_s) {
  double rad = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double time_s = to_seconds(samples[i].time - samples.front().time) - begin_s;
    if (time_s < 0.0 || time_s >= length_s) continue;
    rad += std::abs(samples[i].imu.omega_radps[2]) * to_seconds(samples[i].time - samples[i - 1].time);
  }
  return rad;
}

/// The seconds of the drive with the least or the most of turning, as one who records too little has them.
auto a_part(double length_s, bool with_turns) {
  return [=](DriveInMemory& drive) {
    const Samples& reference = drive.samples[kReference];
    const double span_s = to_seconds(reference.back().time - reference.front().time);
    double best_s = 0.0;
    double best_rad = turned_rad(reference, 0.0, length_s);
    for (double begin_s = 5.0; begin_s + length_s < span_s; begin_s += 5.0) {
      const double rad = turned_rad(reference, begin_s, length_s);
      if (with_turns ? rad <= best_rad : rad >= best_rad) continue;
      best_rad = rad;
      best_s = begin_s;
    }
    cut(drive, best_s, length_s);
  };
}

void add_imu_mistakes(std::vector<Mistake>& all) {
  for (const std::size_t device : {kReference, kStudy}) {
    const std::string who = device == kReference ? "reference" : "study";
    const auto add = [&](const std::string& what, auto plant, const std::string& check,
                         const std::string& key = {}, const std::string& value = {}) {
      all.push_back({who + ": " + what, plant, device, check, key, value});
    };
    add("half the rate configured", configured_rate(device, 0.5), "rate", "rate_hz");
    add("twice the rate configured", configured_rate(device, 2.0), "rate", "rate_hz");
    add("times in milliseconds", times(device, 1e3, 0.0), "time unit", "csv.time_unit_s", "0.001");
    add("accelerometers in g", scaled(device, 1.0, 1.0 / kMps2PerG), "gravity norm", "csv.accel_unit",
        "\"g\"");
    add("accelerometers in m/s2, read as g", scaled(device, 1.0, kMps2PerG), "gravity norm", "csv.accel_unit",
        "\"m/s2\"");
    add("accelerometers twice too large", scaled(device, 1.0, 2.0), "gravity norm");
    add("gyros in deg/s", scaled(device, kDegPerRad, 1.0), "rate unit", "csv.gyro_unit", "\"deg/s\"");
    add("gyros in rad/s, read as deg/s", scaled(device, kRadPerDeg, 1.0), "rate unit", "csv.gyro_unit",
        "\"rad/s\"");
    add("forces of the wrong sign", axes(device, kSame, kMinusXyz), "sign of forces", "csv.accel_columns");
    add("gyro range too small", clipped(device, 2, 0.02), "saturation");
    add("accelerometer range too small", clipped(device, 3, 0.02), "saturation");
    add("gyro in coarse steps", rounded(device, 0, 0.1), "quantisation");
    add("accelerometer in coarse steps", rounded(device, 3, 1.0), "quantisation");
    add("a gyro that stands", stuck(device, 0, 0.3, 0.5), "stuck axis");
    add("an accelerometer that stands", stuck(device, 4, 0.5, 1.0), "stuck axis");
    add("every sample twice", repeated(device, 2), "repeated samples");
    add("every sample five times", repeated(device, 5), "repeated samples");
    add("batches of four under one time", packed(device, 4), "repeated samples");
    add("forces without gravity", without_gravity(device), "gravity norm");
    add("accelerometers in thousandths of g", scaled(device, 1.0, 1e3 / kMps2PerG), "gravity norm");
    add("gyros at the end of their range by their own word", says_clipped(device, kGyroClipZ, 50),
        "saturation");
    add("accelerometers at the end of their range by their own word", says_clipped(device, kAccelClipX, 200),
        "saturation");
    add("a hole of ten seconds",
        kept(device, [](std::size_t i, std::size_t n) { return i < n / 2 || i > n / 2 + 1000; }),
        "missing samples");
    add("a sample in ten lost", kept(device, [](std::size_t i, std::size_t) { return i % 10 != 3; }),
        "missing samples");
  }
}

void add_axis_mistakes(std::vector<Mistake>& all) {
  const auto reference = [&](const std::string& what, const Rows& rows, const std::string& value) {
    all.push_back(
        {"reference: " + what, axes(kReference, rows, rows), kReference, "reference axes", "axes", value});
  };
  reference("forward-left-up", kForwardLeftUp, "\"+x -y -z\"");
  reference("yawed to the right", kYawRight, "\"-y +x +z\"");
  reference("yawed to the left", kYawLeft, "\"+y -x +z\"");
  reference("backwards", kBackwards, "\"-x -y +z\"");
  reference("x down", kXDown, "\"-z +y +x\"");
  reference("y down", kYDown, "\"+x -z +y\"");
  reference("right-forward-up", kRightForwardUp, "\"+y +x -z\"");
  const auto triads = [&](std::size_t device, const std::string& what, const Rows& gyro, const Rows& accel,
                          const std::string& key, const std::string& check = "order of axes") {
    all.push_back({(device == kReference ? "reference: " : "study: ") + what,
                   axes(device, gyro, accel),
                   device,
                   check,
                   key,
                   {}});
  };
  triads(kStudy, "gyro x and y swapped", kSwapXy, kSame, "csv.gyro_columns");
  triads(kStudy, "gyro y and z swapped", kSwapYz, kSame, "csv.gyro_columns");
  triads(kStudy, "gyro x and z swapped", kSwapXz, kSame, "csv.gyro_columns");
  triads(kStudy, "gyro in another order", kCycle, kSame, "csv.gyro_columns");
  triads(kStudy, "gyro x of the wrong sign", kMinusX, kSame, "csv.gyro_columns");
  triads(kStudy, "gyro y of the wrong sign", kMinusY, kSame, "csv.gyro_columns");
  triads(kStudy, "gyro z of the wrong sign", kMinusZ, kSame, "csv.gyro_columns");
  triads(kStudy, "accelerometer x and y swapped", kSame, kSwapXy, "csv.accel_columns");
  triads(kStudy, "accelerometer x and z swapped", kSame, kSwapXz, "csv.accel_columns");
  triads(kStudy, "accelerometer z of the wrong sign", kSame, kMinusZ, "csv.accel_columns");
  triads(kStudy, "left-handed by x and y", kSwapXy, kSwapXy, "csv.gyro_columns", "handedness");
  triads(kStudy, "left-handed by z", kMinusZ, kMinusZ, "csv.accel_columns", "handedness");
  triads(kReference, "left-handed by y", kMinusY, kMinusY, "csv.gyro_columns", "handedness");
  triads(kReference, "gyro z of the wrong sign", kMinusZ, kSame, "csv.gyro_columns");
  triads(kReference, "gyro x and z swapped", kSwapXz, kSame, "csv.gyro_columns");
}

/// What a sample adds, as inertial units of navigation grade deliver it.
auto increments(std::size_t device, bool of_forces) {
  return [=](DriveInMemory& drive) {
    const double dt_s = 1.0 / drive.configuration.devices[device].rate_hz;
    scaled(device, dt_s, of_forces ? dt_s : 1.0)(drive);
  };
}

auto offset(std::size_t device, const Vector3& gyro_radps, const Vector3& accel_mps2) {
  return [=](DriveInMemory& drive) {
    each(drive.samples[device], [&](Sample& sample) {
      for (std::size_t i = 0; i < 3; ++i) {
        sample.imu.omega_radps[i] += gyro_radps[i];
        sample.imu.f_mps2[i] += accel_mps2[i];
      }
    });
  };
}

auto exchanged_triads(std::size_t device) {
  return [=](DriveInMemory& drive) {
    each(drive.samples[device], [](Sample& sample) { std::swap(sample.imu.omega_radps, sample.imu.f_mps2); });
  };
}

/// A holder that gives way: from this share of the drive on the sensor is turned about its x or y axis.
auto turns_on_its_place(double share, std::size_t axis, double turn_rad) {
  return [=](DriveInMemory& drive) {
    Samples& samples = drive.samples[kStudy];
    const std::size_t a = (axis + 1) % 3;
    const std::size_t b = (axis + 2) % 3;
    for (auto i = static_cast<std::size_t>(share * static_cast<double>(samples.size())); i < samples.size();
         ++i) {
      for (Vector3* v : {&samples[i].imu.omega_radps, &samples[i].imu.f_mps2}) {
        const Vector3 was = *v;
        (*v)[a] = std::cos(turn_rad) * was[a] - std::sin(turn_rad) * was[b];
        (*v)[b] = std::sin(turn_rad) * was[a] + std::cos(turn_rad) * was[b];
      }
    }
  };
}

auto positions(const std::function<void(GnssData&)>& change) {
  return
      [=](DriveInMemory& drive) { each(drive.samples[kGnss], [&](Sample& sample) { change(sample.gnss); }); };
}

/// Positions that came in another order than this drive has them.
void positions_of_another_drive(DriveInMemory& drive) {
  Samples& samples = drive.samples[kGnss];
  for (std::size_t i = 0; i < samples.size() / 2; ++i)
    std::swap(samples[i].gnss, samples[samples.size() - 1 - i].gnss);
}

auto one_time(std::size_t device) {
  return [=](DriveInMemory& drive) {
    const HostTime first = drive.samples[device].front().time;
    each(drive.samples[device], [&](Sample& sample) { sample.time = first; });
  };
}

void add_mistakes_of_files(std::vector<Mistake>& all) {
  for (const std::size_t device : {kReference, kStudy}) {
    const std::string who = device == kReference ? "reference: " : "study: ";
    all.push_back({who + "rates as increments", increments(device, false), device, "rate unit", "", ""});
    all.push_back(
        {who + "rates and forces as increments", increments(device, true), device, "gravity norm", "", ""});
    all.push_back({who + "gyros and accelerometers exchanged", exchanged_triads(device), device,
                   "gyros and accelerometers", "csv.gyro_columns", ""});
    all.push_back({who + "a gyro that is off by 17 deg/s", offset(device, {0.0, 0.3, 0.0}, {}), device,
                   "gyro offset", "", ""});
    all.push_back({who + "all samples of one time", one_time(device), device, "standing times", "", ""});
  }
  all.push_back({"study: gyros in thousandths of a degree a second", scaled(kStudy, 1e3 * kDegPerRad, 1.0),
                 kStudy, "rate unit", "", ""});
  all.push_back(
      {"study: it turns on its place by 20 deg", turns_on_its_place(0.5, 0, 0.35), kStudy, "moved", "", ""});
  all.push_back(
      {"study: it turns on its place by 6 deg", turns_on_its_place(0.3, 1, 0.1), kStudy, "moved", "", ""});
  all.push_back({"gnss: west counted positive",
                 positions([](GnssData& g) { g.longitude_rad = -g.longitude_rad; }), kGnss, "mirrored map",
                 "", ""});
  all.push_back({"gnss: latitude and longitude exchanged",
                 positions([](GnssData& g) { std::swap(g.latitude_rad, g.longitude_rad); }), kGnss,
                 "mirrored map", "", ""});
  const auto as_radians = [](GnssData& g) {
    g.latitude_rad *= kRadPerDeg;
    g.longitude_rad *= kRadPerDeg;
  };
  all.push_back(
      {"gnss: radians read as degrees", positions(as_radians), kGnss, "standing positions", "", ""});
  const auto three_digits = [](GnssData& g) {
    constexpr double kPerRad = 1e4 * kDegPerRad;
    g.latitude_rad = std::round(g.latitude_rad * kPerRad) / kPerRad;
    g.longitude_rad = std::round(g.longitude_rad * kPerRad) / kPerRad;
  };
  all.push_back(
      {"gnss: positions of four decimals", positions(three_digits), kGnss, "position steps", "", ""});
  all.push_back(
      {"gnss: an hour late", times(kGnss, 1.0, 3600.0), kGnss, "other time", "csv.time_offset_s", "-3600.0"});
  all.push_back({"gnss: two hours early", times(kGnss, 1.0, -7200.0), kGnss, "other time",
                 "csv.time_offset_s", "7200.0"});
  all.push_back({"gnss: of another drive", positions_of_another_drive, kGnss, "other drive", "", ""});
  const auto epoch = [](DriveInMemory& drive) {
    times(kStudy, 1.0, 1.7e8)(drive);
    drive.has_own_clock[kStudy] = false;
  };
  all.push_back({"study: times of another epoch", epoch, kStudy, "other time", "csv.clock", "\"own\""});
}

void add_other_mistakes(std::vector<Mistake>& all) {
  for (const double late_s : {18.0, -18.0, 5.0, -37.0, 2.0}) {
    char value[16];
    std::snprintf(value, sizeof value, "%.1f", -late_s);
    all.push_back({"gnss: " + std::to_string(late_s) + " s late", times(kGnss, 1.0, late_s), kGnss,
                   "time of positions", "csv.time_offset_s", std::abs(late_s) == 18.0 ? value : ""});
  }
  all.push_back({"gnss: jumps of 20 m", jumps(20.0, 97), kGnss, "position jumps", "", ""});
  all.push_back({"gnss: a jump of 100 m", jumps(100.0, 300), kGnss, "position jumps", "", ""});
  all.push_back({"gnss: frozen for 4 s", frozen(4.0), kGnss, "frozen position", "", ""});
  all.push_back({"gnss: frozen for 8 s", frozen(8.0), kGnss, "frozen position", "", ""});
  all.push_back({"gnss: sd too small", scattered(1.0), kGnss, "claimed sd", "position_sd_floor_m", ""});
  all.push_back({"gnss: sd far too small", scattered(3.0), kGnss, "claimed sd", "position_sd_floor_m", ""});
  all.push_back(
      {"gnss: a tenth of the rate configured", configured_rate(kGnss, 0.1), kGnss, "rate", "rate_hz", ""});
  all.push_back({"study: its clock 0.2 % fast", times(kStudy, 0.998, 0.0), kStudy, "clock rate",
                 "csv.time_unit_s", ""});
  all.push_back({"study: its clock 0.1 % slow", times(kStudy, 1.001, 0.0), kStudy, "clock rate",
                 "csv.time_unit_s", ""});
  const auto common_but_late = [](double shift_s) {
    return [shift_s](DriveInMemory& drive) {
      times(kStudy, 1.0, shift_s)(drive);
      drive.has_own_clock[kStudy] = false;
    };
  };
  all.push_back({"study: 7 s late", common_but_late(7.0), kStudy, "time of rates", "csv.clock", "\"own\""});
  all.push_back(
      {"study: 20 s early", common_but_late(-20.0), kStudy, "time of rates", "csv.clock", "\"own\""});
  all.push_back({"drive: half a minute without turns", a_part(30.0, false), kReference, "turns", "", ""});
  all.push_back({"drive: twenty seconds without turns", a_part(20.0, false), kReference, "turns", "", ""});
  all.push_back({"drive: curves alone", a_part(20.0, true), kReference, "rest", "", ""});
  all.push_back({"drive: a few curves alone", a_part(15.0, true), kReference, "rest", "", ""});
  all.push_back({"study: a copy of the reference", copy_of_reference, kStudy, "copy", "", ""});
  all.push_back({"study: of another drive", another_drive, kStudy, "one body", "", ""});
  all.push_back({"study: noise alone", noise_alone, kStudy, "one body", "", ""});
}

}  // namespace

std::vector<Mistake> planted_mistakes() {
  std::vector<Mistake> all;
  add_imu_mistakes(all);
  add_axis_mistakes(all);
  add_other_mistakes(all);
  add_mistakes_of_files(all);
  return all;
}

std::vector<check::Finding> look_at(const DriveInMemory& in_memory) {
  check::Drive drive(in_memory.configuration);
  for (std::size_t device = 0; device < in_memory.samples.size(); ++device) {
    drive.set_time_scale(
        device, in_memory.has_own_clock[device] ? check::TimeScale::kOwn : check::TimeScale::kShared);
    for (const Sample& sample : in_memory.samples[device]) drive.add(sample);
  }
  return check::look_at(drive);
}

bool is_named(const Mistake& mistake, const DriveInMemory& drive,
              const std::vector<check::Finding>& findings) {
  constexpr std::size_t kLines = 3;
  for (std::size_t i = 0; i < std::min(findings.size(), kLines); ++i) {
    const check::Finding& finding = findings[i];
    if (finding.check != mistake.check || finding.device != drive.configuration.devices[mistake.device].name)
      continue;
    if (mistake.key.empty()) return true;
    return std::any_of(finding.mends.begin(), finding.mends.end(), [&](const check::ConfigLine& line) {
      return line.key == mistake.key && (mistake.value.empty() || line.value == mistake.value);
    });
  }
  return false;
}

}  // namespace imuscope::test
