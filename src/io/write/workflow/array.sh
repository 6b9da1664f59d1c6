#!/bin/bash
# One task a part of the campaign. A task whose node is lost is queued again; whatever fails is tried again from what is done.
#SBATCH --job-name=coilwright
#SBATCH --ntasks=1
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=logs/part-%a.log
set -u
. ./campaign.conf
for attempt in 1 2 3; do
  "$program" campaign "$campaign" -o results --shard "$SLURM_ARRAY_TASK_ID/$parts" --threads "$threads" --quiet >/dev/null
  code=$?
  # 130: Slurm ends the task (time, preemption); the checkpoint is written.
  case $code in 0 | 130) exit $code ;; esac
  echo "attempt $attempt ended with $code" >&2
done
exit $code
