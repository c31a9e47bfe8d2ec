#!/usr/bin/env bash
# A domain and a port of its own for standby.py and hung_loop.py. standby.sh INVAR SOURCE_DIR heat|motion|renewed-heat|renewed-motion|hung
set -euo pipefail
source "$2/tests/support/claims.sh"
folder=$(dirname "$0")
if [[ $3 == hung ]]; then exec /usr/bin/python3 "$folder/hung_loop.py" "$1" "$2" "$domain" "$port"; fi
exec /usr/bin/python3 "$folder/standby.py" "$1" "$2" "$domain" "$port" "$3"
