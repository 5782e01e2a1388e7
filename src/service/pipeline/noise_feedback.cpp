#include "service/pipeline/noise_feedback.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "models/noise/filter_form.h"

namespace imuscope {

namespace {

constexpr double kBelievedVarianceRatio = 100.0;

bool believed(double sd, double present_sd) {
  if (!(sd > 0.0)) return false;
  if (!(present_sd > 0.0)) return true;
  const double ratio = sd * sd / (present_sd * present_sd);
  return ratio < kBelievedVarianceRatio && ratio > 1.0 / kBelievedVarianceRatio;
}

using noise::FilterTerms;

void update_triad(const FilterTerms& terms, std::size_t axis, TriadNoise& triad) {
  const double present_sd = std::hypot(triad.white_sd[axis], triad.fast_sd[axis]);
  const double white_sd = terms.white_is_determined ? std::sqrt(terms.white_variance) : 0.0;
  // One that the record cannot tell leaves what the filter has; none in the model is none.
  double fast_sd = 0.0;
  double fast_tau_s = 0.0;
  if (!terms.gauss_markov.empty() && terms.gauss_markov.front().is_fast()) {
    const FilterTerms::GaussMarkov& fastest = terms.gauss_markov.front();
    fast_sd = fastest.is_determined ? std::sqrt(fastest.variance) : triad.fast_sd[axis];
    fast_tau_s = fastest.is_determined ? fastest.tau_s() : triad.fast_time_constant_s[axis];
  }
  if (!(white_sd > 0.0) || !believed(std::hypot(white_sd, fast_sd), present_sd)) return;
  triad.white_sd[axis] = white_sd;
  triad.fast_sd[axis] = fast_sd;
  triad.fast_time_constant_s[axis] = fast_tau_s;
}

void update_bias(const FilterTerms& terms, GaussMarkovConfig& bias) {
  const FilterTerms::GaussMarkov* slowest = nullptr;
  for (const auto& process : terms.gauss_markov) {
    if (process.is_determined && !process.is_fast()) slowest = &process;
  }
  if (slowest == nullptr || !believed(std::sqrt(slowest->variance), bias.sd)) return;
  bias = {std::sqrt(slowest->variance), slowest->tau_s()};
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

SImuNoise updated_noise(const SImuNoise& current, const std::vector<AxisRefit>& axes) {
  SImuNoise updated = current;
  for (const Regime regime : {Regime::kStatic, Regime::kDynamic}) {  // the later one's bias process stays
    for (const AxisRefit& refit : axes) {
      if (refit.regime != regime || !refit.fit) continue;
      const FilterTerms terms = noise::filter_terms(*refit.fit);
      const bool is_gyro = refit.axis < 3;
      auto& triads = is_gyro ? updated.gyro : updated.accel;
      auto& biases = is_gyro ? updated.gyro_bias : updated.accel_bias;
      update_triad(terms, refit.axis % 3, triads[static_cast<std::size_t>(regime)]);
      update_bias(terms, biases[refit.axis % 3]);
    }
  }
  return updated;
}

namespace {

/// Whether one is more than `step` times the other, as variances.
bool moved(double sd, double other_sd, double step) {
  const double ratio = sd * sd / (other_sd * other_sd);
  return !(ratio <= step && ratio >= 1.0 / step) && !(sd == 0.0 && other_sd == 0.0);
}

bool moved(const TriadNoise& now, const TriadNoise& before) {
  for (std::size_t i = 0; i < now.white_sd.size(); ++i) {
    const double sd = std::hypot(now.white_sd[i], now.fast_sd[i]);
    if (moved(sd, std::hypot(before.white_sd[i], before.fast_sd[i]), NoiseFeedback::kVarianceStep))
      return true;
  }
  return false;
}

bool moved(const std::array<GaussMarkovConfig, 3>& now, const std::array<GaussMarkovConfig, 3>& before) {
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (moved(now[i].sd, before[i].sd, NoiseFeedback::kBiasStep)) return true;
    const double tau = now[i].time_constant_s;
    const double tau_before = before[i].time_constant_s;
    if (tau != tau_before && !(std::abs(std::log(tau / tau_before)) <= std::log(NoiseFeedback::kBiasStep)))
      return true;
  }
  return false;
}

bool moved(const SImuNoise& now, const SImuNoise& before) {
  for (std::size_t regime = 0; regime < kRegimeCount; ++regime) {
    if (moved(now.gyro[regime], before.gyro[regime]) || moved(now.accel[regime], before.accel[regime]))
      return true;
  }
  return moved(now.gyro_bias, before.gyro_bias) || moved(now.accel_bias, before.accel_bias);
}

void raise(TriadNoise& triad, const TriadNoise& configured, double share) {
  for (std::size_t i = 0; i < triad.white_sd.size(); ++i)
    triad.white_sd[i] = std::max(triad.white_sd[i], share * configured.white_sd[i]);
}

void raise(std::array<GaussMarkovConfig, 3>& bias, const std::array<GaussMarkovConfig, 3>& configured,
           double share) {
  for (std::size_t i = 0; i < bias.size(); ++i) {
    bias[i].sd = std::max(bias[i].sd, share * configured[i].sd);
    bias[i].time_constant_s = std::min(bias[i].time_constant_s, configured[i].time_constant_s / share);
  }
}

}  // namespace

NoiseFeedback::NoiseFeedback(const SImuNoise& configured, double floor_share)
    : configured_(configured), in_force_(configured), floor_share_(floor_share) {}

SImuNoise NoiseFeedback::floored(SImuNoise noise) const {
  for (std::size_t regime = 0; regime < kRegimeCount; ++regime) {
    raise(noise.gyro[regime], configured_.gyro[regime], floor_share_);
    raise(noise.accel[regime], configured_.accel[regime], floor_share_);
  }
  raise(noise.gyro_bias, configured_.gyro_bias, floor_share_);
  raise(noise.accel_bias, configured_.accel_bias, floor_share_);
  return noise;
}

std::optional<NewNoise> NoiseFeedback::consider(const Refit& refit) {
  const SImuNoise proposed = updated_noise(in_force_, refit.axes);
  const bool anything_new = !(proposed == in_force_);
  const SImuNoise candidate = floored(proposed);
  if (!anything_new || (version_ > 0 && !moved(candidate, in_force_))) return std::nullopt;
  in_force_ = candidate;
  ++version_;
  return NewNoise{refit.samples, in_force_, version_};
}

applied_model_t applied_model_record(const AppliedNoise& applied, const std::string& device) {
  static_assert(kRegimeCount == 2, "applied_model_t has room for two regimes");
  applied_model_t record{};
  record.device = device;
  record.tick = applied.tick;
  record.samples = applied.model.samples;
  record.version = applied.model.version;
  copy_fields(record, applied.model.noise, [](double& field, const double& value) { field = value; });
  return record;
}

AppliedNoise applied_noise_of(const applied_model_t& record, std::size_t study) {
  AppliedNoise applied{study, record.tick, {record.samples, {}, record.version}};
  copy_fields(record, applied.model.noise, [](const double& field, double& value) { value = field; });
  return applied;
}

}  // namespace imuscope
