#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "core/base/clock.h"
#include "server/queue/job_queue.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::server {
namespace {

class Queue : public testing::Test {
 protected:
  static double pause_(unsigned attempt) { return 100.0 * attempt; }
  Job post(int priority = 0, const IdempotencyKey& key = {}) {
    Job job;
    job.request = R"({"scene":["a.glb"],"resolution":64,"options":{}})";
    job.scenes = {"a.glb"};
    job.priority = priority;
    return queue_->add(job, key, 100).job;
  }
  Job set_state(const std::string& id, JobState state) {
    return queue_->change(id, [&](Job& j) {
      j.state = state;
      if (has_ended(state)) j.finished_s = unix_seconds();
    });
  }
  void reopen() {
    queue_.reset();
    queue_ = std::make_unique<JobQueue>(folder_.file("queue.db"));
  }
  std::optional<RequestError::Kind> refusal(const std::function<void()>& act) {
    try {
      act();
      return {};
    } catch (const RequestError& error) {
      return error.kind();
    }
  }

  TemporaryFolder folder_;
  std::unique_ptr<JobQueue> queue_ = std::make_unique<JobQueue>(folder_.file("queue.db"));
};

// When the queue is opened again, every member of a job is unchanged.
TEST_F(Queue, StoresEveryMemberOfAJob) {
  const std::string id = post(7).id;
  queue_->change(id, [](Job& j) {
    j.name = "a \"name\"\xff";
    j.state = JobState::kQueued;
    j.attempts = 3;
    j.error = JobError{"no_space", "full", 12.5, true};
    j.warnings = {{"ignored-extension", "a.glb", "one", 3}, {"build", "", "two"}};
    j.progress = "{\"stage\":\"build\"}";
    j.not_before_s = 99;
    j.preview = Preview::kReady;
  });
  reopen();
  const auto job = queue_->find(id);
  ASSERT_TRUE(job);
  EXPECT_EQ(job->name, "a \"name\"\xff");
  EXPECT_EQ(job->priority, 7);
  EXPECT_EQ(job->attempts, 3u);
  ASSERT_TRUE(job->error);
  EXPECT_EQ(job->error->code, "no_space");
  EXPECT_EQ(job->error->at_s, 12.5);
  EXPECT_TRUE(job->error->transient);
  EXPECT_EQ(job->warnings,
            (std::vector<Warning>{{"ignored-extension", "a.glb", "one", 3}, {"build", "", "two"}}));
  EXPECT_EQ(job->progress, "{\"stage\":\"build\"}");
  EXPECT_EQ(job->not_before_s, 99);
  EXPECT_EQ(job->preview, Preview::kReady);
  EXPECT_EQ(job->scenes, (std::vector<std::string>{"a.glb"}));
}

TEST_F(Queue, ServesByPriorityThenFrontThenOrder) {
  const std::string first = post().id, second = post().id, urgent = post(5).id;
  queue_->change(second, [](Job& j) { j.front = true; });
  EXPECT_EQ(queue_->next(1e12, 900, {})->id, urgent);
  EXPECT_EQ(queue_->next(1e12, 900, {urgent})->id, second);
  EXPECT_EQ(queue_->next(1e12, 900, {urgent, second})->id, first);
  EXPECT_FALSE(queue_->next(1e12, 900, {urgent, second, first}));
  const auto places = queue_->places();
  EXPECT_EQ(places->at(queue_->find(urgent)->number), 1u);
  EXPECT_EQ(places->at(queue_->find(first)->number), 3u);
}

TEST_F(Queue, WaitsUntilAJobMayBeRetried) {
  const std::string id = post().id;
  queue_->change(id, [](Job& j) { j.not_before_s = 1000; });
  EXPECT_FALSE(queue_->next(999, 900, {}));
  EXPECT_TRUE(queue_->next(1000, 900, {}));
}

// When the queue recovers after a crash of the service, jobs that were running go to its front, and
// jobs that were being canceled become canceled.
TEST_F(Queue, RecoversWhatWasRunning) {
  const std::string waiting = post().id, running = post().id, stopping = post().id;
  set_state(running, JobState::kRunning);
  set_state(stopping, JobState::kCanceling);
  reopen();
  const auto canceled = queue_->recover({}, pause_);
  ASSERT_EQ(canceled.size(), 1u);
  EXPECT_EQ(canceled[0].id, stopping);
  EXPECT_EQ(queue_->find(stopping)->state, JobState::kCanceled);
  EXPECT_EQ(queue_->next(1e12, 900, {})->id, running);
  EXPECT_EQ(queue_->find(waiting)->state, JobState::kQueued);
}

TEST_F(Queue, AnswersARepetitionWithTheSameJob) {
  const IdempotencyKey key{"key", "digest"};
  const std::string id = post(0, key).id;
  reopen();
  EXPECT_EQ(post(0, key).id, id);
  EXPECT_EQ(queue_->find_by_key(key)->id, id);
  EXPECT_EQ(refusal([&] { post(0, {"key", "other"}); }), RequestError::Kind::kKeyReused);
  set_state(id, JobState::kCanceled);
  queue_->remove(id);
  EXPECT_NE(post(0, key).id, id) << "the key lives as long as its job";
}

TEST_F(Queue, RefusesJobsOverItsLimit) {
  Job job;
  job.request = "{}";
  queue_->add(job, {}, 1);
  EXPECT_EQ(refusal([&] { queue_->add(job, {}, 1); }), RequestError::Kind::kBusy);
}

TEST_F(Queue, RemovesOnlyWhatHasEnded) {
  const std::string id = post().id;
  EXPECT_EQ(refusal([&] { queue_->remove(id); }), RequestError::Kind::kConflict);
  set_state(id, JobState::kFailed);
  queue_->remove(id);
  EXPECT_FALSE(queue_->find(id));
  EXPECT_EQ(refusal([&] { queue_->remove(id); }), RequestError::Kind::kNotFound);
  EXPECT_TRUE(queue_->events_after(id, 0).empty()) << "its events go with it";
}

TEST_F(Queue, RecordsEveryChangeOfState) {
  const std::string id = post().id, other = post().id;
  set_state(id, JobState::kRunning);
  queue_->change(id, [](Job& j) { j.priority = 3; });
  set_state(id, JobState::kSucceeded);
  const auto events = queue_->events_after(id, 0);
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0].state, JobState::kQueued);
  EXPECT_EQ(events[1].state, JobState::kRunning);
  EXPECT_EQ(events[2].state, JobState::kSucceeded);
  EXPECT_EQ(queue_->events_after(id, events[1].number).size(), 1u);
  EXPECT_EQ(queue_->events_after(other, 0).size(), 1u);
}

