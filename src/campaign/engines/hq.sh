#!/bin/sh
# HyperQueue: an array of @SHARDS@ shards, each on @THREADS@ of a worker's cores. Submit it with: hq submit @FILE@
# The shard of a worker that dies goes to another one; what was finished is kept.
#HQ --name surgescope
#HQ --array 1-@SHARDS@
#HQ --cpus @THREADS@
#HQ --stdout none
#HQ --stderr none
set -eu
dir=@DIR@
exec >>"$dir/jobs/log/shard-$HQ_TASK_ID.txt" 2>&1
exec @PROGRAM@ campaign run "$dir" --shard "$HQ_TASK_ID/@SHARDS@" --threads @THREADS@@LIMIT@
