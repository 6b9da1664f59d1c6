#!/usr/bin/env bash
# Kills a search with SIGKILL at twenty random moments, resumes it each time, and compares what it leaves with an unbroken run.
# Usage: benches/kill_resume.sh COILWRIGHT MODEL; up to 16 equal layers the search ends early, because its best is proved.
set -euo pipefail
program=$1 model=$2
folder=$(mktemp -d)
request=(optimise "$model" --windability any --seed 5 --rounds 40 --patience 40 --checkpoint-every 50ms --quiet)
"$program" "${request[@]}" -o "$folder/unbroken" > /dev/null
RANDOM=1
kills=0 finished=0
for _ in $(seq 20); do
    "$program" "${request[@]}" -o "$folder/broken" --resume > /dev/null 2>&1 &
    process=$!
    sleep "0.$(printf %03d $((RANDOM % 1000)))"
    if kill -9 "$process" 2> /dev/null; then kills=$((kills + 1)); else finished=$((finished + 1)); fi
    wait "$process" 2> /dev/null || true
done
"$program" "${request[@]}" -o "$folder/broken" --resume > /dev/null
rm -f "$folder"/broken/.coilwright-*
diff -r "$folder/unbroken" "$folder/broken" && echo "$kills kills, $finished ended before the kill: same bytes in $(ls "$folder/broken" | wc -l) files"
rm -r "$folder"
