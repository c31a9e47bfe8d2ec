#!/usr/bin/env bash
# The cell finds out what its model leaves out. Three ways: as jobs in simulated time, on a running cell with `invar record` and
# `invar job apply`, and with nothing hidden, where nothing may be claimed or applied.
# mismatch.sh INVAR SOURCE_DIR jobs|live|clock|nothing|watch|refusals     live: simulated time at the pace of the wall clock, slower where
# the host is busy, so that no cycle is lost; clock: by the wall clock, by hand
set -euo pipefail
export COLUMNS=250  # so that no line of a table is broken
invar=$1 source=$2 part=$3
folder=$(mktemp -d); cell_pid=
trap 'kill $cell_pid ${record_pid:-} 2>/dev/null || true; wait; rm -rf "$folder"' EXIT
cp -r "$source/deployment" "$folder/deployment"
source "$source/tests/support/claims.sh"
cd "$folder"
cell=deployment/mismatch.yaml believed=deployment/machines/linear-axis-believed.yaml truth=deployment/machines/linear-axis-true.yaml
sed -i "s/^domain: .*/domain: $domain/" $cell
fail() { echo "$*"; exit 1; }

# What the axis really has: one line of YAML a term.
hide() {
  sed -i '/^terms:/,$d' $truth
  echo "terms: [$1]" >>$truth
}
# RMS in um of the following error in a file of the job, its mean taken out.
rms() {
  awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i ~ /^following_error/) c = i; next }
    { sum += $c; squares += $c * $c; n++ } END { printf "%.4f\n", 1e6 * sqrt(squares / n - (sum / n) ^ 2) }' "$1"
}
# What nine of ten following errors stay below [um], their median taken out: a host that stalls for once does not count.
spread() {
  python3 - "$1" <<'PYTHON'
import csv, statistics, sys
errors = [float(v) for row in csv.DictReader(open(sys.argv[1])) for k, v in row.items() if k.startswith("following_error")]
middle = statistics.median(errors)
print(f"{1e6 * sorted(abs(e - middle) for e in errors)[int(0.9 * len(errors))]:.4f}")
PYTHON
}
# falls BEFORE AFTER SHARE: AFTER is at most SHARE of BEFORE.
falls() {
  echo "$1 before, $2 after"
  awk -v b="$1" -v a="$2" -v s="$3" 'BEGIN { exit !(a > 0 && a <= s * b) }' || fail "it did not fall to $3 of what it was"
}
# Both terms of the axis must be named, with the numbers that the file of the truth has: each within four of its standard
# deviations, which are small themselves. The axis is shaken by noise of its own, so that two recordings never say quite the same.
finds_the_truth() {
  python3 - "$1" <<'PYTHON'
import json, sys
found = {f["term"]: f["parameters"] for f in json.load(open(sys.argv[1]))["findings"]}
print("found:", *found)
for term, parameter, truth, small in (("force_ripple", "pitch", 0.0317, 3e-5), ("force_ripple", "amplitude", 2.4, 0.08),
                                      ("coulomb_friction", "level", 3.0, 0.1)):
    value, sigma = (found[term][parameter][k] for k in ("value", "sigma"))
    print(f"{term} {parameter} {value:.6g} +- {sigma:.2g}, in truth {truth}")
    assert 0.0 < sigma < small and abs(value - truth) < 4.0 * sigma, (term, parameter, found[term][parameter])
PYTHON
}
verdict_of() { python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["verdict"])' "$1"; }

