#!/usr/bin/env bash
# The link between a commander and the axis that it moves is cut in mid-move: the axis begins to stop within 100 ms and rests
# within its own deceleration, or finishes where its file says so; 5 % of packets lost stop nothing; kill -9 of a commander on
# the same PC stops the axis.
# lost_commander.sh INVAR SOURCE_DIR
set -euo pipefail
source "$(dirname "$0")/../interop/three_namespaces.sh"
source "$(dirname "$0")/../support/loss.sh"
source "$(dirname "$0")/axis_process.sh"
as_root "$@"
invar=$1 source=$2
three_namespaces
cp "$source/deployment/profiles.yaml" "$folder"
cp "$source/deployment/machines/xy-table-nominal.yaml" "$folder/machine.yaml"
cd "$folder"
# cell NAME TRIAL_HOST LOST_COMMANDER STROKES
cell() {
  {
  cat <<Y
invar_cell: 1
name: lost
domain: 13
time: real
profiles: profiles.yaml
hosts: {stage-pc: {address: 10.81.0.11}, trial-pc: {address: 10.81.0.12}}
processes:
Y
  axis_process 'realtime: {rate: 1000, priority: 60}' '{velocity: 0.05, acceleration: 0.5, jerk: 50}' "lost_commander: $3"
  cat <<Y
  trials:
    host: $2
    rate: 100
    components:
      trial:
        type: axis_trial
        axis: 0
        motion: [{name: move, from: 0.18, to: 0.02, velocities: [$4]}]
        connect: {state: stage_x.state, command: stage_x.command}
  recorder: {host: stage-pc, rate: 50, components: {recorder: {type: recorder}}}
jobs: {move: trial}
Y
  } >"$1"
  "$invar" check "$1" >/dev/null
}
names=(stage-pc trial-pc)
fail() { echo "$*"; tail -n 30 ./*.log said; exit 1; }
start() { apart "$2" "$invar" run "$1" --host "${names[$2]}" >"$2.log" 2>&1 & run[$2]=$!; pids+=("$!"); }
stop() { kill -INT "${run[$1]}"; wait "${run[$1]}" || true; }
up() { for _ in $(seq 100); do on 0 "$invar" status "$1" --wait 0.5 >said 2>&1 && return; done; fail "the cell does not come up"; }
moving() { on 0 "$invar" echo "$1" stage_x.state --count 1 --json --wait 20 2>/dev/null | /usr/bin/python3 -c '
import json, sys
sample = json.loads(sys.stdin.readline())
sys.exit(not abs(sample.get("value", sample)["setpoint_velocity"]) > 0.049)'; }
until_moving() { for _ in $(seq 200); do moving "$1" && return; done; fail "the axis does not move"; }
now() { date +%s%N; }
# after_cut WANTED: what the recording says of the axis since.
after_cut() {
  rm -rf tables
  "$invar" export out/recording.mcap --out tables >/dev/null
  /usr/bin/python3 - "$cut_at" "$before" "$1" tables/*stage_x*state*.csv <<'P'
import csv, sys
cut, order, wanted = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
rows = list(csv.DictReader(open(sys.argv[4])))
column = lambda word: next(k for k in rows[0] if k.startswith(word))
time, speed, place = column("at.time_ns"), column("setpoint_velocity"), column("setpoint_position")
states = [(int(r[time]), float(r[speed]), float(r[place]), r["mode"].removeprefix("AXIS_MODE_")) for r in rows]
at_cut = max((s for s in states if s[0] <= order), key=lambda s: s[0])
assert abs(at_cut[1]) > 0.045, f"the axis moved at {at_cut[1]} m/s when the link was cut"
since = [s for s in states if s[0] > order]
slower = next(s for s in since if abs(s[1]) < abs(at_cut[1]) - 1e-6)
rest = next(s for s in since if s[1] == 0.0)
begun, way = (slower[0] - cut) / 1e6, abs(rest[2] - slower[2])
print(f"{wanted}: slower {begun:.1f} ms after the cut ({(slower[0] - order) / 1e6:.1f} ms after it was ordered), then {way * 1e3:.2f} mm, {abs(rest[2] - at_cut[2]) * 1e3:.2f} mm since the cut")
if wanted == "stop":
    # v^2 / 2a, and v a / 2j for the jerk.
    own = 0.05**2 / (2 * 0.5) + 0.05 * 0.5 / (2 * 50)
    assert begun <= 100.0, begun
    assert way <= 1.05 * own, (way, own)
    assert slower[3] == "STOPPING", slower
else:
    assert abs(rest[2] - 0.02) < 1e-9 or abs(rest[2] - 0.18) < 1e-9, rest
P
}

# Cut, shorter than any lease: the job ends with the reason when the link is back.
cell stop.yaml trial-pc stop 0.05
start stop.yaml 0; start stop.yaml 1
up stop.yaml
on 1 "$invar" job run stop.yaml move >job 2>&1 & job=$!
until_moving stop.yaml
before=$(now)
cut 1
cut_at=$(now)
sleep 0.6
mend 1
wait "$job" && fail "the job was done all the same"
cat job
grep -q 'stage_x .*`trial`' job || fail "the job does not name commander and stage"
sleep 0.5
stop 0; stop 1
after_cut stop
grep -q 'stopped: its commander, `trials` on 10.81.0.12, is lost' 0.log || fail "the host of the commander is not named"
grep -q 'its commander, `trials` on 10.81.0.12, is heard' tables/*notices*.csv || fail "nobody says that it is back"

# By decision: to the end.
rm -rf out
cell finish.yaml trial-pc finish 0.05
start finish.yaml 0; start finish.yaml 1
up finish.yaml
on 1 "$invar" job run finish.yaml move --detach >job 2>&1 || fail "$(cat job)"
until_moving finish.yaml
before=$(now)
cut 1
cut_at=$(now)
sleep 4
mend 1
stop 0; stop 1
after_cut finish
grep -q 'goes on to the end of its motion' 0.log || fail "nobody says that it goes on"

# One packet of twenty is lost on both hosts: no stop.
cell loss.yaml trial-pc stop '0.05, 0.05'
start loss.yaml 0; start loss.yaml 1
up loss.yaml
for host in 0 1; do
  on $host nft "$(loss cable 50)"
done
on 1 "$invar" job run loss.yaml move >job 2>&1 || fail "$(cat job)"
on 0 nft list table inet loss | grep -o 'counter packets [0-9]*'
for host in 0 1; do on $host nft delete table inet loss; done
stop 0; stop 1
grep -q 'is lost' 0.log && fail "5 % of the packets lost stop the axis"

# The same PC: the process of the commander is killed.
rm -rf out
cell one.yaml stage-pc stop 0.05
start one.yaml 0
up one.yaml
on 0 "$invar" job run one.yaml move --detach >job 2>&1 || fail "$(cat job)"
until_moving one.yaml
victim=$(pgrep -P "${run[0]}" -f 'trials')
before=$(now)
cut_at=$before
kill -9 "$victim"
sleep 1.5
stop 0
after_cut stop
grep -q 'stopped: its commander, `trials` on 10.81.0.11, is lost' 0.log || fail "the commander is not named"
echo passed
