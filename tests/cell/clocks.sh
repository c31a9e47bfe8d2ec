#!/usr/bin/env bash
# Clocks of two PCs apart by seconds and by an hour: what a command asks is carried out, or refused with the difference named and
# not carried out. The clock of the command is set by libfaketime; the cell's own is right.
# clocks.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
source "$(dirname "$0")/own_cell.sh"
own_cell mismatch "$source" 15030
cd "$folder"
cell=deployment/mismatch.yaml
library=/usr/lib/$(uname -m)-linux-gnu/faketime/libfaketimeMT.so.1
[[ -e $library ]] || { echo "$library is missing; install libfaketime"; exit 1; }
sed -i "s/^        control:/        following_error: 0.05  # a host that stalls must not trip the axis\n        control:/" $cell
"$invar" run $cell --real-time >cell.log 2>&1 &
cell_pid=$!
trap 'kill $cell_pid 2>/dev/null || true; wait; rm -rf "$folder"' EXIT
fail() { echo "$*"; cat said; tail -20 cell.log; exit 1; }
touch said
"$invar" status $cell --wait 60 >/dev/null || fail "the cell does not come up"
# at OFFSET STATUS WORDS ARGUMENTS...: by a clock so far off, `invar ARGUMENTS` ends with the status and says the words.
at() {
  local offset=$1 wanted=$2 words=$3 status=0; shift 3
  LD_PRELOAD=$library FAKETIME=$offset FAKETIME_DONT_FAKE_MONOTONIC=1 "$invar" "$@" --wait 30 >said 2>&1 || status=$?
  [[ $status == "$wanted" ]] && { [[ -z $words ]] || grep -qE -- "$words" said; } || fail "$offset: \`$*\` ends with $status, not $wanted and: $words"
}
# is PATH VALUE: so it is, by a clock that is right.
is() { [[ $("$invar" param get $cell stage_x "$1" --wait 30) == "$2" ]] || fail "$1 is not $2"; }
state() { "$invar" status $cell --json --wait 30 | tr -d ' \n' | grep -oE '"(name|component)":"watch_x"[^}]*"state":"[a-z]*"' | grep -oE '[a-z]*"$' | tr -d '"'; }

value=0.010
for offset in +3s -3s +1h; do
  value=$(awk -v v=$value 'BEGIN { print v + 0.001 }')
  at $offset 0 "$value s" param set $cell stage_x settle_time "$value"
  is settle_time "$value s"
  at $offset 0 "inactive" lifecycle $cell watch_x deactivate
  at $offset 0 "active" lifecycle $cell watch_x activate
done
at -1h 1 "not carried out: .*36[0-9][0-9] s behind" param set $cell stage_x settle_time 0.5
is settle_time "$value s"
at -1h 0 "$value s" param get $cell stage_x settle_time # to look harms nobody
at -1h 1 "not carried out: .*36[0-9][0-9] s behind" lifecycle $cell watch_x deactivate
at +0s 1 "active" lifecycle $cell watch_x configure # it is active still

for offset in +3s +1h; do
  at $offset 0 "is active" job apply $cell stage_x --model deployment/machines/linear-axis-believed.yaml
  at $offset 0 "" job run $cell excite --detach
  running=; for _ in $(seq 100); do "$invar" job list $cell | grep -q running && running=yes && break; sleep 0.1; done
  [[ -n $running ]] || fail "$offset: the job does not run"
  at $offset 0 "cancelled" job cancel $cell
done
for offset in -3s -1h; do
  at $offset 1 "not carried out: .* s behind" job apply $cell stage_x --none
  at $offset 1 "not carried out: .* s behind" job run $cell excite --detach
  sleep 0.5
  ! "$invar" job list $cell | grep -q running || fail "$offset: the job was carried out"
done
"$invar" job apply $cell stage_x --rollback --wait 30 >said || fail "the model was taken out" # there was one before

# A clock that is set back while somebody records: the file goes on in time, and the times of sending are kept.
at -3s 0 "" record $cell --out run.mcap --topic stage_x.state --duration 5
"$invar" export run.mcap --out tables >/dev/null
awk -F, 'NR > 1 { if ($3 + 0 < last) exit 1; last = $3 + 0; rows++ } END { if (rows < 50) exit 1 }' tables/cell.mismatch.stage_x.state.csv ||
  fail "log times of the recording go back"
kill -INT $cell_pid
wait $cell_pid || fail "the cell did not end in order"
echo passed
