#!/usr/bin/env bash
# Models are given to a running cell by `invar job apply`, each another one, in turn to a stage, a compensation and a dispenser:
# their processes give back what each took. Resident and locked memory after the first sixth (at least 30) and after all.
# many_models.sh INVAR SOURCE_DIR [MODELS]
set -euo pipefail
invar=$1 source=$2 models=${3:-${INVAR_MODELS:-66}}
source "$source/tests/cell/own_cell.sh"
own_cell print-cell "$source" 15030
cd "$folder"
cell=deployment/print-cell.yaml
sed -i 's/priority: 80, //' $cell  # what a process holds is the same, and other tests get to run
"$invar" run "$cell" --real-time >cell.log 2>&1 &
launcher=$!
trap 'kill "$launcher" 2>/dev/null || true; wait "$launcher" 2>/dev/null || true; rm -rf "$folder"' EXIT
fail() { echo "$*"; tail -n 20 cell.log; exit 1; }
"$invar" status $cell --wait 60 >/dev/null || fail "the cell does not come up"

model() {  # model COMPONENT NUMBER: the file COMPONENT.yaml, another one for each number
  local small; small=$(awk -v n="$2" 'BEGIN { printf "%.9g", 1e-7 * (1 + 0.001 * n) }')
  case $1 in
  stage_x)
    sed "s/^parameters:/parameters:  # $2/" deployment/machines/linear-axis-believed.yaml ;;
  compensation) cat <<M
invar_model: 1
plant: error_map
axis: x
columns: {position: x, time: t, temperature: T, error: e}
range: {temperature: [20, 26]}
baseline: {positions: [0, 0.2], errors: [0, 0]}
parameters: {reference_temperature: {value: 20, unit: degC}}
terms:
  - {term: periodic_error, amplitude: {value: $small, unit: m, sigma: 1e-8}, pitch: {value: 0.02, unit: m, sigma: 0}, phase: {value: 0, unit: rad, sigma: 0}}
M
    ;;
  dispenser) cat <<M
invar_model: 1
plant: droplet
columns: {target_x: tx, target_y: ty, height: h, time: t, landed_x: x, landed_y: y, velocity_x: vx, velocity_y: vy}
parameters:
  placement_error_x: {value: $small, unit: m, sigma: 1e-6}
  placement_error_y: {value: 118.2e-6, unit: m, sigma: 1e-6}
  slope_x: {value: 5.3e-3, unit: 1, sigma: 1e-4}
  slope_y: {value: 9.0e-5, unit: 1, sigma: 1e-4}
  speed: {value: 2, unit: m/s}
M
    ;;
  esac >"$1.yaml"
}
memory() {  # memory PROCESS: resident and locked [kB]
  awk '/^VmRSS|^VmLck/ { value[$1] = $2 } END { print value["VmRSS:"], value["VmLck:"] }' \
    "/proc/$(pgrep -P "$launcher" -f -- "--process $1 ")/status"
}

components=(stage_x compensation dispenser)
early=$((models / 6 > 30 ? models / 6 : 30))
for ((i = 1; i <= models; i++)); do
  component=${components[i % 3]}
  model "$component" "$i"
  "$invar" job apply "$cell" "$component" --model "$component.yaml" --wait 30 >said 2>&1 || { cat said; fail "model $i is not taken"; }
  if ((i == early)); then motion=$(memory motion) dispense=$(memory dispense); fi
done
most=1024  # kB: pages of the allocator; where each model was kept, 600 took 28 MB
for process in motion dispense; do
  read -r resident locked <<<"${!process}"
  read -r resident_now locked_now <<<"$(memory $process)"
  echo "$process [kB]: after $early models resident $resident, locked $locked; after $models resident $resident_now, locked $locked_now"
  ((resident_now - resident < most && locked_now - locked < most)) || fail "$process keeps more than $most kB of the models"
done
kill -INT "$launcher"
wait "$launcher" || fail "the cell did not end in order"
echo passed