// The queue keeps only the last events of a job, because a client can suspend and resume a job any
// number of times.
TEST_F(Queue, KeepsTheLastEvents) {
  const std::string id = post().id, other = post().id;
  for (int i = 0; i < 400; ++i)
    set_state(id, i % 2 == 0 ? JobState::kSuspended : JobState::kQueued);
  const auto events = queue_->events_after(id, 0);
  ASSERT_EQ(events.size(), 256u);
  EXPECT_EQ(events.back().state, JobState::kQueued);
  EXPECT_LT(events.front().number, events.back().number);
  EXPECT_EQ(queue_->events_after(id, events[250].number).size(), 5u);
  EXPECT_EQ(queue_->events_after(other, 0).size(), 1u);
}

// If the function that edits a job throws, the stored job is unchanged.
TEST_F(Queue, RollsBackAChangeThatFails) {
  const std::string id = post().id;
  EXPECT_EQ(refusal([&] {
              queue_->change(id, [](Job& j) {
                j.priority = 50;
                throw RequestError(RequestError::Kind::kConflict, "no");
              });
            }),
            RequestError::Kind::kConflict);
  EXPECT_EQ(queue_->find(id)->priority, 0);
}

TEST_F(Queue, ListsPageByPage) {
  std::vector<std::string> ids;
  for (int i = 0; i < 5; ++i) ids.insert(ids.begin(), post().id);
  set_state(ids[0], JobState::kSucceeded);
  JobFilter filter;
  filter.limit = 3;
  auto page = queue_->list(filter);
  ASSERT_EQ(page.size(), 3u);
  EXPECT_EQ(page[0].id, ids[0]);
  filter.before = page.back().number;
  page = queue_->list(filter);
  ASSERT_EQ(page.size(), 2u);
  EXPECT_EQ(page[1].id, ids[4]);
  filter = {};
  filter.states = {JobState::kSucceeded, JobState::kFailed};
  EXPECT_EQ(queue_->list(filter).size(), 1u);
  EXPECT_EQ(queue_->counts().at(JobState::kQueued), 4u);
}

