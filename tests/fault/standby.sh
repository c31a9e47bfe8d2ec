#!/usr/bin/env bash
# standby.sh INVAR SOURCE_DIR heat|motion
set -euo pipefail
source "$2/tests/support/claims.sh"
exec /usr/bin/python3 "$(dirname "$0")/standby.py" "$1" "$2" "$domain" "$port" "$3"
