#!/usr/bin/env bash
# One cell on three PCs, each a network namespace: all find each other with and without multicast, a PC that starts without its
# cable works alone and joins, one that was cut off comes back, and the status is never well meanwhile.
# hosts.sh INVAR SOURCE_DIR [RUNS]
set -euo pipefail
source "$(dirname "$0")/../interop/three_namespaces.sh"
source "$(dirname "$0")/axis_process.sh"
as_root "$@"
invar=$1 source=$2 runs=${3:-1}
three_namespaces
cp "$source/deployment/profiles.yaml" "$folder"
cp "$source/deployment/machines/xy-table-nominal.yaml" "$folder/machine.yaml"
cd "$folder"
{
cat <<'Y'
invar_cell: 1
name: hosts
domain: 12
time: real
profiles: profiles.yaml
hosts: {stage-pc: {address: 10.81.0.11}, trial-pc: {address: 10.81.0.12}, office-pc: {address: 10.81.0.13}}
processes:
Y
axis_process 'rate: 1000' '{velocity: 0.05, acceleration: 0.05, jerk: 10}'
cat <<'Y'
  trials:
    host: trial-pc
    rate: 100
    components:
      trial:
        type: axis_trial
        axis: 0
        motion: [{name: move, from: 0.18, to: 0.02, velocities: [0.05]}]
        connect: {state: stage_x.state, command: stage_x.command}
  watch: {host: office-pc, rate: 10, components: {supervisor: {type: supervisor}}}
jobs: {move: trial}
Y
} >cell.yaml
names=(stage-pc trial-pc office-pc)
fail() { echo "$*"; tail -n 20 ./*.log; exit 1; }
start() { ip netns exec "${pc[$1]}" "$invar" run cell.yaml --host "${names[$1]}" >"$1.log" 2>&1 & run[$1]=$!; pids+=("$!"); }
stop() { kill -INT "${run[$1]}"; wait "${run[$1]}" || true; }
well_on() { on "$1" "$invar" status cell.yaml --wait 0.3; }
# says_not_well HOST WORDS: its status is 1 and says so.
says_not_well() {
  local status=0
  on "$1" "$invar" status cell.yaml --wait 2 >said 2>&1 || status=$?
  [[ $status == 1 ]] && grep -qE "$2" said || { cat said; fail "status $status, without: $2"; }
}
within() { (($2 <= $3)) || fail "$1 took $2 ms, more than $3"; echo "$1: $2 ms"; }

for ((i = 0; i < runs; i++)); do
  for group in with without; do
    [[ $group == with ]] || no_multicast
    for n in 0 1 2; do start $n; done
    within "all active, $group multicast" "$(milliseconds well_on 2)" 10000
    [[ $group == with ]] || with_multicast
    for n in 0 1 2; do stop $n; done
  done

  # Without a cable: alone, and with all two seconds after it is in.
  cable 1 down
  for n in 0 1 2; do start $n; done
  for _ in $(seq 100); do grep -q 'works alone until' 1.log && break; sleep 0.1; done
  grep -q 'no running interface of this PC has 10.81.0.12' 1.log || fail "1.log does not say that the cable is out"
  for _ in $(seq 50); do on 1 "$invar" lifecycle cell.yaml trial show >said 2>&1 && break; sleep 0.1; done
  on 1 "$invar" status cell.yaml --wait 2 >said 2>&1 && fail "well without the others"
  grep -qE 'trial +trials .*active' said || { cat said; fail "the PC without its cable does not work alone"; }
  cable 1 up
  within "active after the cable is in" "$(milliseconds well_on 1)" 10000

  # Cut for 4 s where nobody sees it: what depends on the stage is deactivated, told with the command, and active again by itself.
  cut 0
  sleep 4
  says_not_well 1 'does not answer|lost'
  says_not_well 2 'trial: is inactive; `invar lifecycle CELL trial activate`'
  mend 0
  within "all active after a cut of 4 s" "$(milliseconds well_on 1)" 10000
  for n in 0 1 2; do stop $n; done
done
echo passed