// A job with a damaged request matches no words and no label, and the search does not fail.
TEST_F(Queue, SearchesWordsAndLabels) {
  const std::string id = post().id, damaged = post().id;
  queue_->change(id, [](Job& j) {
    j.name = "Bridge";
    j.request = R"({"scene":["Arch.glb"],"resolution":64,"options":{},"labels":["x y"]})";
  });
  queue_->change(damaged, [](Job& j) { j.request = "{"; });
  const auto count = [&](const std::string& words, const std::string& label) {
    JobFilter filter;
    filter.words = words;
    filter.label = label;
    return queue_->list(filter).size();
  };
  EXPECT_EQ(count("", ""), 2u);
  for (const std::string& words :
       {std::string("bridge"), std::string("arch"), std::string("X Y"), id})
    EXPECT_EQ(count(words, ""), 1u) << words;
  EXPECT_EQ(count("options", ""), 0u);
  EXPECT_EQ(count("", "x y"), 1u);
  EXPECT_EQ(count("", "x"), 0u);
}

TEST_F(Queue, KnowsWhichScenesAreNeeded) {
  const std::string id = post().id;
  EXPECT_TRUE(queue_->uses_scene("a.glb"));
  EXPECT_FALSE(queue_->uses_scene("b.glb"));
  set_state(id, JobState::kCanceled);
  EXPECT_FALSE(queue_->uses_scene("a.glb"));
}

TEST_F(Queue, LetsEndedJobsExpire) {
  const std::string old = post().id, newer = post().id, open = post().id;
  queue_->change(old, [](Job& j) {
    j.state = JobState::kFailed;
    j.finished_s = 100;
  });
  queue_->change(newer, [](Job& j) {
    j.state = JobState::kSucceeded;
    j.finished_s = 200;
  });
  EXPECT_EQ(queue_->expired(150, 100), (std::vector<std::string>{old}));
  EXPECT_EQ(queue_->expired(0, 1), (std::vector<std::string>{old}));
  EXPECT_TRUE(queue_->expired(0, 2).empty());
  EXPECT_EQ(queue_->expired(1e12, 100).size(), 2u);
}

// The limit of finished jobs applies to each client, so a client that submits many jobs cannot make
// the results of others expire.
TEST_F(Queue, JobsExpireForThoseOfTheSamePosterOnly) {
  const auto end = [&](const std::string& poster, JobState state, double finished_s) {
    const std::string id = post().id;
    queue_->change(id, [&](Job& j) {
      j.posted_by = poster;
      j.state = state;
      j.finished_s = finished_s;
    });
    return id;
  };
  const std::string result = end("anna", JobState::kSucceeded, 100);
  for (int i = 0; i < 5; ++i) end("bob", JobState::kCanceled, 200 + i);
  const auto expired = queue_->expired(0, 2);
  EXPECT_EQ(expired.size(), 3u);
  EXPECT_EQ(std::count(expired.begin(), expired.end(), result), 0);
}

// Jobs expire in the order in which they ended. Here, the job that was submitted first ended last,
// so it is kept.
TEST_F(Queue, TheJobThatEndedLastStays) {
  const std::string lengthy = post().id, quick = post().id;
  const auto succeed = [&](const std::string& id, double finished_s) {
    queue_->change(id, [&](Job& j) {
      j.state = JobState::kSucceeded;
      j.finished_s = finished_s;
    });
  };
  succeed(quick, 100);
  succeed(lengthy, 200);
  EXPECT_EQ(queue_->expired(0, 1), (std::vector<std::string>{quick}));
}

// not_before_s of a waiting job is ignored if it is further ahead than the longest possible wait:
// the clock was then set back.
TEST_F(Queue, DoesNotWaitForAClockThatWasSetBack) {
  const std::string id = post().id;
  queue_->change(id, [](Job& j) { j.not_before_s = 1e6 + 900; });
  EXPECT_FALSE(queue_->next(1e6, 900, {}));
  EXPECT_TRUE(queue_->next(1e6 - 1, 900, {}));
}

// The service ends during every run of a job. Up to five times, the job is queued at the front.
// After that it waits longer after each run, and finally fails.
TEST_F(Queue, InterruptedRunsCountInTheEnd) {
  const std::string id = post().id, other = post().id;
  int runs = 0;
  for (; queue_->find(id)->state != JobState::kFailed && runs < 100; ++runs) {
    queue_->change(id, [](Job& j) {
      if (!j.front) ++j.attempts;
      j.front = false;
      j.state = JobState::kRunning;
    });
    reopen();
    queue_->recover({}, pause_);
    const Job job = *queue_->find(id);
    EXPECT_EQ(job.front, runs < 5) << runs;
    const bool waits = runs >= 5 && job.state == JobState::kQueued;
    EXPECT_EQ(job.not_before_s > unix_seconds() + 100 * (runs - 4) - 10, waits) << runs;
  }
  EXPECT_EQ(runs, 16);
  EXPECT_EQ(queue_->find(id)->error->code, "internal");
  EXPECT_FALSE(queue_->find(id)->error->transient);
  EXPECT_EQ(queue_->next(1e12, 900, {})->id, other);
}

