#!/bin/bash
# The table, after all parts; ends with 1 and names the cells if some are missing: ./submit.sh again runs those.
#SBATCH --job-name=coilwright-table
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --output=logs/table.log
set -u
. ./campaign.conf
"$program" campaign "$campaign" -o results --merge >/dev/null
