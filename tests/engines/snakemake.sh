#!/usr/bin/env bash
# A campaign under Snakemake on this machine: the same bytes as one process, also after a worker was killed, after a task found the
# disk full, and with a part that is run from elsewhere at the same time.
#
#   tests/engines/snakemake.sh            with Snakemake of SNAKEMAKE, of the path, or in a virtual environment made for it
#
# Ends with 77 where Snakemake cannot be had. COILWRIGHT_PROGRAM, CELLS and MOVES change what is run.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

snakemake=${SNAKEMAKE:-$(command -v snakemake || true)}
if [ -z "$snakemake" ]; then
  venv=target/snakemake
  if [ ! -x "$venv/bin/snakemake" ]; then
    python3 -m venv "$venv" && timeout 300 "$venv/bin/python" -m pip install --quiet --disable-pip-version-check snakemake \
      || { echo "skipped: Snakemake cannot be had here"; exit 77; }
  fi
  snakemake=$PWD/$venv/bin/snakemake
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. tests/engines/grid.sh
emit() { "$program" campaign "$work/grid.toml" --emit snakemake -o "$work/$1" --job-time "${JOB_TIME:-300ms}" --quiet; }
run() { (cd "$work/$1" && "$snakemake" --profile profiles/laptop --quiet all >"$work/$1.log" 2>&1); }

emit plain
run plain || { tail -30 "$work/plain.log"; fail "the workflow as it is"; }
same "$work/plain/results" "the workflow as it is"

# A changed campaign computes what it must and no more.
sed -i 's/^seeds = \[1,/seeds = [99,1,/' "$work/grid.toml"
before=$(find "$work/plain/results/cells" -name '*.json' -printf '%p %T@\n' | sort)
emit plain
run plain || { tail -30 "$work/plain.log"; fail "a changed campaign"; }
kept=$(find "$work/plain/results/cells" -name '*.json' -printf '%p %T@\n' | sort | comm -12 - <(echo "$before") | wc -l)
[ "$kept" = "$(echo "$before" | wc -l)" ] || fail "cells that had not changed were computed again"
echo "ok: only what had changed was computed ($kept cells kept)"
sed -i 's/^seeds = \[99,1,/seeds = [1,/' "$work/grid.toml"

# The program under another name, which kills itself the first time, and finds the disk full the second.
cat >"$work/faulty" <<SH
#!/bin/bash
if mkdir "$work/first" 2>/dev/null; then
  "$program" "\$@" & sleep 0.3; kill -9 \$!; wait \$!; exit \$?
fi
if mkdir "$work/second" 2>/dev/null; then
  # No file may grow beyond 0 blocks: writing fails as on a full disk.
  trap '' XFSZ; ulimit -f 0; exec "$program" "\$@"
fi
exec "$program" "\$@"
SH
chmod +x "$work/faulty"
emit faults
sed -i "s|\"program\": \".*\"|\"program\": \"$work/faulty\"|" "$work/faults/config.json"
# Meanwhile all cells of it are run a second time from elsewhere.
mkdir -p "$work/faults/results"
"$program" campaign "$work/grid.toml" -o "$work/faults/results" --shard 1/1 --quiet >/dev/null & elsewhere=$!
run faults || { tail -30 "$work/faults.log"; fail "a killed worker, a full disk and a second run"; }
wait $elsewhere || fail "the second run of the same cells"
[ -d "$work/first" ] && [ -d "$work/second" ] || fail "the faults did not happen"
same "$work/faults/results" "a worker killed with -9, a full disk in one task, every cell twice at once"
