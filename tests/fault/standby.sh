#!/usr/bin/env bash
# A domain and a port of its own for standby.py and hung_loop.py.
# standby.sh INVAR SOURCE_DIR heat|motion|renewed-heat|renewed-motion|renewed-apart|hung
set -euo pipefail
if [[ $3 == renewed-apart ]]; then
  source "$(dirname "$0")/../interop/two_namespaces.sh"
  as_root "$@"
fi
source "$2/tests/support/claims.sh"
folder=$(dirname "$0")
if [[ $3 == hung ]]; then exec /usr/bin/python3 "$folder/hung_loop.py" "$1" "$2" "$domain" "$port"; fi
exec /usr/bin/python3 "$folder/standby.py" "$1" "$2" "$domain" "$port" "$3"
