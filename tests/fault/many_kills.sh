#!/usr/bin/env bash
# A domain and a port of its own for many_kills.py. many_kills.sh INVAR SOURCE_DIR [SEED]
set -euo pipefail
source "$2/tests/support/claims.sh"
exec /usr/bin/python3 "$2/tests/fault/many_kills.py" "$1" "$2" "$domain" "$port" "${@:3}"
