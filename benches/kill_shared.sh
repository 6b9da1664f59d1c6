#!/usr/bin/env bash
# Two runs at once in one folder, of different models, killed with SIGKILL: at a random moment of their whole duration, or before or
# after a rename that is drawn. After each kill every finished file must be of one run only; at the end the folder must hold what an
# unbroken run leaves (a campaign's folder keeps the other one's cells beside its own). Commands that write single files write them
# under the same names: each file must be whole, and an exported compensator's two files of one run.
# Usage: benches/kill_shared.sh COILWRIGHT [KILLS]; needs a C compiler (the rename is caught by a preloaded library). COMMANDS names
# those to be tried.
set -euo pipefail
program=$(realpath "$1") wanted=${2:-200}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cc -shared -fPIC -O1 -Wall -Wextra -o "$work/kill.so" "$here/kill_at_rename.c" -ldl
cd "$work"
# name layers
model() {
  index=$([ "${1:0:1}" = A ] && echo 1.45 || echo 1.46)
  cat > "$1.toml" <<END
name = "coil $1"
[fibre]
refractive_index = $index
thermo_optic_per_k = 1e-5
wavelength_nm = 1550.0
outer_diameter_um = 165.0
[winding]
layers = $2
turns_per_layer = 20
inner_diameter_mm = 60.0
layer_length = "actual"
pattern = "qua"
[thermal]
model = "pack"
conductivity_w_per_m_k = 0.35
volumetric_heat_capacity_j_per_m3_k = 1.7e6
[profiles]
max_rate_c_per_h = 60.0
count = 4
segments = 3
END
}
for name in A B; do
  model $name 12
  # What diagnoses is slower.
  model $name-small 4
  printf 'name = "c"\nmodels = ["%s"]\nseeds = [1, 2, 3]\nrounds = 2\nmoves_per_restart = 300\n' "$work/$name.toml" > $name-grid.toml
  # Built coils of it: thousands of them, so that a block takes a while.
  (cat $name.toml; printf '[tolerance]\nturns_per_layer_sd = 0.1\nsamples = 3000\n') > $name-spread.toml
  printf 'kind = "tolerance"\nname = "c"\nmodels = ["%s"]\ncoils_per_cell = 400\n' "$work/$name-spread.toml" > $name-coils.toml
  for kind in metrics diagnose; do
    { printf 'kind = "%s"\nname = "c"\n' $kind
      [ $kind = metrics ] || printf 'model = "%s"\n' "$work/$name-small.toml"
      printf '[[gyro]]\nname = "%s"\nrecords = ["%s"]\n' 1 "$work/$name.csv" 2 "$work/$name.csv"; } > $name-fleet-$kind.toml
  done
  # The second record is shorter, and there is one more of the first: other files, and more of them.
  rows=$([ $name = A ] && echo 300 || echo 200)
  awk -v rows=$rows -v a=$index 'BEGIN { srand(1); print "time_s,temperature_c,rate_deg_per_h"
    for (i = 0; i < rows; i++) printf "%d,%.3f,%.4f\n", 10 * i, 20 + 0.004 * i, a * sin(i / 20) + 0.05 * rand() }' > $name.csv
  awk -v rows=$rows -v a=$index 'BEGIN { print "time_s,layer_1_c,layer_2_c,layer_3_c,layer_4_c"
    for (i = 0; i < rows; i++) printf "%d,20,%.3f,%.3f,21\n", 10 * i, 20 + 0.01 * i, 20 + a * i / 100 }' > $name-field.csv
done
read -ra commands <<< "${COMMANDS:-schedule optimise pareto compare metrics temperatures diagnose improve campaign coils fleet \
  fleet-diagnosis field exact explore extend compensate export evaluate reproduce}"
