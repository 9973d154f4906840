#!/bin/sh
# Slurm: an array of @SHARDS@ shards, each on @THREADS@ cores. Submit it with: sbatch @FILE@
# Add what your site asks for, such as a partition, an account or a time. A job that is requeued goes on where it was.
#SBATCH --job-name=surgescope
#SBATCH --array=1-@SHARDS@
#SBATCH --cpus-per-task=@THREADS@
#SBATCH --requeue
#SBATCH --output=/dev/null
set -eu
dir=@DIR@
exec >>"$dir/jobs/log/shard-$SLURM_ARRAY_TASK_ID.txt" 2>&1
exec @PROGRAM@ campaign run "$dir" --shard "$SLURM_ARRAY_TASK_ID/@SHARDS@" --threads @THREADS@@LIMIT@
