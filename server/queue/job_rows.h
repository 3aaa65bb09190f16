// The queue's tables, and jobs as their rows. Used by JobQueue alone, under its locks.
#pragma once

#include <optional>
#include <string>

#include "core/db/sqlite.h"
#include "server/queue/job.h"

namespace voxdag::server {

// Makes the tables of a new database, or checks that an existing one is a queue of this version.
void prepare_schema(SqlDatabase& database, const std::string& path);

// The columns of the table `job`, in the order in which job_of_row() reads them.
const std::string& job_columns();
// Throws Error{kCorrupt} for a row that is damaged.
Job job_of_row(const SqlStatement& row);

std::optional<Job> read_job(SqlDatabase& database, const std::string& id);
void write_job(SqlDatabase& database, const Job& job);
// Records the present state of the job as its newest event.
void write_event(SqlDatabase& database, const Job& job);

}  // namespace voxdag::server
