#!/usr/bin/env bash
# A domain and a port of its own for real_time_process.py.
# real_time_process.sh INVAR SOURCE_DIR
set -euo pipefail
source "$2/tests/support/claims.sh"
/usr/bin/python3 "$2/tests/cell/real_time_process.py" "$1" "$2" "$domain" "$port"