case $part in
  jobs)
    "$invar" run $cell --job excite
    "$invar" diagnose --model $believed --recording out/mismatch/recording.mcap --out out/mismatch/diagnosis
    finds_the_truth out/mismatch/diagnosis/report.json
    "$invar" run $cell --job prove | tee summary
    grep -Eq '^\.\.\. patched +rms .* times less\)' summary || fail "the summary does not say what it was good for"
    falls "$(rms out/mismatch/motion_before.csv)" "$(rms out/mismatch/motion_after.csv)" 0.25
    # On a recording that was not diagnosed - of the second job - the patched model is nearer to what was measured.
    share() { # of the current's spread that a model does not explain [%]
      "$invar" job compare --recording out/mismatch/recording.mcap --machine "$1" --out compare | awk '/state.current/ { print $(NF - 1) }'
    }
    falls "$(share $believed)" "$(share out/mismatch/diagnosis/patched.yaml)" 0.5
    ;;
  nothing)
    hide ""
    "$invar" run $cell --job excite
    "$invar" diagnose --model $believed --recording out/mismatch/recording.mcap --out out/mismatch/diagnosis
    [[ $(verdict_of out/mismatch/diagnosis/report.json) == no_mismatch ]] || fail "claimed something where there is nothing"
    "$invar" run $cell --job prove | tee summary
    grep -q "nothing was given to the stage" summary || fail "something was applied"
    [[ ! -e out/mismatch/motion_after.csv ]] || fail "there is a motion after nothing"
    ;;
  watch)
    # The watch beside the stage says nothing while the axis is what its model says, and where it parts when it does; what it
    # says is on the cell's bus and in the recording.
    sed -i "s|topics: \[stage_x/state\]|topics: [stage_x/state, process/notices]|; s/type: model_watch/&\n        time: 1/" $cell
    hide "{term: coulomb_friction, level: {value: 3, unit: N}}"
    mv $truth deployment/machines/linear-axis-worn.yaml
    cp "$source/$truth" $truth
    hide ""
    notices() { # what the watch said in a run of the job `excite`: one line a notice, time [s] first
      rm -rf out tables
      "$invar" run $cell --job excite >run.log || { cat run.log; fail "the cell does not run"; }
      "$invar" recording info out/mismatch/recording.mcap | grep -q process/notices || return 0
      "$invar" export out/mismatch/recording.mcap --topic process.notices --out tables >/dev/null
      { grep watch_x tables/* || true; }
    }
    notices >said
    [[ ! -s said ]] || { cat said; fail "the watch says that an axis parts from its model that does not"; }
    sed -i 's|x: {model: machines/linear-axis-true.yaml}|x: {model: machines/linear-axis-true.yaml, changed: machines/linear-axis-worn.yaml, change_at: 6}|' $cell
    grep -q change_at $cell || fail "the cell file has no line of the world's model to change"
    notices >said
    cat said
    [[ $(wc -l <said) == 1 ]] || fail "one notice was to come, behind the change at 6 s"
    awk -F, '{ exit !($1 > 6 && $1 < 10) }' said || fail "it did not come within seconds"
    grep -q "SEVERITY_WARNING,0,watch_x,\"axis and model part: .*axis\.force, goes with direction" said || fail "it does not say where"
    ;;
  live | clock)
    time=--real-time
    [[ $part == clock ]] || time="--simulated --pace 1"
    sed -i "s/^        control:/        following_error: 0.05  # a host that stalls must not trip the axis\n        control:/" $cell
    grep -q "following_error" $cell || fail "the cell file has no \`control\` to put the following error before"
    sed -i "s/velocities: \[0.03, 0.08, 0.15\]/velocities: [0.06, 0.15]/; s/type: model_watch/&\n        time: 1/" $cell # short
    "$invar" run $cell $time >cell.log 2>&1 &
    cell_pid=$!
    "$invar" status $cell --wait 60 >/dev/null || { cat cell.log; fail "the cell does not come up"; }
    "$invar" record $cell --out run.mcap --topic stage_x.state --wait 60 >recorded 2>&1 &
    record_pid=$!
    for _ in $(seq 100); do ! grep -q "^recording into" recorded || break; sleep 0.2; done
    "$invar" job run $cell excite --wait 60 || { cat cell.log; fail "the axis did not move"; }
    cp out/mismatch/motion_before.csv first.csv
    # The watch in the loop has seen it by itself, and says where.
    "$invar" status $cell >said || true
    grep -E "warning +watch_x:? +axis and model part: .*axis\.force" said || { cat said; fail "the watch has said nothing"; }
    sleep 3 # as on a host where the next command takes so long to start
    kill -INT $record_pid
    wait $record_pid || { cat recorded; fail "the recording failed"; }
    cat recorded
    "$invar" diagnose --model $believed --recording run.mcap --out diagnosis
    finds_the_truth diagnosis/report.json
    # How long the axis stood before somebody ended the recording is no physics.
    ! grep -q "a curve over time" diagnosis/report.html || fail "it claims something over time"
    "$invar" job apply $cell stage_x --model diagnosis/patched.yaml --wait 60 --partly # whatever else it found
    "$invar" job run $cell excite --wait 60
    falls "$(spread first.csv)" "$(spread out/mismatch/motion_before.csv)" 0.25
    cp out/mismatch/motion_before.csv applied.csv
    "$invar" job apply $cell stage_x --rollback --wait 60
    "$invar" job run $cell excite --wait 60
    falls "$(spread out/mismatch/motion_before.csv)" "$(spread applied.csv)" 0.25 # as it was
    kill -INT $cell_pid
    wait $cell_pid || { cat cell.log; fail "the cell did not end in order"; }
    cell_pid=
    ;;
  refusals)
    # status WORDS ARGUMENTS...: `invar job apply` ends so and says this in one line.
    refuses() {
      local wanted=$1 words=$2 status=0; shift 2
      "$invar" job apply "$@" >said 2>&1 || status=$?
      [[ $status == "$wanted" && $(wc -l <said) == 1 ]] && grep -qF -- "$words" said || { cat said; fail "status $status, not $wanted: $words"; }
    }
    hide "{term: periodic_disturbance, amplitude: {value: 1, unit: N}, frequency: {value: 20, unit: Hz}, phase: {value: 0, unit: rad}}"
    refuses 2 "true.yaml: terms[0]: a stage cannot feed \`periodic_disturbance\` forward: it goes over time" $cell stage_x --model $truth
    hide "{term: backlash, width: {value: 1e-6, unit: m}}"
    refuses 2 "a stage cannot feed \`backlash\` forward: a current cannot take up play; take it out, or give --partly" $cell stage_x --model $truth
    refuses 2 "--model: is missing; name the model's file, or give --rollback or --none" $cell stage_x
    refuses 2 "nowhere.yaml" $cell stage_x --model nowhere.yaml
    refuses 2 "COMPONENT: \`stage_z\` is no component of" $cell stage_z --model $believed
    # A model of another plant: one line that says who takes it, or what does in its stead.
    model() { # PLANT MORE
      printf 'invar_model: 1\nplant: %s\n%b\n' "$1" "$2" >other.yaml
    }
    model error_map 'columns: {time: t, position: x, error: e}\nparameters: {reference_temperature: {value: 20, unit: degC}}\nbaseline: {positions: [0, 0.1, 0.2], errors: [0, 1e-6, 0]}'
    refuses 2 "is for a compensation; \`stage_x\` is of type stage; the cell has no compensation" $cell stage_x --model other.yaml
    model sensor 'columns: {time: t, true_position: x, encoder: e}\nparameters: {resolution: {value: 1e-6, unit: m}}'
    refuses 2 "is of plant sensor, which no component takes; give fusion what" $cell stage_x --model other.yaml
    model thermal 'columns: {time: t}\nnodes: {slide: {column: s, capacity: {value: 850, unit: J/K}, loss: {value: 9, unit: W/K}}}\nheaters: {pad: {node: slide, column: p, gain: {value: 1, unit: W/W}}}\nambient: a'
    refuses 2 "is of plant thermal, which no component takes; the component thermal has gains" $cell stage_x --model other.yaml
    head='columns: {target_x: a, target_y: b, height: h, time: t, landed_x: x, landed_y: y}\nparameters: {placement_error_x: {value: 1e-6, unit: m}, placement_error_y: {value: 0, unit: m}, slope_x: {value: 0, unit: 1}, slope_y: {value: 0, unit: 1}, speed: {value: 2, unit: m/s}}'
    model droplet "$head"
    refuses 2 "is for a dispenser; \`stage_x\` is of type stage; the cell has no dispenser" $cell stage_x --model other.yaml
    refuses 2 "columns: read what \`stage_x\` recorded, not \`stage_y\`" deployment/print-cell.yaml stage_y --model $believed
    refuses 2 "is for a stage; \`dispenser\` is of type dispenser; give it to stage_x, stage_y" deployment/print-cell.yaml dispenser --model $believed
    model droplet "$head\nterms: [{term: air_drag, diameter: {value: 5e-4, unit: m}}]"
    refuses 2 "terms[0]: a dispenser cannot aim by \`air_drag\`: its shift is not straight in the height; take it out, or give --partly" $cell stage_x --model other.yaml
    ;;
  *) fail "$part is none of the parts" ;;
esac
echo "passed"
