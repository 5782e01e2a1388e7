#include "tools/trials/batch_pairs.h"

#include <Eigen/Cholesky>

#include "estimation/alignment/accelerometer_places.h"
#include "estimation/navigation/so3.h"

namespace batch_pairs {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using imuscope::Sample;
using imuscope::SampleKind;
using imuscope::batch::ImuRecord;
using imuscope::batch::ParameterVector;
using Vector6 = Eigen::Matrix<double, 6, 1>;

namespace batch = imuscope::batch;

/// Scale and lower triangle of a triad's matrix in the frame that goes with it.
Vector6 shape_of(const Matrix3d& triad) {
  const Matrix3d L = triad * imusim::triad_frame(triad).transpose();
  Vector6 shape;
  shape << L(0, 0) - 1.0, L(1, 1) - 1.0, L(2, 2) - 1.0, L(1, 0), L(2, 0), L(2, 1);
  return shape;
}

void add(const Sample& sample, ImuRecord& record) {
  const auto vector = [](const imuscope::Vector3& v) {
    return Vector3d(v[0], v[1], v[2]).cast<float>().eval();
  };
  record.add(imuscope::to_seconds(sample.time.time_since_epoch()), vector(sample.imu.omega_radps),
             vector(sample.imu.f_mps2));
}

}  // namespace

Run run(const standard_drive::Truth& truth, const PairOptions& options, std::uint64_t seed) {
  imusim::Random random(seed, "study");
  standard_drive::DrawOptions drawn;
  drawn.world = options.world;
  drawn.reference_class = options.reference_class;
  drawn.mtx.gyro_noise = imusim::GyroNoiseChoice::kAllDynamic;
  Run out;
  out.draw = standard_drive::draw(drawn, random, seed);
  out.studies.resize(standard_drive::kStudies);
  standard_drive::Instruments instruments(truth, out.draw, seed);
  for (std::size_t k = 0; k < truth.ticks(); ++k) {
    for (const Sample& sample : instruments.next()) {
      if (sample.kind != SampleKind::kImu) continue;
      const bool reference = sample.device == standard_drive::kReferenceDevice;
      add(sample, reference ? out.reference : out.studies[sample.device - standard_drive::kFirstStudyDevice]);
    }
  }
  return out;
}

TrueSensor true_sensor(const standard_drive::Draw& draw, std::size_t study) {
  const imusim::ImuErrors& errors = draw.studies[study];
  const auto known = standard_drive::truth_of(draw, study);
  const Matrix3d gyro = imusim::triad_matrix(errors.gyro) * standard_drive::mounting_of(study);
  const Matrix3d accel = imusim::triad_matrix(errors.accel) * standard_drive::mounting_of(study);
  TrueSensor truth;
  truth.C_b_s = known.C_b_s;
  truth.x.segment<3>(batch::kLeverArm) = standard_drive::lever_arm_of(study);
  truth.x[batch::kTimeOffset] = known.t_d_s;
  truth.x.segment<6>(batch::kGyroShape) = shape_of(gyro);
  truth.x.segment<3>(batch::kAlpha) = -imuscope::log_so3(known.C_s_accel);
  truth.x.segment<6>(batch::kAccelShape) = shape_of(accel);
  truth.x[batch::kAccelDelay] = known.accel_t_d_s;
  truth.x[batch::kReferenceAccelDelay] =
      imusim::slow_delay_s(draw.reference.gyro) - imusim::slow_delay_s(draw.reference.accel);
  for (Eigen::Index j = 0; j < 6; ++j)
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      truth.x[batch::kPlaces + j] += imuscope::place_basis(axis, j).dot(errors.accel_places_s_m.col(axis));
  for (Eigen::Index j = 0; j < 9; ++j)
    truth.x[batch::kGSensitivity + j] = errors.gyro.g_sensitivity(j / 3, j % 3);
  return truth;
}

ParameterVector error_of(const batch::BatchMounting& found, const TrueSensor& truth) {
  ParameterVector error = truth.x - found.sensor.x;
  error.segment<3>(batch::kPsi) = -imuscope::log_so3(found.sensor.C_b_s.transpose() * truth.C_b_s);
  return error;
}

double nees6(const batch::BatchMounting& found, const ParameterVector& error) {
  const Vector6 mounting = error.head<6>();
  const Eigen::Matrix<double, 6, 6> P = found.covariance.topLeftCorner<6, 6>();
  return mounting.dot(P.ldlt().solve(mounting));
}

}  // namespace batch_pairs
