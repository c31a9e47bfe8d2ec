#!/usr/bin/env bash
# A running cell whose ports get broken RTPS messages, mutated from its own traffic and under the names of its participants:
# no process ends, every component stays active, samples flow, memory stays bounded, and the cell says what was dropped.
# rtps_fuzz.sh INVAR FUZZER SOURCE_DIR [MESSAGES [SEED [MESSAGES_A_SECOND]]]
set -euo pipefail
invar=$1 fuzzer=$2 source=$3 messages=${4:-${INVAR_FUZZ_MESSAGES:-200000}} seed=${5:-$RANDOM} rate=${6:-10000}
folder=$(mktemp -d)
cp -r "$source/deployment" "$folder/deployment"
source "$source/tests/support/claims.sh"
cell=$folder/deployment/xy-table.yaml
# A supervisor that gives a busy host time: what it takes down stays so.
sed -i "s/^domain: .*/domain: $domain/; s/15020/$port/; s/type: supervisor/type: supervisor\n        timeout: 30/" "$cell"
cd "$folder"
"$invar" run "$cell" --real-time >log 2>&1 &
launcher=$!
trap 'kill "$launcher" 2>/dev/null || true; wait "$launcher" 2>/dev/null || true; rm -rf "$folder"' EXIT
fail() { echo "$1"; tail -n 40 log; exit 1; }
state() {  # state FILE: the status, and the pids of those that are active
  "$invar" status "$cell" --json --wait 20 >"$1" 2>/dev/null
  /usr/bin/python3 - "$1" <<'P'
import json, sys
status = json.load(open(sys.argv[1]))
assert [c["state"] for c in status["components"]] == ["active"] * 10, status["components"]
print(*sorted(p["pid"] for p in status["processes"]))
P
}
memory() { for pid in $pids; do awk '/VmRSS/ {print $2}' "/proc/$pid/status" || echo 0; done | xargs; }
for _ in $(seq 60); do pids=$(state before 2>/dev/null) && [[ $(wc -w <<<"$pids") == 5 ]] && break; sleep 0.5; done
[[ $(wc -w <<<"$pids") == 5 ]] || fail "the cell did not come up"
loop() { /usr/bin/python3 -c '
import json, sys
for p in json.load(open(sys.argv[1]))["processes"]:
    if p["name"] == "motion": print("loop:", p["cycles"], "cycles,", p["overruns"], "overruns, wake-up", p["wake_up"])' "$1"; }
sleep 3
state before >/dev/null || fail "the cell is not well before"
echo "before: resident [kB] $(memory)"; loop before

"$fuzzer" "$domain" 127.0.0.1 "$messages" "$seed" "$rate" >fuzzed 2>&1 &
fuzzing=$!
while kill -0 "$fuzzing" 2>/dev/null; do
  sleep 2
  for pid in $pids; do kill -0 "$pid" 2>/dev/null || fail "process $pid ended (seed $seed)"; done
done
wait "$fuzzing" || { cat fuzzed; fail "the fuzzer failed"; }
cat fuzzed
echo "after: resident [kB] $(memory)"
now=$(state after) || fail "not every component is active (seed $seed)"
loop after
[[ $now == "$pids" ]] || fail "processes were replaced: $pids, now $now (seed $seed)"
for kilobytes in $(memory); do ((kilobytes < 1500000)) || fail "a process took $kilobytes kB (seed $seed)"; done
for topic in stage_x.state thermal.state calibration.status; do
  "$invar" echo "$cell" "$topic" --count 3 --wait 20 >/dev/null || fail "no samples of $topic (seed $seed)"
done
grep -q "dropped messages that no DDS program should send" log || "$invar" status "$cell" | grep -q "dropped messages" ||
  fail "nobody says that messages were dropped"
kill -INT "$launcher"
wait "$launcher" || fail "the cell did not stop in order (seed $seed)"
echo "passed"
