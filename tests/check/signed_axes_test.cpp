// Names and signs of axes.
#include "check/signed_axes.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <set>

namespace imuscope::check {
namespace {

TEST(SignedAxes, AreTheFortyEightOfACubeHalfOfThemRightHanded) {
  std::set<std::string> words;
  int right_handed = 0;
  for (const Eigen::Matrix3d& axes : signed_axes()) {
    EXPECT_TRUE((axes * axes.transpose()).isIdentity());
    words.insert(axes_words(axes));
    if (axes.determinant() > 0.0) ++right_handed;
  }
  EXPECT_EQ(words.size(), 48U);
  EXPECT_EQ(right_handed, 24);
}

TEST(SignedAxes, TheNearestOneOfASlightlyTurnedOneIsItself) {
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, -2, 3).normalized()).toRotationMatrix();
  for (const Eigen::Matrix3d& axes : signed_axes()) EXPECT_EQ(nearest_signed_axes(turned * axes), axes);
}

TEST(SignedAxes, ColumnsAreNamedInTheOrderAndWithTheSignsThatAreWanted) {
  Eigen::Matrix3d swap = Eigen::Matrix3d::Zero();
  swap(0, 1) = 1.0;
  swap(1, 0) = -1.0;
  swap(2, 2) = 1.0;
  EXPECT_EQ(columns_toml(swap, {"a", "b", "-c"}), "[\"b\", \"-a\", \"-c\"]");
  EXPECT_EQ(columns_toml(-swap, {"a", "b", "-c"}), "[\"-b\", \"a\", \"c\"]");
  EXPECT_FALSE(
      columns_toml(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()).toRotationMatrix(), {"a", "b", "c"}));
}

}  // namespace
}  // namespace imuscope::check