# command model; each is run where its folder is to be, so that no path differs
request() {
  local m=$work/$2
  case $1 in
    schedule) echo "schedule $m.toml -o out" ;;
    optimise) echo "optimise $m.toml --rounds 3 --patience 3 --moves-per-restart 300 --checkpoint-every 5ms --fresh -o out" ;;
    pareto) echo "pareto $m.toml --rounds 1 --most-captive 0 -o out" ;;
    compare) if [ "$2" = A ]; then echo "compare $m.toml $work/A.csv $work/B.csv -o out"; else echo "compare $m.toml $m.csv -o out"; fi ;;
    metrics) if [ "$2" = A ]; then echo "metrics $work/A.csv $work/B.csv -o out"; else echo "metrics $m.csv -o out"; fi ;;
    temperatures) echo "temperatures $m.toml --rows 40 -o out" ;;
    diagnose) if [ "$2" = A ]; then echo "diagnose $m-small.toml $work/A.csv $work/B.csv -o out"; else echo "diagnose $m-small.toml $m.csv -o out"; fi ;;
    improve) if [ "$2" = A ]; then echo "improve $m-small.toml $work/A.csv $work/B.csv -o out"; else echo "improve $m-small.toml $m.csv -o out"; fi ;;
    campaign) echo "campaign $m-grid.toml --checkpoint-every 5ms -o out" ;;
    coils) echo "campaign $m-coils.toml -o out" ;;
    fleet) echo "campaign $m-fleet-metrics.toml -o out" ;;
    fleet-diagnosis) echo "campaign $m-fleet-diagnose.toml -o out" ;;
    field) echo "optimise $m-small.toml --field $m-field.csv --rounds 2 --moves-per-restart 300 -o out" ;;
    exact) echo "exact $m-small.toml --budget 60s -o out/best.toml --samples out/samples.csv" ;;
    explore) echo "explore $m.toml -o out/explorer.html" ;;
    extend) echo "extend $m-small.toml --effect spool_mass --fit $m.csv -o out/extended.toml" ;;
    compensate) echo "compensate $m-small.toml $m.csv --fit $m.csv -o out/compensated.csv" ;;
    export) echo "compensate $m-small.toml --fit $m.csv --export out/embedded" ;;
    evaluate) echo "evaluate $m.toml --bang-bang out/listed.toml" ;;
    reproduce) if [ "$2" = A ]; then echo "reproduce yan1998 -o out"; else echo "reproduce thesis2021 -o out"; fi ;;
    *) echo "no such command: $1" >&2; exit 2 ;;
  esac
}
# place command model
run() {
  # shellcheck disable=SC2046
  cd "$1" && exec "$program" $(request "$2" "$3") -q > /dev/null
}
# Files that are of one run; what is on its way, and what tells how far it is, is not.
finished() { (cd "$1" && find . -type f ! -name '.*' ! -name checkpoint.json ! -name steps.json ! -path '*/parts/*' ! -path './unfinished/*' -printf '%P\n'); }
declare -A renames took_ms
for command in "${commands[@]}"; do
  for name in A B; do
    place=whole/$command/$name
    mkdir -p "$place"
    began=$(date +%s%N)
    (RENAMES=$work/counted LD_PRELOAD="$work/kill.so" run "$place" "$command" $name)
    took_ms[$command]=$((($(date +%s%N) - began) / 1000000 + 1))
    counted=$(stat -c %s counted)
    rm counted
    [ "$counted" -lt "${renames[$command]:-1}" ] || renames[$command]=$counted
  done
done
RANDOM=7
kills=0 refused=0 trials=0
declare -A of_command
while [ $kills -lt "$wanted" ]; do
  command=${commands[$((trials % ${#commands[@]}))]}
  trials=$((trials + 1))
  place=shared/$command
  folder=$place/out
  mkdir -p "$place"
  processes=()
  for name in $([ $((RANDOM % 2)) = 0 ] && echo A B || echo B A); do
    case $((RANDOM % 3)) in
      0) (run "$place" "$command" $name) 2> "said-$name" & ;;
      *) (KILL_AT=$((RANDOM % renames[$command] + 1)) KILL_WHEN=$([ $((RANDOM % 2)) = 0 ] && echo before || echo after) \
           LD_PRELOAD="$work/kill.so" run "$place" "$command" $name) 2> "said-$name" & ;;
    esac
    processes+=($!)
  done
  if [ $((RANDOM % 3)) = 0 ]; then
    # Two at once take longer than one.
    after_ms=$((RANDOM * 2 * took_ms[$command] / 32768))
    sleep "$((after_ms / 1000)).$(printf %03d $((after_ms % 1000)))"
    kill -9 "${processes[$((RANDOM % 2))]}" 2> /dev/null || true
  fi
  for process in "${processes[@]}"; do
    code=0
    wait "$process" 2> /dev/null || code=$?
    case $code in
      0) ;;
      137) kills=$((kills + 1)) of_command[$command]=$((${of_command[$command]:-0} + 1)) ;;
      2) refused=$((refused + 1)) ;;
      *) echo "ended with $code: $(cat said-A said-B)"; exit 1 ;;
    esac
  done
  cat said-A said-B 2> /dev/null | grep -v "writes into" | grep . && { echo "said more than who holds the folder"; exit 1; }
  # Each finished file is the whole file of one of the two runs, and all are of the same run.
  for name in A B; do
    declare "foreign_$name="
    while IFS= read -r file; do
      case $file in
        # Cells stand beside those of another campaign; samples have a name of their own.
        cells/* | samples.csv) cmp -s "$folder/$file" "whole/$command/A/out/$file" || cmp -s "$folder/$file" "whole/$command/B/out/$file" \
          || declare "foreign_$name=$file" ;;
        *) cmp -s "$folder/$file" "whole/$command/$name/out/$file" || declare "foreign_$name=$file" ;;
      esac
    done < <(finished "$folder")
  done
  if [ -n "$foreign_A" ] && [ -n "$foreign_B" ]; then
    echo "$command: mixed or torn: not of A: $foreign_A, not of B: $foreign_B"
    exit 1
  fi
done
for command in "${commands[@]}"; do
  (run "shared/$command" "$command" A)
  difference=$(diff -r "whole/$command/A/out" "shared/$command/out" | grep -v "^Only in shared/[a-z-]*/out/cells" || true)
  [ -z "$difference" ] || { echo "$command: something is left or lost: $difference"; exit 1; }
done
echo "$kills kills in $trials pairs of runs ($refused runs were told who holds the folder): every file whole, no folder mixed, nothing left behind"
for command in "${commands[@]}"; do echo "  $command: ${of_command[$command]:-0} kills"; done
