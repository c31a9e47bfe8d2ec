#!/usr/bin/env bash
# The statistics of Fast DDS, for its monitor: switched on by its own variable, they appear in a running cell, whose participants have
# readable names; a cell without the variable has none. statistics.sh INVAR SOURCE_DIR
set -euo pipefail
source "$(dirname "$0")/../support/alone.sh"
alone "$@"
cat >cell.yaml <<'Y'
invar_cell: 1
name: seen
domain: 9
profiles: profiles.yaml
processes:
  watch: {rate: 10, components: {supervisor: {type: supervisor}}}
  tape: {rate: 10, components: {recorder: {type: recorder, out: out}}}
Y
fail() { echo "$*"; tail -n 30 ./*.log ./*.json; exit 1; }
topics() {  # topics FILE: with those of Fast DDS
  "$invar" run cell.yaml >run.log 2>&1 & pids=($!)
  "$invar" status cell.yaml --wait 20 >status.log || fail "the cell is not well"
  "$invar" topics cell.yaml --all --json >"$1" 2>topics.log || true
  kill -INT "${pids[0]}"
  wait "${pids[0]}" || fail "the cell did not end in order"
  pids=()
}
topics without.json
! grep -q _fastdds_statistics without.json || fail "statistics without the variable"
export FASTDDS_STATISTICS="PHYSICAL_DATA_TOPIC;DISCOVERY_TOPIC;DATA_COUNT_TOPIC"
topics with.json
/usr/bin/python3 - <<'P' || fail "the statistics are not those"
import json
topics = {topic["topic"]: topic for topic in json.load(open("with.json"))}
for name in ("physical_data", "discovered_entity", "data_count"):
    writers = {end["participant"] for end in topics[f"_fastdds_statistics_{name}"]["writers"]}
    print(name, sorted(writers))
    assert {"invar/seen/watch", "invar/seen/tape"} <= writers, writers
P
echo passed
