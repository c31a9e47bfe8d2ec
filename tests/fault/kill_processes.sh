#!/usr/bin/env bash
# Every process of a running cell is killed (-9) in turn, shared memory left behind; each is started again and works, the
# supervisor says what was lost, and no recording is overwritten. Then all components are active and a job runs to its end; a
# job whose component is killed ends there and does not begin again by itself. What the dead left in shared memory goes.
# kill_processes.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
folder=$(mktemp -d)
cp -r "$source/deployment" "$folder/deployment"
source "$source/tests/support/claims.sh"
cell=$folder/deployment/xy-table.yaml
# With a job of a minute, and a supervisor that gives a busy host the time to start a process again: what it takes down stays so.
/usr/bin/python3 - "$cell" "$domain" "$port" "$source/tests/support/short_job.yaml" <<'P'
import re, sys
text = open(sys.argv[1]).read()
text = re.sub(r"(?m)^domain: .*", f"domain: {sys.argv[2]}", text).replace("15020", sys.argv[3])
short = open(sys.argv[4]).read()
# The one that is killed must not be over before a busy host has seen it move.
long = short.replace("short", "long").replace("interval: 0.02", "interval: 0.003")
text = text.replace("        jobs:\n", "        settle_timeout: 60\n        jobs:\n" + short + long, 1)
text = text.replace("type: supervisor", "type: supervisor\n        timeout: 30")
text = text.replace("jobs: {", "jobs: {short: calibration, long: calibration, ")
# A starved host must not trip an axis: its setpoint goes by the clock.
text = text.replace("        travel: [0, 0.2]\n", "        travel: [0, 0.2]\n        following_error: 0.1\n        feedback_timeout: 0.5\n")
open(sys.argv[1], "w").write(text)
P
cd "$folder"
touch before
"$invar" run "$cell" --real-time >log 2>&1 &
launcher=$!
trap 'kill "$launcher" 2>/dev/null || true; wait "$launcher" 2>/dev/null || true; rm -rf "$folder"' EXIT

fail() { echo "$1"; cat log; exit 1; }
process() { pgrep -P "$launcher" -f -- "--process $1 " || true; }
wait_for() {  # wait_for WHAT COMMAND...: up to 60 s
  local what=$1 end=$((SECONDS + 60)); shift
  while ((SECONDS < end)); do if "$@"; then return; fi; sleep 0.1; done
  fail "waited in vain for: $what"
}
alive() { [[ -n $(process "$1") ]]; }
replaced() { local now; now=$(process "$1"); [[ -n $now && $now != "$2" ]]; }
all_active() {  # every component of the file, by the processes that live now
  "$invar" status "$cell" --json --wait 10 2>/dev/null | /usr/bin/python3 -c '
import json, sys
status = json.load(sys.stdin)
states = [c["state"] for c in status["components"]]
pids = {p["pid"] for p in status["processes"]}
sys.exit(states != ["active"] * 10 or pids != {int(word) for word in sys.argv[1:]})' $(pgrep -P "$launcher") || return 1
}

for name in motion heat calibration recorder supervisor; do wait_for "$name" alive "$name"; done
wait_for "the recording" test -s out/xy-table/recording.mcap
wait_for "all components active at first" all_active
for name in recorder motion heat calibration supervisor; do
  pid=$(process "$name")
  kill -9 "$pid"
  wait_for "another $name" replaced "$name" "$pid"
done
wait_for "all components active again" all_active
"$invar" status "$cell" || true

"$invar" job run "$cell" short --wait 20 >job 2>&1 || { cat job; fail "the job failed after the kills"; }
cat job
test -s out/short/compensation.yaml || fail "the job left no result"

# Killed in its job, the calibration comes back, and the job stays over.
"$invar" job run "$cell" long --wait 20 >job 2>&1 &
client=$!
moving() { [[ $("$invar" echo "$cell" stage_x.state --count 1 --json --wait 10 2>/dev/null) == *'"moving":true'* ]]; }
wait_for "the second job to move" moving
pid=$(process calibration)
kill -9 "$pid"
if wait "$client"; then cat job; fail "a job whose component died ended as if all were well"; fi
cat job
grep -q "was started again meanwhile" job || fail "the job's caller does not hear what happened"
wait_for "another calibration" replaced calibration "$pid"
wait_for "all components active after the job" all_active
still() { for _ in 1 2 3 4 5 6; do if moving; then return 1; fi; done; }
wait_for "the axes to stand" still
status=$("$invar" echo "$cell" calibration.status --count 1 --json --wait 10)
[[ $status == *JOB_IDLE* && ! -e out/long/compensation.yaml ]] || fail "the job began again by itself: $status"

kill -INT "$launcher"
wait "$launcher" || fail "the cell did not stop in order"
cat log
for name in motion heat calibration recorder supervisor; do
  grep -q "process \`$name\` ended with status 137; starting it again" log || { echo "$name was not started again"; exit 1; }
  grep -Eq "^$name +[0-9.]+ Hz +[1-9]" log || { echo "$name did not run to the end"; exit 1; }
done
test "$(ls out/xy-table/recording*.mcap | wc -l)" = 2 || { echo "a recording was overwritten"; exit 1; }
"$invar" recording info out/xy-table/recording-1.mcap || (($? == 1))  # cut off by the kill: readable up to there

# Segments that nobody holds any more and that are of this test's time are gone half a minute after they were found.
left() {
  local lock
  for lock in $(find /dev/shm -maxdepth 1 -name 'fastrtps_*_[es]l' -newer before); do
    flock -xn "$lock" true 2>/dev/null && echo "$lock"
  done
  true
}
echo "left in shared memory: $(left | wc -l)"
look() { (cd "$folder" && "$invar" run "$cell" --real-time --duration 4 >/dev/null 2>&1) || true; }
look
for _ in $(seq 35); do [[ -z $(left) ]] && break; sleep 1; done
look
left=$(left | wc -l)
echo "left after another run: $left"
[[ $left == 0 ]] || { echo "what the killed left in shared memory stays"; exit 1; }
echo "passed"
