#!/usr/bin/env bash
# Two runs at once in one folder, of different models, killed with SIGKILL: at a random moment, or before or after a rename that is
# drawn. After each kill every finished file must be of one run only; at the end the folder must hold what an unbroken run leaves.
# Usage: benches/kill_shared.sh COILWRIGHT [KILLS]; needs a C compiler (the rename is caught by a preloaded library). COMMANDS names
# those to be tried.
set -euo pipefail
program=$(realpath "$1") wanted=${2:-200}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cc -shared -fPIC -O1 -Wall -Wextra -o "$work/kill.so" "$here/kill_at_rename.c" -ldl
cd "$work"
for name in A B; do
  index=$([ $name = A ] && echo 1.45 || echo 1.46)
  cat > $name.toml <<END
name = "coil $name"
[fibre]
refractive_index = $index
thermo_optic_per_k = 1e-5
wavelength_nm = 1550.0
outer_diameter_um = 165.0
[winding]
layers = 12
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
  # The second record is shorter, and there is one more of the first: other files, and more of them.
  rows=$([ $name = A ] && echo 300 || echo 200)
  awk -v rows=$rows -v a=$index 'BEGIN { srand(1); print "time_s,temperature_c,rate_deg_per_h"
    for (i = 0; i < rows; i++) printf "%d,%.3f,%.4f\n", 10 * i, 20 + 0.004 * i, a * sin(i / 20) + 0.05 * rand() }' > $name.csv
done
read -ra commands <<< "${COMMANDS:-schedule optimise pareto compare metrics temperatures}"
# command model folder
request() {
  case $1 in
    schedule) echo "schedule $2.toml -o $3" ;;
    optimise) echo "optimise $2.toml --rounds 3 --patience 3 --moves-per-restart 300 --checkpoint-every 5ms --fresh -o $3" ;;
    pareto) echo "pareto $2.toml --rounds 1 --most-captive 0 -o $3" ;;
    compare) if [ "$2" = A ]; then echo "compare A.toml A.csv B.csv -o $3"; else echo "compare B.toml B.csv -o $3"; fi ;;
    metrics) if [ "$2" = A ]; then echo "metrics A.csv B.csv -o $3"; else echo "metrics B.csv -o $3"; fi ;;
    temperatures) echo "temperatures $2.toml --rows 40 -o $3" ;;
  esac
}
declare -A renames
for command in "${commands[@]}"; do
  for name in A B; do
    # shellcheck disable=SC2046
    "$program" $(request $command $name "whole/$command/$name") -q > /dev/null
  done
  # Every finished file was renamed once; checkpoints more often.
  renames[$command]=$(($(find "whole/$command/A" -type f | wc -l) + 3))
done
RANDOM=7
kills=0 refused=0 trials=0
declare -A of_command
while [ $kills -lt "$wanted" ]; do
  command=${commands[$((trials % ${#commands[@]}))]}
  trials=$((trials + 1))
  folder=shared/$command
  mkdir -p "$folder"
  processes=()
  for name in $([ $((RANDOM % 2)) = 0 ] && echo A B || echo B A); do
    # shellcheck disable=SC2046
    case $((RANDOM % 3)) in
      0) "$program" $(request "$command" $name "$folder") -q > /dev/null 2> "said-$name" & ;;
      *) KILL_AT=$((RANDOM % renames[$command] + 1)) KILL_WHEN=$([ $((RANDOM % 2)) = 0 ] && echo before || echo after) \
           LD_PRELOAD="$work/kill.so" "$program" $(request "$command" $name "$folder") -q > /dev/null 2> "said-$name" & ;;
    esac
    processes+=($!)
  done
  if [ $((RANDOM % 3)) = 0 ]; then
    sleep "0.$(printf %03d $((RANDOM % 120)))"
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
      [ "$file" = checkpoint.json ] && continue
      cmp -s "$folder/$file" "whole/$command/$name/$file" || declare "foreign_$name=$file"
    done < <(cd "$folder" && find . -type f ! -name '.*' ! -path './parts/*' -printf '%P\n')
  done
  if [ -n "$foreign_A" ] && [ -n "$foreign_B" ]; then
    echo "$command: mixed or torn: not of A: $foreign_A, not of B: $foreign_B"
    exit 1
  fi
done
for command in "${commands[@]}"; do
  # shellcheck disable=SC2046
  "$program" $(request "$command" A "shared/$command") -q > /dev/null
  diff -r "whole/$command/A" "shared/$command" || { echo "$command: something is left or lost"; exit 1; }
done
echo "$kills kills in $trials pairs of runs ($refused runs were told who holds the folder): every file whole, no folder mixed, nothing left behind"
for command in "${commands[@]}"; do echo "  $command: ${of_command[$command]:-0} kills"; done