// A suspended job remains suspended, however often the service ends, and can then be resumed.
TEST_F(Queue, ASuspendedJobSurvivesInterruptions) {
  const std::string id = post().id;
  for (int i = 0; i < 7; ++i) {
    set_state(id, JobState::kRunning);
    queue_->recover({}, pause_);
  }
  set_state(id, JobState::kSuspended);
  for (int i = 0; i < 20; ++i) {
    reopen();
    EXPECT_TRUE(queue_->recover({}, pause_).empty());
    EXPECT_EQ(queue_->find(id)->state, JobState::kSuspended);
    EXPECT_EQ(queue_->find(id)->interruptions, 7u);
  }
}

TEST_F(Queue, RecoversNothingThatRuns) {
  const std::string id = post().id;
  set_state(id, JobState::kRunning);
  EXPECT_TRUE(queue_->recover({id}, pause_).empty());
  EXPECT_EQ(queue_->find(id)->state, JobState::kRunning);
}

// A damaged row can be read, listed and deleted, and other rows are not affected.
TEST_F(Queue, ReadsADamagedRow) {
  const std::string id = post().id, other = post().id;
  const auto damage = [&](const std::string& set) {
    SqlDatabase(folder_.file("queue.db"), SqlDatabase::Mode::kReadWrite)
        .execute("PRAGMA ignore_check_constraints = 1; UPDATE job SET " + set + " WHERE id = '" +
                 id + "'");
  };
  for (const char* column : {"scenes", "request", "error", "warnings", "result", "progress"}) {
    SCOPED_TRACE(column);
    damage(std::string(column) + " = '{\"broken'");
    EXPECT_EQ(queue_->list({}).size(), 2u);
    const auto job = queue_->find(id);
    ASSERT_TRUE(job);
    EXPECT_FALSE(job->warnings.empty());
    EXPECT_TRUE(job->request.starts_with('{') && job->request.ends_with('}')) << job->request;
    EXPECT_EQ(job->result + job->progress, "");
    EXPECT_TRUE(queue_->find(other));
  }
  damage("state = 77");
  EXPECT_EQ(queue_->find(id)->state, JobState::kFailed);
  queue_->remove(id);
  EXPECT_FALSE(queue_->find(id));
}

// If the queue's file is removed or replaced while the service runs, the queue refuses the next
// job.
TEST_F(Queue, NoticesThatItsFileIsGone) {
  post();
  queue_->check_file();
  std::filesystem::rename(folder_.file("queue.db"), folder_.file("away.db"));
  EXPECT_THROW(queue_->check_file(), Error);
  EXPECT_THROW(post(), Error);
  std::filesystem::copy_file(folder_.file("away.db"), folder_.file("queue.db"));
  EXPECT_THROW(queue_->check_file(), Error) << "another file";
}

// A queue of version 3, in which warnings are texts, is upgraded.
TEST_F(Queue, ReadsThePreviousVersion) {
  const std::string id = post().id;
  queue_.reset();
  SqlDatabase(folder_.file("queue.db"), SqlDatabase::Mode::kReadWrite)
      .execute(R"(UPDATE job SET warnings = '["the disk is slow"]'; PRAGMA user_version = 3)");
  reopen();
  const std::vector<Warning> expected{{"build", "", "the disk is slow"}};
  EXPECT_EQ(queue_->find(id)->warnings, expected);
}

TEST_F(Queue, MakesNoNewQueueWhereThereWasOne) {
  EXPECT_THROW(JobQueue(folder_.file("new.db"), false), Error);
  EXPECT_THROW(JobQueue(folder_.file("new.db"), false), Error) << "the first try left none";
  JobQueue(folder_.file("new.db"), true);
  JobQueue(folder_.file("new.db"), false);
}

TEST_F(Queue, RefusesADatabaseOfAnotherProgram) {
  SqlDatabase(folder_.file("other.db"), SqlDatabase::Mode::kReadWrite)
      .execute("CREATE TABLE t (a)");
  EXPECT_THROW(JobQueue(folder_.file("other.db")), Error);
}

}  // namespace
}  // namespace voxdag::server
