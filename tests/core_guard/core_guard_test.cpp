/// The guard that proves the core's rules must be able to find them broken.

#include <gtest/gtest.h>
#include <cstdlib>

#include "guard_report.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

GuardReport report_of(const std::string& offence) {
  const auto folder = scratch_folder();
  const ScopedGuard guard(folder / "guard.txt");
  EXPECT_EQ(run_program("core_guard_offender", {offence}, folder / "log.txt"), 0)
      << read_text(folder / "log.txt");
  return read_guard_report(folder / "guard.txt");
}

TEST(CoreGuard, FindsNothingWhereNothingIsWrong) {
  const auto thread = report_of("nothing").at("imuscope-est");
  EXPECT_GT(thread.at("waits"), 90);
  for (const auto& [what, count] : offences_of(thread)) EXPECT_EQ(count, 0) << what;
}

TEST(CoreGuard, SeesOneAllocationAndItsRelease) {
  const auto thread = report_of("allocate").at("imuscope-est");
  EXPECT_EQ(thread.at("allocations"), 1);
  EXPECT_EQ(thread.at("frees"), 1);
}

TEST(CoreGuard, SeesALockThatNobodyContends) {
  EXPECT_EQ(report_of("lock").at("imuscope-est").at("locks"), 1);
}

TEST(CoreGuard, SeesASystemCallThatIsNotOnTheList) {
  const auto thread = report_of("call").at("imuscope-est");
  EXPECT_EQ(thread.at("forbidden_calls"), 1);
  EXPECT_EQ(thread.at("last_forbidden"), 257) << "openat";
}

TEST(CoreGuard, SeesAReadOnADescriptorThatCouldBlock) {
  EXPECT_EQ(report_of("block").at("imuscope-io").at("blocking_io"), 1);
}

}  // namespace
}  // namespace imuscope::test
