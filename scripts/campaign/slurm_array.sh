#!/usr/bin/env bash
# Shards of a campaign as a Slurm job array: task I of N runs shard I/N on all cores of its allocation.
#
#     sbatch --array=1-16 --cpus-per-task=8 scripts/campaign/slurm_array.sh SCENE.toml PLAN.toml FILE.h5
#     sbatch --dependency=afterany:JOB --wrap "pliant merge FILE.*-of-16.state.jsonl --out FILE.h5"
#
# The folder of FILE.h5 must be one that all nodes share. A task that was ended (time limit, node failure, preemption) goes on where it
# was when it is run again: --requeue does that by itself, `sbatch --array=3,7 ... ` with PLIANT_SHARDS=16 by hand. pliant is taken from
# PATH, or from the variable PLIANT.
#SBATCH --job-name=pliant
#SBATCH --array=1-16
#SBATCH --cpus-per-task=4
#SBATCH --requeue
#SBATCH --open-mode=append
set -euo pipefail

if [ $# -lt 3 ]; then
    echo "usage: sbatch --array=1-N $0 SCENE.toml PLAN.toml FILE.h5 [options of pliant sweep]" >&2
    exit 2
fi
scene=$1 plan=$2 out=$3
shift 3
# the number of shards must not change when only some of them are run again
shards=${PLIANT_SHARDS:-${SLURM_ARRAY_TASK_COUNT:?run this by sbatch --array=1-N}}
exec "${PLIANT:-pliant}" sweep "$scene" "$plan" --out "$out" --shard "${SLURM_ARRAY_TASK_ID:?}/$shards" \
    --threads "${SLURM_CPUS_PER_TASK:-1}" "$@"
