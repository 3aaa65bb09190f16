// The data that request handlers share: references to the parts of the service, which Service owns.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <set>
#include <string>

#include "server/api/access/concurrency_limiter.h"
#include "server/api/context/metrics.h"
#include "server/config/config.h"
#include "server/disk/disk_space.h"
#include "server/jobs/dispatcher.h"
#include "server/jobs/task_resolver.h"
#include "server/queue/job_queue.h"
#include "server/scenes/scene_store.h"
#include "server/tiles/open_tile_sources.h"
#include "server/tiles/partial/partial_views.h"
#include "server/webhooks/webhooks.h"
#include "voxdag/cancel_token.h"

namespace voxdag::server {

struct Context {
  const ServerConfig& config;
  FileSystem& files;
  JobQueue& queue;
  SceneStore& scenes;
  TaskResolver& tasks;
  DiskSpace& disk;
  Dispatcher& dispatcher;
  Webhooks& webhooks;
  Metrics& metrics;
  const std::atomic<bool>& draining;  // true once the service has begun to stop

  ConcurrencyLimiter event_streams{config.transfers.max_event_streams,
                                   config.transfers.max_event_streams_per_client};
  ConcurrencyLimiter uploads{config.transfers.max_concurrent, config.transfers.max_per_client};
  ConcurrencyLimiter downloads{config.transfers.max_concurrent, config.transfers.max_per_client};
  ConcurrencyLimiter tiles{config.transfers.max_concurrent, config.transfers.max_per_client};
  // Limits the number of answers that are built in memory at the same time. This bounds the memory
  // of answers whose size is not yet known. Once the size of an answer is known, ConnectionTable
  // limits its memory.
  ConcurrencyLimiter answers{4, 4};
  ConcurrencyLimiter plans{config.jobs.max_concurrent_plans, config.jobs.max_concurrent_plans};
  OpenTileSources open_sources{files, 16};
  PartialViews partial{files, 16};
  // Canceled when the service stops.
  CancelToken stopping = {};
  // Protects the scenes of jobs. A request that adds or retries a job holds this mutex while it
  // checks that the job's scenes exist and changes the queue. A request that replaces or removes a
  // scene holds the mutex while it checks that no job uses the scene and changes the store. So no
  // scene disappears between the check and the change of the queue.
  std::mutex scene_mutex = {};
  // Scenes that dry runs are reading, guarded by scene_mutex. A client must not remove these
  // scenes. A client may replace them, because a reader keeps the old file open.
  std::multiset<std::string> planned_scenes = {};
};

// Returns the job with this id. Throws Problem (404) for an unknown job.
Job find_job(JobQueue& queue, const std::string& id);

}  // namespace voxdag::server
