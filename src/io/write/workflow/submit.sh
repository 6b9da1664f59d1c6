#!/bin/bash
# Queues all parts and, behind them, the table. Run it here, in the folder where it stands; options go to both (--partition=…).
set -eu
cd "$(dirname "$0")"
. ./campaign.conf
mkdir -p logs
job=$(sbatch --parsable "$@" --array="1-$parts" --cpus-per-task="$threads" --mem="${memory_mb}M" --time="$limit_min" array.sh)
table=$(sbatch --parsable "$@" --dependency="afterany:${job%%;*}" merge.sh)
echo "parts: job ${job%%;*}, table: job ${table%%;*}"
