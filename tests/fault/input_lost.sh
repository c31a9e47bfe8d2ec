#!/usr/bin/env bash
# The process that gives a moving axis its feedback is killed: the stage brakes under control, then disables the drive or holds as its file
# says, and leaves its black box where it trips. Four processes over DDS, by the wall clock.
# input_lost.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
source "$source/tests/fault/moving_axis.sh"
cd "$folder"
pids=()
trap 'kill -9 "${pids[@]}" 2>/dev/null || true; rm -rf "$folder"' EXIT
start() { "$invar" run cell.yaml --process "$@" >"$1.log" 2>&1 & pids+=($!); }
is_in() { [[ $("$invar" echo cell.yaml stage_x.state --count 1 --json --wait 20) == *"\"AXIS_MODE_$1\""* ]]; }
wait_for() { for _ in $(seq 100); do is_in "$1" && return; done; echo "the axis does not get to $1"; cat ./*.log; exit 1; }

lose_feedback() {  # off|hold MODE
  rm -rf out tables; pids=()
  grep -v on_lost_input cell.yaml | sed "s/^\( *\)feedback_timeout:.*/&\n\1on_lost_input: $1/" > new.yaml; mv new.yaml cell.yaml
  start recorder; start plant; start servo; sleep 3
  start trials --job move
  wait_for MOVING
  kill -9 "${pids[1]}"
  wait_for "$2"
  sleep 0.5
  kill -TERM "${pids[3]}" 2>/dev/null || true; kill -TERM "${pids[0]}"; wait "${pids[0]}" || true
  kill -TERM "${pids[2]}" 2>/dev/null || true; wait "${pids[2]}" "${pids[3]}" || true
  cat ./*.log
  "$invar" export out/recording.mcap --out tables >/dev/null
  grep -hE "without feedback, then $3" tables/*.csv
  /usr/bin/python3 - "$2" tables/*stage_x*state*.csv tables/*stage_x*motor*.csv <<'P'
import csv, sys
end = "AXIS_MODE_" + sys.argv[1]
modes = []
for row in csv.DictReader(open(sys.argv[2])):
    if not modes or modes[-1] != row["mode"]:
        modes.append(row["mode"])
print("modes:", " -> ".join(modes))
motor = list(csv.DictReader(open(sys.argv[3])))
enabled = next(k for k in motor[0] if k.startswith("enabled"))
assert "AXIS_MODE_MOVING" in modes, "the axis never moved"
after = modes[len(modes) - 1 - modes[::-1].index("AXIS_MODE_MOVING"):]
assert after[:3] == ["AXIS_MODE_MOVING", "AXIS_MODE_STOPPING", end], after
held = motor[-1][enabled] not in ("0", "false")
assert held == (sys.argv[1] == "HOLDING"), "the motor is " + ("" if held else "not ") + "enabled"
P
}

lose_feedback hold HOLDING holds
lose_feedback off FAULT "disables the drive"
ls out/black-box-servo-*.mcap
"$invar" recording info out/black-box-servo-*.mcap
echo "passed"
