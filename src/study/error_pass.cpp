#include "study/error_pass.h"

#include <tbb/parallel_for.h>

#include "estimation/error_process/row_low_pass.h"

namespace imuscope {

namespace {

KeptEpoch kept(const SImuEpoch& epoch) {
  return {epoch.study,
          epoch.time,
          epoch.t_d_s,
          epoch.utc,
          epoch.sample,
          epoch.omega_ib_b_radps,
          epoch.omega_dot_ib_b_radps2,
          epoch.omega_ddot_ib_b_radps3,
          epoch.f_b_mps2,
          epoch.f_dot_b_mps3,
          epoch.reference_gyro_bias_radps,
          epoch.reference_accel_bias_mps2,
          epoch.C_b_s,
          epoch.r_bs_b_m,
          epoch.regime};
}

SImuEpoch epoch_of(const KeptEpoch& kept) {
  SImuEpoch epoch;
  epoch.study = kept.study;
  epoch.time = kept.time;
  epoch.t_d_s = kept.t_d_s;
  epoch.utc = kept.utc;
  epoch.sample = kept.sample;
  epoch.omega_ib_b_radps = kept.omega_ib_b_radps;
  epoch.omega_dot_ib_b_radps2 = kept.omega_dot_ib_b_radps2;
  epoch.omega_ddot_ib_b_radps3 = kept.omega_ddot_ib_b_radps3;
  epoch.f_b_mps2 = kept.f_b_mps2;
  epoch.f_dot_b_mps3 = kept.f_dot_b_mps3;
  epoch.reference_gyro_bias_radps = kept.reference_gyro_bias_radps;
  epoch.reference_accel_bias_mps2 = kept.reference_accel_bias_mps2;
  epoch.C_b_s = kept.C_b_s;
  epoch.r_bs_b_m = kept.r_bs_b_m;
  epoch.regime = kept.regime;
  return epoch;
}

ReferenceBias bias_at(const ReferenceBiasTrack& biases, const SImuEpoch& epoch) {
  return biases.at(epoch.time + from_seconds(epoch.t_d_s));
}

/// The common low-pass of every S-IMU; none where none is configured.
std::vector<RowLowPass> low_passes(const Configuration& configuration) {
  std::vector<RowLowPass> filters;
  if (configuration.error_process.low_pass_hz <= 0.0) return filters;
  for (const auto index : configuration.study_indices())
    filters.emplace_back(configuration.devices[index].rate_hz, configuration.error_process.low_pass_hz);
  return filters;
}

}  // namespace

Result<EpochGatherer> EpochGatherer::create(const OutputFolder& folder, std::size_t n_studies) {
  return Spool<KeptEpoch>::create(folder).map(
      [&](Spool<KeptEpoch>&& epochs) { return EpochGatherer(std::move(epochs), n_studies); });
}

void EpochGatherer::on_epoch(const SImuEpoch& epoch, const TickFacts&) noexcept {
  if ((epoch.sample.flags & kHasTemperature) != 0)
    temperatures_[epoch.study].add(epoch.time, epoch.sample.temperature_degC);
  epochs_.add(kept(epoch));
}

Result<void> EpochGatherer::make_rows(const Configuration& configuration, const FormerMountings& former,
                                      const ReferenceBiasTrack& biases, std::vector<RowSpool>& rows) {
  std::vector<RowLowPass> low_pass = low_passes(configuration);
  epochs_.rewind();
  if (!epochs_.whole())
    return work_error("the error process could not be kept on the disk of the run folder",
                      "make room there, or choose another --out folder");
  const auto add_row = [&](const SImuEpoch& epoch) {
    if (!is_final_mounting(former[epoch.study], epoch.time)) return;
    ErrorRow row = error_row(epoch, {epoch.C_b_s, epoch.r_bs_b_m}, bias_at(biases, epoch));
    if (!low_pass.empty()) low_pass[epoch.study].apply(row);
    rows[epoch.study].add(row);
  };
  // Block by block: the rows of each S-IMU and the vehicle's motion side by side, each in order of time.
  std::vector<KeptEpoch> block;
  while (read_block(block, epochs_)) {
    tbb::parallel_for(std::size_t{0}, rows.size() + 1, [&](std::size_t of) {
      for (const KeptEpoch& next : block) {
        if (of == rows.size()) {
          const SImuEpoch epoch = epoch_of(next);
          watch_.add(epoch, bias_at(biases, epoch));
        } else if (next.study == of) {
          add_row(epoch_of(next));
        }
      }
    });
  }
  return {};
}

}  // namespace imuscope
