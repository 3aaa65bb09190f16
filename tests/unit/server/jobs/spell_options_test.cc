#include "server/jobs/protocol/spell_options.h"

#include <gtest/gtest.h>

#include "core/base/options/option_text.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag::server {
namespace {

TEST(SpellOptionsTest, OptionsOfJobsAreMembers) {
  EXPECT_EQ(spell_job_option("allow_empty", ""), "'allow_empty'");
  EXPECT_EQ(spell_job_option("resolution", ""), "'resolution'");
  EXPECT_EQ(spell_job_option("solid", "parity"), "\"solid\": \"parity\"");
  EXPECT_EQ(spell_job_option("memory", ""), "'memory'");
}

TEST(SpellOptionsTest, TheServiceReplacesOtherOptions) {
  EXPECT_EQ(spell_job_option("restart", ""), "a new job of the scene");
  EXPECT_EQ(spell_job_option("work", ""), "");
  EXPECT_EQ(spell_job_option("force", ""), "");
  EXPECT_EQ(spell_job_option("cache", ""), "jobs.cache of the service");
  EXPECT_EQ(spell_job_option("cluster", "slurm"), "cluster.engine of the service");
  EXPECT_EQ(spell_job_option("cluster_options", ""), "cluster.options of the service");
}

TEST(SpellOptionsTest, CommandsAreRequests) {
  EXPECT_EQ(spell_request("build", "color", ""), "a job with 'color'");
  EXPECT_EQ(spell_request("build", "solid", "winding"), "a job with \"solid\": \"winding\"");
  EXPECT_EQ(spell_request("plan", "", ""), "a request with dry_run=true");
  for (const char* command : {"stop-tasks", "verify", "reorder", "import", "info"})
    EXPECT_EQ(spell_request(command, "", ""), "") << command;
}

// No message names an option of `voxdag build` that requests cannot have.
struct ExpectMembersOfJobs {
  template <class T>
  void operator()(const Field& field, T&) {
    EXPECT_EQ(spell_job_option(field.name, "") == spell_as_member(field.name, ""),
              field.scope == Scope::kSubmit)
        << field.name;
  }
};

TEST(SpellOptionsTest, NoOtherOptionIsSpelledAsAMember) {
  ExpectMembersOfJobs visit;
  BuildSpec spec;
  fields(visit, spec);
  ClusterOptions cluster;
  fields(visit, cluster);
}

// Clients cannot run a command again.
TEST(SpellOptionsTest, ClientsRepeatRequests) {
  EXPECT_STREQ(kJobUsers.repeat, "retry the job");
  EXPECT_STREQ(kExportUsers.repeat, "request the export again");
}

TEST(SpellOptionsTest, ExportsHaveTheirOwnMemory) {
  EXPECT_EQ(spell_export_option("memory", ""), "exports.memory of the service");
  EXPECT_EQ(spell_export_option("level", "11"), "\"level\": 11");
}

}  // namespace
}  // namespace voxdag::server
