#!/usr/bin/env bash
# A cell is stopped while its axis moves: by Ctrl-C, and by the death (-9) of `invar run` itself. The plant is a process of its
# own that stands first in the file: the axis brakes on its feedback to a standstill before anything leaves, and nothing stays.
# stop_while_moving.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
source "$source/tests/fault/moving_axis.sh"
cd "$folder"
launcher= children=
trap 'kill -9 $launcher $children 2>/dev/null || true; rm -rf "$folder"' EXIT
"$invar" check cell.yaml

for end in INT KILL; do
  rm -rf out tables
  "$invar" run "$folder/cell.yaml" --job move >"log-$end" 2>&1 &
  launcher=$!
  moving() {
    "$invar" echo cell.yaml stage_x.state --count 1 --json --wait 20 | /usr/bin/python3 -c '
import json, sys
sample = json.loads(sys.stdin.readline())
sample = sample.get("value", sample)
sys.exit(not abs(sample["setpoint_velocity"]) > 0.04)'
  }
  for _ in $(seq 200); do if moving 2>/dev/null; then break; fi; done
  children=$(pgrep -P "$launcher")
  kill "-$end" "$launcher"
  wait "$launcher" || true
  launcher=
  for child in $children; do
    for _ in $(seq 150); do kill -0 "$child" 2>/dev/null || break; sleep 0.1; done
    ! kill -0 "$child" 2>/dev/null || { echo "a process is left after $end"; cat "log-$end"; exit 1; }
  done
  cat "log-$end"
  "$invar" export out/recording.mcap --out tables >/dev/null
  /usr/bin/python3 - tables/*stage_x*state*.csv tables/*stage_x*motor*.csv tables/*feedback_x*.csv <<'P'
import csv, sys
states, motor, feedback = (list(csv.DictReader(open(name))) for name in sys.argv[1:])
column = lambda rows, word: next(k for k in rows[0] if k.startswith(word))
modes = []
for row in states:
    if not modes or modes[-1] != row["mode"]:
        modes.append(row["mode"].removeprefix("AXIS_MODE_"))
modes = [m for i, m in enumerate(modes) if i == 0 or m != modes[i - 1]]
print("modes:", " -> ".join(modes))
on, stamp = column(motor, "enabled"), column(motor, "at.time_ns")
let_go = next(i for i in reversed(range(len(motor))) if motor[i][on] in ("1", "true"))
last_on = int(motor[let_go][stamp])
assert let_go + 1 < len(motor), "the motor was never let go of"
speed, when = column(feedback, "velocity"), column(feedback, "at.time_ns")
velocities = [(int(row[when]), float(row[speed])) for row in feedback]
assert max(abs(v) for _, v in velocities) > 0.04, "the axis did not move"
# From when either the motor was let go of or the plant left, whatever came first: nothing coasts.
end = min(last_on, velocities[-1][0])
rest = [v for t, v in velocities if t >= end - 2_000_000]
print(f"end {(last_on - velocities[-1][0]) / 1e6:+.1f} ms before the plant's, at {max(map(abs, rest)) * 1e3:.3f} mm/s")
assert max(map(abs, rest)) < 2e-3, rest
assert modes[-2:] in (["STOPPING", "HOLDING"], ["HOLDING", "DISABLED"]) and "STOPPING" in modes, modes
P
done
! grep -l "braked without feedback" tables/*notices*.csv || { echo "it braked blindly"; exit 1; }
grep -q "is no more" log-KILL || { echo "nobody says why the cell stopped"; exit 1; }
echo "passed"
