#!/usr/bin/env bash
# A running cell whose ports get broken RTPS messages, mutated from its own traffic and under the names of its participants:
# no process ends, every component stays active, samples flow, memory stays bounded, and the cell says what was dropped.
# INVAR_SECURED=1: of a secured cell. rtps_fuzz.sh INVAR FUZZER SOURCE_DIR [MESSAGES [SEED [MESSAGES_A_SECOND]]]
set -euo pipefail
invar=$1 fuzzer=$2 source=$3 messages=${4:-${INVAR_FUZZ_MESSAGES:-60000}} seed=${5:-$RANDOM} rate=${6:-10000}
folder=$(mktemp -d)
cp -r "$source/deployment" "$folder/deployment"
source "$source/tests/support/claims.sh"
cell=$folder/deployment/xy-table.yaml
# A supervisor that gives a busy host time: what it takes down stays so.
sed -i "s/^domain: .*/domain: $domain/; s/15020/$port/; s/type: supervisor/type: supervisor\n        timeout: 30/" "$cell"
cd "$folder"
if [[ -n ${INVAR_SECURED:-} ]]; then
  echo "security: {keys: keys}" >>"$cell"
  "$invar" keys "$cell" >keys.log
fi
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
    if p["name"] == "motion":
        now = p["recent"]
        print(sys.argv[2] + ":", p["cycles"], "cycles,", p["overruns"], "overruns; in the last %.0f s" % (now["window_ns"] * 1e-9),
              *("%s p50 %.0f us, p99 %.0f us;" % (what, now[what]["p50_ns"] * 1e-3, now[what]["p99_ns"] * 1e-3)
                for what in ("wake_up", "latency")))' "$1" "$2"; }
sleep 8  # the start is hardly in the window any more
state before >/dev/null || fail "the cell is not well before"
at_first=($(memory))
echo "before: resident [kB] ${at_first[*]}"; loop before before

"$fuzzer" "$domain" 127.0.0.1 "$messages" "$seed" "$rate" >fuzzed 2>&1 &
fuzzing=$!
highest=("${at_first[@]}")
while kill -0 "$fuzzing" 2>/dev/null; do
  sleep 1
  for pid in $pids; do kill -0 "$pid" 2>/dev/null || fail "process $pid ended (seed $seed)"; done
  now=($(memory))
  for i in "${!now[@]}"; do ((now[i] <= highest[i])) || highest[i]=${now[i]}; done
done
wait "$fuzzing" || { cat fuzzed; fail "the fuzzer failed"; }
cat fuzzed
echo "highest meanwhile: resident [kB] ${highest[*]}"
now=$(state after) || fail "not every component is active (seed $seed)"
loop after meanwhile
[[ $now == "$pids" ]] || fail "processes were replaced: $pids, now $now (seed $seed)"
# What one process may take for messages, the library's pools with it, beyond what it had.
most=65536  # kB
for i in "${!highest[@]}"; do
  ((highest[i] - at_first[i] < most)) || fail "a process took $((highest[i] - at_first[i])) kB more (seed $seed)"
done
# The status of a job at rest was said once, before; who comes late gets it all the same.
for topic in "stage_x.state 3" "thermal.state 3" "calibration.status 1"; do
  timeout 60 "$invar" echo "$cell" ${topic% *} --count "${topic#* }" --wait 20 >/dev/null || fail "no samples of ${topic% *} (seed $seed)"
done
grep -q "dropped messages that no DDS program should send" log || "$invar" status "$cell" | grep -q "dropped messages" ||
  fail "nobody says that messages were dropped"
kill -INT "$launcher"
wait "$launcher" || fail "the cell did not stop in order (seed $seed)"
echo "passed"
