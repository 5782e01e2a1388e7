#include "models/noise/state_space.h"

#include <cmath>

#include "base/contracts.h"
#include "models/noise/power_law.h"

namespace imuscope::noise {
namespace {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::Vector2d;

/// One component's part of the form.
struct Block {
  MatrixXd F{MatrixXd(0, 0)};
  MatrixXd Q{MatrixXd(0, 0)};
  RowVectorXd H{RowVectorXd(0)};
  MatrixXd P0{MatrixXd(0, 0)};
  std::vector<bool> diffuse;
  double R = 0.0;
};

Block moving_average_block(double variance, double theta) {
  Block block;
  block.F = (Matrix2d() << 0.0, 0.0, 1.0, 0.0).finished();
  block.Q = Vector2d(variance, 0.0).asDiagonal();
  block.H = Eigen::RowVector2d(1.0, theta);
  block.P0 = variance * Matrix2d::Identity();
  block.diffuse = {false, false};
  return block;
}

Block arma(double variance, double phi, double theta) {
  Block block;
  block.F = (Matrix2d() << phi, 1.0, 0.0, 0.0).finished();
  const Vector2d drive(1.0, theta);
  block.Q = variance * drive * drive.transpose();
  block.H = Eigen::RowVector2d(1.0, 0.0);
  const double total = (1.0 + 2.0 * phi * theta + theta * theta) / ((1.0 - phi) * (1.0 + phi));
  block.P0 = variance * (Matrix2d() << total, theta, theta, theta * theta).finished();
  block.diffuse = {false, false};
  return block;
}

Block sinusoid_block(double alpha2, double b) {
  Block block;
  block.F = (Matrix2d() << std::cos(b), std::sin(b), -std::sin(b), std::cos(b)).finished();
  block.Q = Matrix2d::Zero();
  block.H = Eigen::RowVector2d(1.0, 0.0);
  block.P0 = 0.5 * alpha2 * Matrix2d::Identity();
  block.diffuse = {false, false};
  return block;
}

/// x and x', G-37.
Block resonance_block(double variance, double a, double b) {
  Block block;
  const double decay = std::exp(-a);
  const double c = std::cos(b);
  const double s = std::sin(b) / b;
  const double stiffness = a * a + b * b;
  block.F = decay * (Matrix2d() << c + a * s, s, -stiffness * s, c - a * s).finished();
  block.P0 = variance * Vector2d(1.0, stiffness).asDiagonal().toDenseMatrix();
  block.Q = block.P0 - block.F * block.P0 * block.F.transpose();
  block.H = Eigen::RowVector2d(1.0, 0.0);
  block.diffuse = {false, false};
  return block;
}

Block first_order(double transition, double driving, double start, bool diffuse) {
  Block block;
  block.F = MatrixXd::Constant(1, 1, transition);
  block.Q = MatrixXd::Constant(1, 1, driving);
  block.H = RowVectorXd::Ones(1);
  block.P0 = MatrixXd::Constant(1, 1, start);
  block.diffuse = {diffuse};
  return block;
}

Block ramp(double omega2) {
  Block block;
  block.F = (Matrix2d() << 1.0, 1.0, 0.0, 1.0).finished();
  block.Q = Matrix2d::Zero();
  block.H = Eigen::RowVector2d(1.0, 0.0);
  block.P0 = Vector2d(0.0, omega2).asDiagonal();
  block.diffuse = {true, false};
  return block;
}

Block block_of(const Component& c) {
  switch (c.kind) {
    case ProcessKind::kQuantization:
      return moving_average_block(c.amplitude, -1.0);
    case ProcessKind::kWhiteNoise: {
      Block block;
      block.R = c.amplitude;
      return block;
    }
    case ProcessKind::kMa1:
      return moving_average_block(c.amplitude, c.shape[0]);
    case ProcessKind::kArma11:
      return arma(c.amplitude, c.shape[0], c.shape[1]);
    case ProcessKind::kSinusoid:
      return sinusoid_block(c.amplitude, c.shape[0]);
    case ProcessKind::kResonance:
      return resonance_block(c.amplitude, c.shape[0], c.shape[1]);
    case ProcessKind::kFlicker:
    case ProcessKind::kPowerLaw:
      IMUSCOPE_EXPECTS(false);  // written as its sum before
      return {};
    case ProcessKind::kGaussMarkov:
      return first_order(std::exp(-c.shape[0]), -c.amplitude * std::expm1(-2.0 * c.shape[0]), c.amplitude,
                         false);
    case ProcessKind::kRandomWalk:
      return first_order(1.0, c.amplitude, 0.0, true);
    case ProcessKind::kRamp:
      return ramp(c.amplitude);
  }
  return {};
}

}  // namespace

StateSpace state_space(const Model& any) {
  const Model model = without_power_laws(any);
  std::vector<Block> blocks;
  Eigen::Index size = 0;
  for (const Component& component : model.components) {
    if (component.amplitude <= 0.0) continue;
    blocks.push_back(block_of(component));
    size += blocks.back().F.rows();
  }
  StateSpace form{MatrixXd::Zero(size, size), MatrixXd::Zero(size, size),
                  RowVectorXd::Zero(size),    0.0,
                  MatrixXd::Zero(size, size), {}};
  Eigen::Index at = 0;
  for (const Block& block : blocks) {
    const Eigen::Index n = block.F.rows();
    form.F.block(at, at, n, n) = block.F;
    form.Q.block(at, at, n, n) = block.Q;
    form.H.segment(at, n) = block.H;
    form.P0.block(at, at, n, n) = block.P0;
    form.R += block.R;
    form.diffuse.insert(form.diffuse.end(), block.diffuse.begin(), block.diffuse.end());
    at += n;
  }
  return form;
}

}  // namespace imuscope::noise
