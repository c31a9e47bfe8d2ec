#!/usr/bin/env bash
# `invar job apply` reaches every component that takes a model: a diagnosed head into a dispenser, whose next pattern aims by it,
# and out of it; compensation taken out, a diagnosed error map into it. Simulated time at a pace, so that no host is too slow for it.
# apply.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
source "$(dirname "$0")/own_cell.sh"
own_cell print-cell "$source" 15030
cd "$folder"
cell=deployment/print-cell.yaml
cat >head.yaml <<'MODEL'
invar_model: 1
plant: droplet
columns: {target_x: tx, target_y: ty, height: h, time: t, landed_x: x, landed_y: y, velocity_x: vx, velocity_y: vy}
parameters:
  placement_error_x: {value: 2.0e-6, unit: m, sigma: 1e-6}
  placement_error_y: {value: 118.2e-6, unit: m, sigma: 1e-6}
  slope_x: {value: 5.3e-3, unit: 1, sigma: 1e-4}
  slope_y: {value: 9.0e-5, unit: 1, sigma: 1e-4}
  speed: {value: 2, unit: m/s}
terms:
  - {term: valve_delay, delay: {value: 3e-4, unit: s}}
MODEL
cat >map.yaml <<'MODEL'
invar_model: 1
plant: error_map
axis: x
columns: {position: x, time: t, temperature: T, error: e}
range: {temperature: [20, 26]}
baseline: {positions: [0, 0.2], errors: [0, 0]}
parameters: {reference_temperature: {value: 20, unit: degC}}
terms:
  - {term: periodic_error, amplitude: {value: 3.0e-7, unit: m, sigma: 1e-8}, pitch: {value: 0.02, unit: m, sigma: 0}, phase: {value: 0, unit: rad, sigma: 0}}
  - {term: thermal_expansion, coefficient: {value: 1.0e-6, unit: 1/K, sigma: 1e-8}}
MODEL
"$invar" run $cell --simulated --pace 2 >cell.log 2>&1 &
cell_pid=$!
trap 'kill $cell_pid 2>/dev/null || true; wait; rm -rf "$folder"' EXIT
fail() { echo "$*"; cat cell.log; exit 1; }
"$invar" status $cell --wait 60 >/dev/null || fail "the cell does not come up"
says() { # WORDS ARGUMENTS...
  local words=$1; shift
  "$invar" job apply "$@" --wait 60 | tee said || fail "job apply $* ended with an error"
  grep -qF -- "$words" said || fail "it does not say: $words"
}
says "dispenser: $PWD/head.yaml is active" $cell dispenser --model head.yaml
says "dispenser: no model any more" $cell dispenser --none
says "compensation: no model any more" $cell compensation --none
says "compensation: $PWD/map.yaml is active" $cell compensation --model map.yaml
says "compensation: no model any more" $cell compensation --none
kill -INT $cell_pid
wait $cell_pid || fail "the cell did not end in order"
echo passed
