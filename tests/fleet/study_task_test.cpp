/// A task whatever becomes of its program: done once, tried again, given up, told.

#include "fleet/study_task.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <thread>

#include "fleet/attempts.h"
#include "fleet/campaign.h"
#include "made_campaign.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using fleet::AttemptEnd;
using fleet::TaskState;
using testing::HasSubstr;

class StudyTask : public testing::Test {
 protected:
  StudyTask() : plan_(*fleet::plan_campaign(make_fleet(folder_, 1, 1), kMadeProgram)) {}

  /// A program that does this in the place of `imuscope process`.
  std::filesystem::path program(const std::string& script) {
    const auto file = folder_ / "program.sh";
    write_file(file, "#!/bin/sh\necho called >>" + (folder_ / "calls").string() + "\n" + script + "\n");
    EXPECT_EQ(::chmod(file.c_str(), 0755), 0);
    return file;
  }
  [[nodiscard]] int calls() const {
    std::error_code error;
    const auto size = std::filesystem::file_size(folder_ / "calls", error);
    return error ? 0 : static_cast<int>(size / sizeof("called"));
  }
  Result<fleet::TaskOutcome> attempt(const std::string& script, const std::string& version = kMadeProgram) {
    return fleet::do_study(task(), version, program(script), stop_);
  }
  fleet::StudyTask& task() { return plan_.studies.front(); }
  std::vector<fleet::Attempt> attempts() { return fleet::Attempts::open(task().out)->of(task().key); }
  [[nodiscard]] bool scratch_is_empty() { return std::filesystem::is_empty(task().out / "scratch"); }

  std::filesystem::path folder_ = scratch_folder();
  fleet::Plan plan_;
  std::atomic<bool> stop_{false};
};

TEST_F(StudyTask, ThatIsRefusedIsNotTriedAgain) {
  const auto outcome = attempt("echo 'imuscope: the capture is no capture; give another' >&2; exit 1");
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->state, TaskState::kRefused);
  EXPECT_EQ(outcome->reason, "the capture is no capture; give another");
  const auto again = attempt("exit 0");
  EXPECT_TRUE(again->was_there);
  EXPECT_EQ(again->state, TaskState::kRefused);
  EXPECT_EQ(calls(), 1);
  EXPECT_TRUE(scratch_is_empty());
}

TEST_F(StudyTask, ThatDiesIsTriedAgainAndGivenUpAndForgiven) {
  auto outcome = attempt("kill -9 $$");
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->state, TaskState::kGaveUp);
  EXPECT_THAT(outcome->reason, HasSubstr("tried 3 times: was killed (signal 9)"));
  EXPECT_EQ(calls(), 3);
  ASSERT_EQ(attempts().size(), 3U);
  EXPECT_EQ(attempts().front().end, AttemptEnd::kDied);
  EXPECT_EQ(attempt("kill -9 $$")->state, TaskState::kGaveUp);
  EXPECT_EQ(calls(), 3);
  ASSERT_TRUE(fleet::forget_given_up(task().out, task().key));
  outcome = attempt("echo 'imuscope: no' >&2; exit 1");
  EXPECT_EQ(outcome->state, TaskState::kRefused);
  EXPECT_EQ(attempts().size(), 4U);
}

TEST_F(StudyTask, WhatMayPassIsNoRefusal) {
  for (const char* words :
       {"unexpected failure: std::bad_alloc", "a.csv cannot be written: No space left on device"}) {
    const auto outcome = attempt(std::string("echo 'imuscope: ") + words + "' >&2; exit 1");
    EXPECT_EQ(outcome->state, TaskState::kGaveUp) << words;
    ASSERT_TRUE(fleet::forget_given_up(task().out, task().key));
  }
  EXPECT_EQ(calls(), 6);
}

TEST_F(StudyTask, HasAnEndWhereItHangsAndWhereItEatsMemory) {
  task().limits = {1, 0.0, 0.3};
  auto outcome = attempt("sleep 30");
  EXPECT_EQ(outcome->state, TaskState::kGaveUp);
  EXPECT_THAT(outcome->reason, HasSubstr("took longer than 0.3 s"));
  ASSERT_TRUE(fleet::forget_given_up(task().out, task().key));
  task().limits = {1, 64.0, 0.0};
  // dd takes a buffer of 1 GB, which it is refused.
  outcome = attempt("dd if=/dev/zero of=/dev/null bs=1000000000 count=1 2>/dev/null || exec kill -9 $$");
  EXPECT_EQ(outcome->state, TaskState::kGaveUp);
}

TEST_F(StudyTask, OfAnotherProgramOrAChangedCaptureIsRefusedWithARow) {
  auto outcome = attempt("exit 0", "another program");
  ASSERT_FALSE(outcome);
  EXPECT_THAT(outcome.error().text(), HasSubstr("imuscope fleet tasks"));
  write_file(task().files.front(), "changed");
  outcome = attempt("exit 0");
  ASSERT_FALSE(outcome);
  EXPECT_EQ(calls(), 0);
  ASSERT_EQ(attempts().size(), 2U);
  EXPECT_FALSE(attempts().front().counts);
  EXPECT_EQ(fleet::study_state(task().out, task().key).state, TaskState::kNotYet);
}

TEST_F(StudyTask, ThatIsStoppedIsOpenAndLeavesNothing) {
  stop_ = true;
  const auto outcome = attempt("sleep 30");
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->state, TaskState::kInterrupted);
  EXPECT_EQ(attempts().front().end, AttemptEnd::kInterrupted);
  EXPECT_TRUE(scratch_is_empty());
}

TEST_F(StudyTask, FindsThatAnEarlierAttemptDiedWithoutAWord) {
  const auto all = fleet::Attempts::open(task().out);
  auto lost = *all->begin(task().key, "study", kMadeProgram);
  EXPECT_FALSE(std::filesystem::exists(task().out / "scratch" / lost.scratch)) << "told before it is made";
  EXPECT_NE(all->begin(task().key, "study", kMadeProgram)->scratch, lost.scratch);
  write_file(task().out / "scratch" / lost.scratch / "file", "half");
  // As if by a process that is no more.
  lost.process_start += 1;
  ASSERT_TRUE(all->end(lost, AttemptEnd::kRunning, "", {}));
  EXPECT_EQ(attempt("echo 'imuscope: no' >&2; exit 1")->state, TaskState::kRefused);
  ASSERT_EQ(attempts().size(), 3U);
  EXPECT_EQ(attempts().front().end, AttemptEnd::kLost);
  EXPECT_TRUE(scratch_is_empty());
}

TEST_F(StudyTask, ReplacesAResultWhoseEndTheDiskLost) {
  write_file(task().out / "studies" / task().key / "result.json", "{\"schema\": \"imus");
  EXPECT_EQ(attempt("echo 'imuscope: no' >&2; exit 1")->state, TaskState::kRefused);
  EXPECT_EQ(fleet::study_state(task().out, task().key).state, TaskState::kRefused);
}

TEST_F(StudyTask, OfACampaignThatWorksElsewhereIsNotBegun) {
  fleet::RunOptions options;
  options.program_file = program("sleep 1; echo 'imuscope: no' >&2; exit 1");
  std::thread other([&] { EXPECT_TRUE(fleet::run_campaign(plan_, options, stop_)); });
  while (calls() == 0) std::this_thread::yield();
  const auto second = fleet::run_campaign(plan_, options, stop_);
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().text(), HasSubstr("another `imuscope fleet run`"));
  other.join();
  EXPECT_EQ(calls(), 1);
}

}  // namespace
}  // namespace imuscope::test
