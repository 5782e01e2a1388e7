#include "service/noise_feedback.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "service/noise_series.h"

namespace imuscope {

namespace {

/// A process of at most this time constant acts like noise on the filter, a slower one like a bias.
constexpr double kFastTau_s = 1.0;
constexpr double kBelievedVarianceRatio = 100.0;

struct FittedProcess {
  std::string name;
  double sd = 0.0;
  double tau_s = 0.0;  ///< of a GM
};

/// WN and GM processes of a model whose parameters are all known.
std::vector<FittedProcess> processes_of(const AxisNoiseModel& model) {
  std::vector<FittedProcess> processes;
  for (const auto& parameter : model.parameters) {
    if (!std::isfinite(parameter.value) || parameter.value <= 0.0) return {};
    if (processes.empty() || processes.back().name != parameter.process)
      processes.push_back({parameter.process, 0.0, 0.0});
    if (parameter.name == "sigma2") processes.back().sd = std::sqrt(parameter.value);
    if (parameter.name == "beta") processes.back().tau_s = 1.0 / parameter.value;
  }
  return processes;
}

bool believed(double sd, double present_sd) {
  if (!(sd > 0.0)) return false;
  if (!(present_sd > 0.0)) return true;
  const double ratio = sd * sd / (present_sd * present_sd);
  return ratio < kBelievedVarianceRatio && ratio > 1.0 / kBelievedVarianceRatio;
}

void update_triad(const std::vector<FittedProcess>& processes, std::size_t axis, TriadNoise& triad) {
  const double fast_part = triad.fast_sd[axis];
  const double present_sd = std::hypot(triad.white_sd[axis], fast_part);
  double white_sd = 0.0;
  double fast_sd = 0.0;
  double fast_tau_s = 0.0;
  for (const auto& process : processes) {
    if (process.name == "WN") white_sd = process.sd;
    const bool is_fast = process.tau_s > 0.0 && process.tau_s <= kFastTau_s;
    if (is_fast && (fast_sd == 0.0 || process.tau_s < fast_tau_s)) {
      fast_sd = process.sd;
      fast_tau_s = process.tau_s;
    }
  }
  if (!(white_sd > 0.0) || !believed(std::hypot(white_sd, fast_sd), present_sd)) return;
  triad.white_sd[axis] = white_sd;
  triad.fast_sd[axis] = fast_sd;
  triad.fast_time_constant_s[axis] = fast_tau_s;
}

void update_bias(const std::vector<FittedProcess>& processes, GaussMarkovConfig& bias) {
  const FittedProcess* slowest = nullptr;
  for (const auto& process : processes) {
    if (process.tau_s > kFastTau_s && (slowest == nullptr || process.tau_s > slowest->tau_s))
      slowest = &process;
  }
  if (slowest == nullptr || !believed(slowest->sd, bias.sd)) return;
  bias = {slowest->sd, slowest->tau_s};
}

template <typename Message, typename Noise, typename Copy>
void copy_fields(Message& message, Noise& noise, const Copy& copy) {
  for (std::size_t regime = 0; regime < kRegimeCount; ++regime) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      copy(message.gyro_white_sd[regime][axis], noise.gyro[regime].white_sd[axis]);
      copy(message.gyro_fast_sd[regime][axis], noise.gyro[regime].fast_sd[axis]);
      copy(message.gyro_fast_tau_s[regime][axis], noise.gyro[regime].fast_time_constant_s[axis]);
      copy(message.accel_white_sd[regime][axis], noise.accel[regime].white_sd[axis]);
      copy(message.accel_fast_sd[regime][axis], noise.accel[regime].fast_sd[axis]);
      copy(message.accel_fast_tau_s[regime][axis], noise.accel[regime].fast_time_constant_s[axis]);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    copy(message.gyro_bias_sd[axis], noise.gyro_bias[axis].sd);
    copy(message.gyro_bias_tau_s[axis], noise.gyro_bias[axis].time_constant_s);
    copy(message.accel_bias_sd[axis], noise.accel_bias[axis].sd);
    copy(message.accel_bias_tau_s[axis], noise.accel_bias[axis].time_constant_s);
  }
}

}  // namespace

StudyNoise updated_noise(const StudyNoise& current, const NoiseModelReport& fitted) {
  StudyNoise updated = current;
  for (const Regime regime : {Regime::kStatic, Regime::kDynamic}) {  // the later one's bias process stays
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const auto found =
          std::find_if(fitted.models.begin(), fitted.models.end(), [&](const AxisNoiseModel& m) {
            return m.axis == axis_name(axis) && m.regime == regime_name(regime);
          });
      if (found == fitted.models.end() || !found->identifiable) continue;
      const auto processes = processes_of(*found);
      const bool is_gyro = axis < 3;
      auto& triads = is_gyro ? updated.gyro : updated.accel;
      auto& biases = is_gyro ? updated.gyro_bias : updated.accel_bias;
      update_triad(processes, axis % 3, triads[static_cast<std::size_t>(regime)]);
      update_bias(processes, biases[axis % 3]);
    }
  }
  return updated;
}

applied_model_t applied_model_record(const AppliedNoise& applied, const std::string& device) {
  static_assert(kRegimeCount == 2, "applied_model_t has room for two regimes");
  applied_model_t record{};
  record.device = device;
  record.tick = applied.tick;
  record.samples = applied.model.samples;
  copy_fields(record, applied.model.noise, [](double& field, const double& value) { field = value; });
  return record;
}

AppliedNoise applied_noise_of(const applied_model_t& record, std::size_t study) {
  AppliedNoise applied{study, record.tick, {record.samples, {}}};
  copy_fields(record, applied.model.noise, [](const double& field, double& value) { value = field; });
  return applied;
}

}  // namespace imuscope
