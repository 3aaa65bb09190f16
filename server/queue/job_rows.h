// The queue's tables, and jobs as their rows.
#pragma once

#include <optional>
#include <string>

#include "core/db/sqlite.h"
#include "server/queue/job.h"

namespace voxdag::server {

// Makes the tables of a new database, or checks that an old one is ours.
void prepare_schema(SqlDatabase& database, const std::string& path);

// In the order that job_of_row() reads them.
extern const char* const kJobColumns;
Job job_of_row(const SqlStatement& row);

std::optional<Job> read_job(SqlDatabase& database, const std::string& id);
void write_job(SqlDatabase& database, const Job& job);
// Records the state that the job is in as its newest.
void write_event(SqlDatabase& database, const Job& job);

}  // namespace voxdag::server
