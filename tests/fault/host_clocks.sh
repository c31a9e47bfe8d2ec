#!/usr/bin/env bash
# The clock of one PC of a cell is 3 s ahead, then set back by 10 s, and forward by 20 s, while a job runs: its results are those of clocks in step, the
# offset is told within 0.2 ms, and a clock that is further off than the cell's bound begins no job.
# host_clocks.sh INVAR SOURCE_DIR
set -euo pipefail
source "$(dirname "$0")/../interop/three_namespaces.sh"
source "$(dirname "$0")/axis_process.sh"
as_root "$@"
invar=$1 source=$2
library=/usr/lib/$(uname -m)-linux-gnu/faketime/libfaketimeMT.so.1
[[ -e $library ]] || { echo "$library is missing; install libfaketime"; exit 1; }
three_namespaces
cp "$source/deployment/profiles.yaml" "$folder"
cp "$source/deployment/machines/xy-table-nominal.yaml" "$folder/machine.yaml"
cd "$folder"
{
cat <<'Y'
invar_cell: 1
name: clocks
domain: 14
time: real
profiles: profiles.yaml
hosts: {stage-pc: {address: 10.81.0.11}, trial-pc: {address: 10.81.0.12}}
processes:
Y
axis_process 'realtime: {rate: 1000, priority: 60}' '{velocity: 0.2, acceleration: 2, jerk: 100}'
cat <<'Y'
  trials:
    host: trial-pc
    rate: 500
    components:
      laser_x: {type: interferometer, connect: {tool: world.tool}}
      trial:
        type: axis_trial
        tracking: [{name: follow, from: 0.02, amplitude: 0.03, periods: [2], cycles: 2}]
        connect: {state: stage_x.state, command: stage_x.command, reading: laser_x.reading, beam: laser_x.beam}
  recorder: {host: stage-pc, rate: 50, components: {recorder: {type: recorder}}}
jobs: {follow: trial}
Y
} >cell.yaml
"$invar" check cell.yaml >/dev/null
fail() { echo "$*"; tail -n 30 ./*.log said job 2>/dev/null; exit 1; }
set_clock() { echo "$1" >offset.new && mv offset.new offset; }
set_clock "+3s"
clock=(env LD_PRELOAD="$library" FAKETIME_TIMESTAMP_FILE="$folder/offset" FAKETIME_NO_CACHE=1 FAKETIME_DONT_FAKE_MONOTONIC=1)
start() { apart "$1" "${@:3}" "$invar" run cell.yaml --host "$2" >"$2.log" 2>&1 & pids+=("$!"); run[$1]=$!; }
start 0 stage-pc
start 1 trial-pc "${clock[@]}"
for _ in $(seq 100); do on 0 "$invar" status cell.yaml --wait 0.5 >said 2>&1 && break; done
on 0 "$invar" status cell.yaml --wait 5 >said 2>&1 || fail "the cell does not come up"
sleep 2

# told SECONDS: the status says so of the clock of trial-pc, within 0.2 ms.
told() {
  local try
  for try in 1 2 3 4 5; do
    on 0 "$invar" status cell.yaml --json --wait 5 >status.json || true
    if /usr/bin/python3 - "$1" <<'P'; then return 0; fi
import json, sys
clock = next(p["clock"] for p in json.load(open("status.json"))["processes"] if p["name"] == "trials")
error, bound = abs(clock["ahead_ns"] * 1e-6 - 1e3 * float(sys.argv[1])), clock["error_ns"] * 1e-6
print(f"clock of trial-pc: {clock['ahead_ns'] * 1e-6:.3f} ms ahead of {clock['reference']}, known within {bound:.3f} ms")
assert error <= bound, "further off than it says"
sys.exit(error >= 0.2)
P
    sleep 1
  done
  return 1
}
# followed NAME: the laser, which stands at the PC whose clock is off, agrees with the encoder at the other to 5 mm (at 94 mm/s
# that is 50 ms: libfaketime lets a loop wake 20 ms early); clocks 3 s apart would make 60 mm of it.
followed() {
  on 1 "${clock[@]}" "$invar" job run cell.yaml follow >job 2>&1 || fail "$1: $(cat job)"
  /usr/bin/python3 - "$1" out/tracking.csv <<'P'
import csv, math, sys
rows = list(csv.DictReader(open(sys.argv[2])))
column = lambda word: next(k for k in rows[0] if k.startswith(word))
pairs = [(float(r[column("laser")]), float(r[column("position")])) for r in rows if r[column("laser")] not in ("", "nan")]
assert len(pairs) > 500, f"{len(pairs)} of {len(rows)} rows have a reading"
differences = [a - b for a, b in pairs]
mean = sum(differences) / len(differences)
rms = math.sqrt(sum((d - mean) ** 2 for d in differences) / len(differences))
print(f"{sys.argv[1]}: {len(pairs)} readings, {rms * 1e6:.1f} um RMS between laser and encoder")
assert rms < 5e-3, rms
P
}
told 3 || fail "the status does not tell the clocks"
on 0 "$invar" status cell.yaml --wait 5 | grep -A3 'clock of host' || fail "no table of the clocks"
followed "3 s ahead"
(sleep 3; set_clock "-7s") &
followed "set back by 10 s in the job"
wait $!
told -7 || fail "the status does not tell the clock that was set"
(sleep 3; set_clock "+13s") &
followed "set forward by 20 s in the job"
wait $!
told 13 || fail "the status does not tell the clock that was set forward"
on 0 "$invar" record cell.yaml --out tables/outside.mcap --topic trial.status --duration 1 >said 2>&1 || fail "nothing is recorded from outside"
grep -q 'stamps of host `trial-pc` are [0-9.]* s ahead of those of .stage-pc.*as they were sent' said || fail "a recording from outside does not say that clocks are apart: $(cat said)"

set_clock "-100s"
sleep 1
if on 0 "$invar" job run cell.yaml follow >job 2>&1; then fail "a job begins though a clock is 100 s off"; fi
grep -q 'host `stage-pc`.*100 s ahead.*clock_bound' job || fail "the job does not name the host"
kill -INT "${run[@]}"
wait "${run[@]}" || true
# What the recorder wrote of both PCs has stamps of one clock.
"$invar" export out/recording.mcap --out tables >/dev/null
/usr/bin/python3 - tables/*trial*status*.csv <<'P'
import csv, sys
rows = list(csv.DictReader(open(sys.argv[1])))
# libfaketime lets a loop wake 20 ms before its time. What came before the clocks were compared, at the start, is as it was sent.
apart = [float(r["received [s]"]) - float(r["time [s]"]) for r in rows if float(r["received [s]"]) > 3]
print(f"{len(apart)} statuses of trial-pc: stamped {min(apart):.4f} to {max(apart):.4f} s before they came")
assert apart and -0.05 < min(apart) and max(apart) < 0.5, (min(apart), max(apart))
P
