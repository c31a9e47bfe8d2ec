#!/usr/bin/env bash
# Ten secured participants that start at once all find one another, each time. Without the filter's lock some pair of ten never
# does: Fast DDS 2.9 overwrites the endpoints of one handshake with those of another. many_secured.sh INVAR SOURCE_DIR BENCH [RUNS]
set -euo pipefail
source "$(dirname "$0")/../support/alone.sh"
alone "$@"
bench=$3 runs=${4:-3}
{
  printf 'invar_cell: 1\nname: bench\ndomain: 88\nprofiles: profiles.yaml\nprocesses:\n'
  for n in {0..9}; do echo "  p$n: {rate: 10, components: {s$n: {type: supervisor}}}"; done
} >cell.yaml
"$invar" keys cell.yaml >keys.log
for run in $(seq "$runs"); do
  echo "run $run"
  "$bench" discovery keys 10 || { echo "some never found one another"; exit 1; }
done
