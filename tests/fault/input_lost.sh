#!/usr/bin/env bash
# The process that gives a moving axis its feedback is killed: the stage brakes under control, lets go, stays stopped, and
# leaves its black box. Four processes over DDS, by the wall clock.
# input_lost.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
source "$source/tests/fault/moving_axis.sh"
cd "$folder"
pids=()
trap 'kill -9 "${pids[@]}" 2>/dev/null || true; rm -rf "$folder"' EXIT
start() { "$invar" run cell.yaml --process "$@" >"$1.log" 2>&1 & pids+=($!); }
start recorder; start plant; plant=${pids[1]}; start servo; sleep 3
start trials --job move
is_in() { [[ $("$invar" echo cell.yaml stage_x.state --count 1 --json --wait 20) == *"\"AXIS_MODE_$1\""* ]]; }
wait_for() { for _ in $(seq 100); do is_in "$1" && return; done; echo "the axis does not get to $1"; cat ./*.log; exit 1; }
wait_for MOVING
kill -9 "$plant"
wait_for FAULT
kill -TERM "${pids[2]}" "${pids[3]}" 2>/dev/null || true; sleep 1; kill -TERM "${pids[0]}"; wait "${pids[0]}" || true
cat ./*.log
"$invar" export out/recording.mcap --out tables >/dev/null
ls out tables
/usr/bin/python3 - tables/*stage_x*state*.csv tables/*stage_x*motor*.csv <<'P'
import csv, sys
rows = list(csv.DictReader(open(sys.argv[1])))
modes = []
for row in rows:
    if not modes or modes[-1] != row["mode"]:
        modes.append(row["mode"])
print("modes:", " -> ".join(modes))
motor = list(csv.DictReader(open(sys.argv[2])))
enabled = next(k for k in motor[0] if k.startswith("enabled"))
assert "AXIS_MODE_MOVING" in modes, "the axis never moved"
after = modes[len(modes) - 1 - modes[::-1].index("AXIS_MODE_MOVING"):]
assert after[:3] == ["AXIS_MODE_MOVING", "AXIS_MODE_STOPPING", "AXIS_MODE_FAULT"], after
assert motor[-1][enabled] in ("0", "false"), "the motor is still enabled"
P
ls out/black-box-servo-*.mcap
"$invar" recording info out/black-box-servo-*.mcap
echo "passed"
