#!/usr/bin/env bash
# A certificate is revoked while the cell runs: within two seconds nothing that its holder sends is taken, within eight it gets nothing
# more, and nobody else loses a sample. A certificate is renewed: the process is started anew, alone, and what that costs is printed.
# revoked.sh INVAR SOURCE_DIR
set -euo pipefail
source "$(dirname "$0")/../support/alone.sh"
alone "$@"
cat >cell.yaml <<'Y'
invar_cell: 1
name: guarded
domain: 9
profiles: profiles.yaml
shared_memory: false
security: {keys: keys, operators: [anna, ben], viewers: [wall]}
processes:
  loop:
    realtime: {rate: 100}
    components:
      heater: {type: simulated_heater, map: heater.yaml, port: 1502}
      thermal: {type: thermal, setpoint: 30, modbus: {port: 1502, map: heater.yaml}}
  watch: {rate: 10, components: {supervisor: {type: supervisor}}}
Y
fail() { echo "$*"; tail -n 30 ./*.log; exit 1; }
until_says() { for _ in $(seq 200); do grep -qE "$1" "$2" && return; sleep 0.1; done; fail "$2 never says: $1"; }
echoes() { "$invar" echo "$1" thermal.state --as "$2" --json --wait 20 >"$3" 2>"$3.log" & pids+=($!); }
set_point() { "$invar" param set "$1" thermal setpoint "$3" --as "$2" --wait "${4:-20}"; }

"$invar" keys cell.yaml >keys.log
cp -r keys ben-keys  # Ben keeps the list of an earlier day
sed 's/keys: keys/keys: ben-keys/' cell.yaml >ben.yaml
"$invar" run cell.yaml >run.log 2>&1 & run=$!; pids+=("$run")
"$invar" status cell.yaml --wait 20 >status.log || fail "the cell is not well"
echoes cell.yaml anna anna.txt
echoes ben.yaml ben ben.txt
until_says sequence anna.txt
until_says sequence ben.txt
set_point ben.yaml ben 31 >set.log 2>&1 || fail "an operator may not command"

"$invar" keys cell.yaml --revoke ben >keys.log
date +%s%N >revoked.txt
sleep 2
! set_point ben.yaml ben 66 2 >set.log 2>&1 || fail "a command of a revoked operator was carried out"
"$invar" param get cell.yaml thermal setpoint --as anna --wait 20 >get.log
grep -q 31 get.log || fail "the setpoint moved: $(cat get.log)"
until_says '`invar/tools/invar-echo` is revoked: nothing that it sends is taken any more' run.log
sleep 6
/usr/bin/python3 - <<'P' || fail "the samples are not those"
import json
revoked = int(open("revoked.txt").read())
rows = {name: [json.loads(line) for line in open(f"{name}.txt")] for name in ("anna", "ben")}
steps = {b["sequence"] - a["sequence"] for a, b in zip(rows["anna"], rows["anna"][1:])}
late = (rows["ben"][-1]["sent_ns"] - revoked) * 1e-9
heard = (rows["anna"][-1]["sent_ns"] - revoked) * 1e-9
print(f"the revoked operator got its last sample {late:.2f} s after; the other one got {len(rows['anna'])} without a gap, to {heard:.2f} s after")
assert steps == {1}, steps
assert late < 8 < heard, (late, heard)
P
"$invar" status cell.yaml --as anna --wait 20 >status.log || fail "the cell is not well"

# Renewal: the process whose certificate is another is started anew in order, and no other one.
pid_of() { "$invar" status cell.yaml --as anna --json --wait 20 | /usr/bin/python3 -c 'import json,sys; print(next(p["pid"] for p in json.load(sys.stdin)["processes"] if p["name"]==sys.argv[1]))' "$1"; }
loop=$(pid_of loop)
watch=$(pid_of watch)
"$invar" keys cell.yaml --renew watch >keys.log
until_says 'watch/certificate.pem: another certificate is there' run.log
"$invar" echo cell.yaml cell/guarded/process/status --as anna --json --wait 20 >status.txt 2>status.txt.log & pids+=($!)
until_says '"watch"' status.txt
kill -USR2 "$run"
until_says 'process `watch` has another certificate: it ends in order and starts anew' run.log
sleep 4
"$invar" status cell.yaml --as anna --wait 20 >status.log || fail "the cell is not well with the new certificate"
[[ $(pid_of loop) == "$loop" ]] || fail "another process was started anew"
[[ $(pid_of watch) != "$watch" ]] || fail "the process was not started anew"
/usr/bin/python3 - <<'P' || fail "the process did not come back"
import json
rows = [json.loads(line) for line in open("status.txt")]
times = [r["sent_ns"] for r in rows if r["value"]["process_name"] == "watch" and r["value"]["pid"] != 0]
gap = max(b - a for a, b in zip(times, times[1:])) * 1e-9
print(f"renewed: {gap:.2f} s between two statuses of the process (one second each)")
assert gap < 10, gap
P
kill -INT "$run"
wait "$run" || fail "the cell did not end in order"
echo passed
